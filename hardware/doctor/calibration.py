"""The calibration file: whether it can be true, whether it is of these pictures, and whether it still fits the rig."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from stereogrid.calibration import CalibrationFile, RectifiedRig, Rig, load_calibration
from stereogrid.checks import NOT_THERE, OK, PROBLEM, WARNING, Check
from stereogrid.errors import StereogridError
from stereogrid.observation import Image

from ..cameras.pairs import RawPair

AGAIN = "python -m hardware calibrate --camera SPEC --out rig.toml"
POOR_RMS_PX = 1.0
FEATURES, LEAST_MATCHES = 1500, 40
OFF_ROWS_PX = 1.0
"""Points of a rectified pair that lie this far from one another's row are lost to a matcher."""


def check_file(path: Path) -> tuple[list[Check], CalibrationFile | None]:
    """Checks of the file alone, and what it holds where it can be read."""
    try:
        file = load_calibration(path)
    except StereogridError as error:
        return [Check("calibration", PROBLEM, " ".join(str(error).split()), AGAIN)], None
    rig, camera = file.calibration, file.camera
    width, height = rig.size_px
    found = (
        f"{path}: {width}x{height}, focal length {camera.focal_px:.0f} px, baseline {1000 * rig.baseline_m:.1f} mm, "
        f"{rig.n_pairs} pairs"
    )
    values = {"size_px": [width, height], "focal_px": camera.focal_px, "baseline_m": rig.baseline_m}
    checks = [Check("calibration", OK, found, values=values)]
    if rig.errors is not None:
        found += f", rms {rig.errors.stereo_rms_px:.2f} px"
        values |= {"stereo_rms_px": rig.errors.stereo_rms_px}
        checks = [Check("calibration", OK, found, values=values)]
        if rig.errors.stereo_rms_px > POOR_RMS_PX:
            checks = [Check("calibration", WARNING, found, f"more pairs, a flat board, more light: {AGAIN}", values)]
    if file.T_base_cam is None:
        remedy = f"measure where the left lens is, and add [mount] x_m, y_m, z_m, pitch_deg to {path}"
        checks.append(Check("mount", WARNING, "the file does not say where the cameras sit on the robot", remedy))
    else:
        x_m, y_m, z_m = file.T_base_cam[:3, 3]
        checks.append(Check("mount", OK, f"left lens {x_m:.2f} m ahead, {y_m:.2f} m to the left, {z_m:.2f} m up"))
    return checks, file


def check_own(about: Mapping[str, Any], size_px: tuple[int, int]) -> tuple[Check, RectifiedRig | None]:
    """A check of what a server of rectified pictures says of them (camera.json), and what it says."""
    remedy = "mend what the server says, or give a calibration file: --calibration rig.toml"
    try:
        rig = RectifiedRig.from_table(about)
    except StereogridError as error:
        return Check("camera.json", PROBLEM, " ".join(str(error).split()), remedy), None
    camera = rig.camera
    if (camera.width_px, camera.height_px) != size_px:
        found = f"it is of {camera.width_px}x{camera.height_px}, the pictures are {size_px[0]}x{size_px[1]}"
        return Check("camera.json", PROBLEM, found, remedy), None
    found = (
        f"the server's own: {camera.width_px}x{camera.height_px}, focal length {camera.focal_px:.0f} px, "
        f"baseline {1000 * camera.baseline_m:.1f} mm"
    )
    return Check("camera.json", OK, found, values={"focal_px": camera.focal_px, "baseline_m": camera.baseline_m}), rig


def check_size(file: CalibrationFile, size_px: tuple[int, int]) -> Check:
    """Whether the cameras' pictures are of the calibration's size."""
    if file.calibration.size_px == size_px:
        return Check("calibration size", OK, f"the pictures are {size_px[0]}x{size_px[1]} too")
    width, height = file.calibration.size_px
    found = f"it is for {width}x{height}, the pictures are {size_px[0]}x{size_px[1]}"
    return Check("calibration size", PROBLEM, found, f"--size {width}x{height}, or calibrate at the other size")


@dataclass(frozen=True)
class Rows:
    """Matched points of a rectified pair. rows_px: median |row difference|; ahead: share of them with x_left > x_right,
    as all that is in front of two cameras has; n: how many."""

    rows_px: float
    ahead: float
    n: int


def match_rows(left: Image, right: Image) -> Rows:
    """Points that look alike in a rectified pair (H, W) uint8, wherever they are: no calibration is believed here."""
    orb = cv2.ORB.create(FEATURES, fastThreshold=7)
    (points_left, of_left), (points_right, of_right) = (orb.detectAndCompute(image, None) for image in (left, right))
    if of_left is None or of_right is None:
        return Rows(float("nan"), float("nan"), 0)
    matches = cv2.BFMatcher(cv2.NORM_HAMMING, crossCheck=True).match(of_left, of_right)
    best = sorted(matches, key=lambda match: match.distance)[: max(LEAST_MATCHES, len(matches) // 2)]
    return _rows(
        [points_left[match.queryIdx].pt for match in best], [points_right[match.trainIdx].pt for match in best]
    )


def _rows(left: Sequence[Sequence[float]], right: Sequence[Sequence[float]]) -> Rows:
    if not left:
        return Rows(float("nan"), float("nan"), 0)
    apart = np.asarray(left, float) - np.asarray(right, float)
    return Rows(float(np.median(np.abs(apart[:, 1]))), float((apart[:, 0] > 0).mean()), len(apart))


def check_fit(rig: Rig, pair: RawPair) -> Check:
    """Whether the calibration fits what the cameras see now: a rig that was knocked or swapped does not."""
    name = "calibration fits"
    rows = match_rows(*rig.rectify(pair.left, pair.right))
    if rows.n < LEAST_MATCHES:
        return Check(name, NOT_THERE, f"too little to see: {rows.n} points", "let the cameras see a textured room")
    found = f"{rows.n} points lie {rows.rows_px:.1f} px off their rows (median), {100 * rows.ahead:.0f} % in front"
    values = {"rows_px": rows.rows_px, "ahead": rows.ahead, "n": rows.n}
    if rows.ahead < 0.5:
        return Check(
            name, PROBLEM, f"{found}: left and right are swapped", "the other --swap, or the other order", values
        )
    if rows.rows_px > OFF_ROWS_PX:
        remedy = f"the cameras have moved against each other, or others are plugged in: {AGAIN}"
        return Check(name, WARNING, found, remedy, values)
    return Check(name, OK, found, values=values)
