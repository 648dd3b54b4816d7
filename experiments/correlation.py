"""`python -m experiments correlation`: how far a matcher's errors go together, over the image and over time.

L is measured a scene (see correlation_length), its mean over the real scenes is what the library uses: simulated walls
are flatter and their noise kinder than any camera's. What changes from frame to frame is measured on a real rig that
stands still, and what motion does to the error of a surface point on simulated drives, where every point is known.
"""

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, is_dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import stereogrid.matching.correlation
from stereogrid.errors import unknown_name
from stereogrid.figures import save_figure
from stereogrid.files import written_beside
from stereogrid.matching import MATCHERS
from stereogrid.matching.correlation import ErrorReach, error_reaches
from stereogrid.matching.sigma import GENERIC
from stereogrid.recorded_run import recorded_run
from stereogrid.report import write_metrics
from stereogrid.run_record import RunRecord
from stereogrid.runs import finished_path

from .correlation_figures import motion_figure, rho_figure
from .correlation_length import Autocorrelation, autocorrelation, pooled
from .correlation_motion import Decorrelation, decorrelation, static_share
from .correlation_scenes import SLOW, scene_errors, scenes, short_drives, static_pairs
from .parallel import Stage, in_parallel
from .sigma import WITHOUT_TABLE
from .sigma_scenes import Scene
from .tidy import write_rows

LENGTHS = Path(stereogrid.matching.correlation.__file__).with_name("correlation_lengths.json")
COMMAND = "python -m experiments correlation --data ../shared/data --write"
WINDOWS_PX = (8, 16, 32)
"""Sides of the windows for which the looks are reported: near cells fall on such windows."""
MEANS = ("correlation_px", *(f"looks_{side}" for side in WINDOWS_PX))


@dataclass(frozen=True)
class Row:
    """The correlation of one matcher's errors on scenes of one kind: L, and the looks in windows of WINDOWS_PX."""

    matcher: str
    group: str
    scenes: str
    real: bool
    correlation_px: float
    looks_8: float
    looks_16: float
    looks_32: float
    reach_px: int
    bias: float
    spread: float
    n: int


@dataclass(frozen=True)
class Measured:
    """All about one matcher: rows and rho by their scenes; means of L over real and simulated scenes; what motion does.

    Means are geometric, over groups of scenes that share anything.
    """

    rows: Sequence[Row]
    rho: Mapping[str, Autocorrelation]
    temporal_share: float
    motion: Decorrelation

    def mean(self, number: str = "correlation_px", *, real: bool) -> float:
        """Geometric mean of a number of the rows over their groups; NaN of none."""
        groups: dict[str, list[float]] = {}
        for row in self.rows:
            if row.real is real:
                groups.setdefault(row.group, []).append(math.log(getattr(row, number)))
        return math.exp(np.mean([np.mean(each) for each in groups.values()])) if groups else math.nan

    @property
    def reach(self) -> ErrorReach:
        """What the library uses: L of the real scenes."""
        numbers = (self.mean(real=True), self.temporal_share, self.motion.decorrelation_px)
        return ErrorReach(*(round(each, 3) for each in (*numbers, self.motion.lasting_share)))


def run(
    data: Path, stage: Stage, *, runs: Path, names: Sequence[str] = (), write: bool = False, command: str = ""
) -> tuple[Path, dict[str, Measured]]:
    """Measure the named matchers (all that have a sigma table when none is named); folder and what was found.

    write: replace their numbers in LENGTHS; GENERIC's too when no matcher is named.
    """
    with_table = tuple(name for name in MATCHERS if name not in WITHOUT_TABLE)
    chosen = tuple(names) or with_table
    for name in chosen:
        if name not in with_table:
            raise unknown_name("matcher with a table", name, with_table)
    run_of = RunRecord.of("experiments correlation", command).reading(("data", data))
    with recorded_run(runs, "correlation", replace(run_of, matchers=tuple(names))) as folder:
        with stage("preparing scenes", 3) as step:
            prepared = []
            for make in (partial(static_pairs, data), partial(scenes, data), short_drives):
                prepared.append(list(make()))
                step()
        pairs, seen, drives = prepared
        found = {}
        for name in chosen:
            still, moving = (pairs[::2], drives[:2]) if name in SLOW else (pairs, drives)
            with stage(f"measuring {name}", len(seen) + len(still) + sum(len(d.views) for d in moving)) as step:
                jobs = {str(n): partial(_correlated, name, scene) for n, scene in enumerate(seen)}
                rho = list(in_parallel(jobs, step).values())
                jobs = {
                    "share": partial(static_share, name, still, step),
                    "motion": partial(decorrelation, name, moving, step),
                }
                over_time = in_parallel(jobs)
            found[name] = measured(name, seen, rho, over_time["share"], over_time["motion"])
        reaches = {name: each.reach for name, each in found.items()}
        if not names:
            reaches[GENERIC] = longest(reaches.values())
        _write_results(folder, found, reaches, command)
        if write:
            write_lengths(reaches)
    return finished_path(folder), found


def _correlated(name: str, scene: Scene) -> Autocorrelation:
    return autocorrelation(scene_errors(name, scene))


def measured(
    name: str, seen: Sequence[Scene], rho: Sequence[Autocorrelation], share: float, motion: Decorrelation
) -> Measured:
    """The scenes of one row are pooled."""
    rows, of_row = [], {}
    for row in dict.fromkeys(scene.row for scene in seen):
        own = [n for n, scene in enumerate(seen) if scene.row == row]
        whole, scene = pooled([rho[n] for n in own]), seen[own[0]]
        looks = (whole.looks(side) for side in WINDOWS_PX)
        numbers = (whole.length_px, *looks, whole.reach_px, whole.bias, whole.spread, whole.n)
        rows.append(Row(name, scene.group, row, scene.is_real, *numbers))
        of_row[row] = whole
    return Measured(rows, of_row, share, motion)


def longest(reaches: Iterable[ErrorReach]) -> ErrorReach:
    """For a matcher that nobody measured: the most cautious of each number."""
    every = list(reaches)
    most = {n: max(getattr(each, n) for each in every) for n in ("correlation_px", "decorrelation_px", "lasting_share")}
    return ErrorReach(temporal_share=min(each.temporal_share for each in every), **most)


def write_lengths(reaches: Mapping[str, ErrorReach]) -> None:
    """Put numbers into LENGTHS in place of those of the same names."""
    kept = dict(error_reaches()) if LENGTHS.exists() else {}
    plain = {name: _plain(reach) for name, reach in sorted({**kept, **reaches}.items())}
    with written_beside(LENGTHS) as temporary:
        temporary.write_text(json.dumps({"command": COMMAND, "matchers": plain}, indent=1) + "\n", encoding="utf-8")


def _plain(item: Any) -> Any:
    """For JSON, which has no infinity and no NaN: null."""
    if is_dataclass(item) and not isinstance(item, type):
        return _plain(asdict(item))
    if isinstance(item, Mapping):
        return {name: _plain(value) for name, value in item.items()}
    if isinstance(item, list):
        return [_plain(value) for value in item]
    if isinstance(item, float):
        return round(item, 3) if math.isfinite(item) else None
    return item


def _write_results(
    folder: Path, found: Mapping[str, Measured], reaches: Mapping[str, ErrorReach], command: str
) -> None:
    rows = [_plain(row) for each in found.values() for row in each.rows]
    motion = {
        name: {
            "temporal_share_still_rig": each.temporal_share,
            "temporal_share_simulated": 1 - each.motion.at_rest,
            "near_and_far_apart": each.motion.collapse(),
            "by_px": list(each.motion.by_px),
            "by_m": list(each.motion.by_m),
        }
        for name, each in found.items()
    }
    means = {
        name: {kind: {n: each.mean(n, real=kind == "real") for n in MEANS} for kind in ("real", "simulated")}
        for name, each in found.items()
    }
    rho = {name: {row: a.radial.tolist() for row, a in each.rho.items()} for name, each in found.items()}
    whole = {"matchers": dict(reaches), "means": means, "rows": rows, "motion": motion, "rho": rho}
    write_metrics(folder, {"command": command, **_plain(whole)})
    write_rows(folder / "lengths.csv", rows)
    save_figure(rho_figure({name: each.rho for name, each in found.items()}), folder / "rho.png")
    save_figure(motion_figure({name: each.motion for name, each in found.items()}), folder / "motion.png")
