"""Two cameras that run for a while: their rate, how far apart their pictures are taken, and what is on them."""

from dataclasses import dataclass

import numpy as np

from stereogrid.checks import OK, PROBLEM, WARNING, Check

from ..cameras.pairs import RawPair, StereoPairs
from ..clock import now_s

FIRST_S = 8.0
"""A webcam takes up to some seconds to its first picture."""
LEAST_RATE = 0.8
DARK, ALIKE = 20.0, 0.5
UNLIKE = 25.0
"""Means of grey values: of a covered lens (black is 16 to many a camera), of the difference between two pictures of one
camera, and between the means of two cameras whose exposures differ."""
MOST_LOST = 0.2


@dataclass(frozen=True)
class Measured:
    """What came in duration_s. skew_s (n,): right later than left; means: mean grey value of the last left and right
    picture; difference: mean |left - right| of them; skewed, broken: pairs and pictures that were thrown away."""

    size_px: tuple[int, int]
    stamps_s: tuple[float, ...]
    skew_s: tuple[float, ...]
    skewed: int
    broken: int
    means: tuple[float, float]
    difference: float

    @property
    def rate_hz(self) -> float:
        """Pairs a second."""
        if len(self.stamps_s) < 2:
            return 0.0
        return (len(self.stamps_s) - 1) / max(self.stamps_s[-1] - self.stamps_s[0], 1e-6)


def measure(pairs: StereoPairs, duration_s: float) -> tuple[Measured, RawPair | None]:
    """Watch two cameras, from their first pair on; the last pair, None when there was none."""
    box = pairs.subscribe(256)
    try:
        pair = box.get(FIRST_S)
        skewed, broken = pairs.counts.skewed, pairs.counts.broken
        got, end_s = [], now_s() + duration_s
        while pair is not None:
            got.append(pair)
            pair = box.get(end_s - now_s()) if now_s() < end_s else None
    finally:
        box.close()
    last = got[-1] if got else None
    measured = Measured(
        pairs.size_px,
        tuple(each.stamp_s for each in got),
        tuple(each.skew_s for each in got),
        pairs.counts.skewed - (skewed if got else 0),
        pairs.counts.broken - (broken if got else 0),
        (float(last.left.mean()), float(last.right.mean())) if last else (0.0, 0.0),
        float(np.abs(last.left.astype(float) - last.right).mean()) if last else 0.0,
    )
    return measured, last


def judge(measured: Measured, fps: float | None, problem: str = "") -> list[Check]:
    """Checks of what was measured. fps: the rate that was asked for, None where cameras have their own; problem: what
    the cameras say is wrong."""
    if not measured.stamps_s:
        why = problem or f"{measured.skewed} were too far apart, {measured.broken} pictures could not be read"
        remedy = "the checks of USB and permission above; another program that holds a camera; then plug them in again"
        return [Check("camera pairs", PROBLEM, f"no pair came: {why}", remedy)]
    return [_rate(measured, fps), _skew(measured), _pictures(measured)]


def _rate(measured: Measured, fps: float | None) -> Check:
    width, height = measured.size_px
    asked = "" if fps is None else f" of {fps:g}"
    found = f"{width}x{height}, {measured.rate_hz:.1f} pairs/s{asked}, {measured.broken} broken pictures"
    values = {"size_px": [width, height], "rate_hz": measured.rate_hz, "broken": measured.broken}
    if fps is not None and measured.rate_hz < LEAST_RATE * fps:
        remedy = "more light (dark rooms slow cameras down), a smaller --size or --fps, nothing else on their USB bus"
        return Check("camera pairs", WARNING, found, remedy, values)
    if measured.broken > MOST_LOST * len(measured.stamps_s):
        return Check("camera pairs", WARNING, found, "a shorter cable, or another USB port", values)
    return Check("camera pairs", OK, found, values=values)


def _skew(measured: Measured) -> Check:
    skews_ms = 1000 * np.abs(measured.skew_s)
    median, p95, worst = (float(value) for value in (*np.percentile(skews_ms, [50, 95]), skews_ms.max()))
    lost = measured.skewed / (measured.skewed + len(skews_ms))
    found = f"median {median:.1f} ms, 95 % within {p95:.1f}, worst {worst:.1f}; {100 * lost:.0f} % of pairs thrown away"
    values = {"median_ms": median, "p95_ms": p95, "worst_ms": worst, "thrown_away": lost}
    if lost > MOST_LOST:
        remedy = "start it again (free-running cameras begin at another moment each time); turn slowly"
        return Check("camera skew", WARNING, found, remedy, values)
    return Check("camera skew", OK, found, values=values)


def _pictures(measured: Measured) -> Check:
    left, right = measured.means
    found = f"mean grey left {left:.0f}, right {right:.0f} of 255"
    values = {"left": left, "right": right, "difference": measured.difference}
    if min(left, right) < DARK:
        return Check("pictures", WARNING, f"{found}: dark", "light, or a cap that is still on a lens", values)
    if measured.difference < ALIKE:
        return Check("pictures", WARNING, f"{found}, and they are the same", "name two cameras, not one twice", values)
    if abs(left - right) > UNLIKE:
        remedy = "install v4l-utils, which lets exposures be locked; look for a thing that covers one lens"
        return Check("pictures", WARNING, f"{found}: the exposures differ", remedy, values)
    return Check("pictures", OK, found, values=values)
