"""Arms on a real street without a mesh: every other pair makes the map, the pairs between them score it."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from threading import Event
from typing import Annotated

import numpy as np

from stereogrid.camera import StereoCamera
from stereogrid.config import GridConfig
from stereogrid.described import Doc, check_fields
from stereogrid.errors import InvalidInputError, RecordingError
from stereogrid.mapping_run import Track
from stereogrid.matching import matcher
from stereogrid.observation import Disparity, Recording
from stereogrid.recording import Subset
from stereogrid.scoring import Score
from stereogrid.scoring.held_out import HELD_OUT_NAMES, HeldOutRays, held_out_scores
from stereogrid.sensor_model import SensorModel

from .compared import Compared
from .fusion_arms import MEASURED, OF_MATCHERS, Arm, Reading, fused
from .parallel import Stage, counted, in_parallel, until

STREET = Path("sequences") / "kitti_straight"
AGREE_PX = 1.0
"""A held-out reading of the street is one that all matchers find, to so much."""
SURE_CELLS = 1.5
"""Held-out readings whose sigma is more cells than this say little of any one cell."""


@dataclass(frozen=True)
class StreetConfig:
    """The street: every other pair is mapped, the others are held out."""

    matchers: Annotated[tuple[str, ...], Doc("Seen on the street.")] = ("bm", "sgbm")
    num_disparities: Annotated[int, Doc("Disparities searched.", "px", above=0)] = 128
    cell_m: Annotated[float, Doc("Edge of a cell.", "m", above=0)] = 0.2
    max_range_m: Annotated[float, Doc("Depths beyond it are not used.", "m", above=0)] = 15.0
    rays: Annotated[int, Doc("Drawn from each held-out pair.", above=0)] = 1000
    most_pairs: Annotated[int, Doc("At most so many pairs, mapped and held out; 0: all.", least=0)] = 0

    def __post_init__(self) -> None:
        check_fields(self, but=("most_pairs",))
        if not self.matchers or self.most_pairs < 0 or self.most_pairs == 1:
            raise InvalidInputError("the street needs a matcher, and two pairs or more (0: all)")
        for name in self.matchers:
            matcher(name, num_disparities=self.num_disparities)


def compare_on_street(street: Recording, config: StreetConfig, stage: Stage) -> list[Compared]:
    """The arms of each matcher, scored by what the matchers agree on in held-out pairs; these are the units."""
    stop = Event()
    n = min(config.most_pairs or len(street), len(street))
    if n < 2:
        raise RecordingError("a street of a single pair leaves none to be held out")
    with stage("matching the street", n) as step:
        pairs = list(_matched(street, config, n, until(stop, counted(step))))
    rays = [_agreed(street.camera, each, config, np.random.default_rng(k)) for k, each in enumerate(pairs[1::2])]
    arms = [(name, arm) for name in config.matchers for arm in OF_MATCHERS]
    with stage("mapping the street", len(arms) * len(pairs[::2])) as step:
        map_and_score = partial(_scored, street.camera, held_out=rays, config=config, track=until(stop, counted(step)))
        jobs = {
            (name, arm): partial(map_and_score, [each[name] for each in pairs[::2]], OF_MATCHERS[arm])
            for name, arm in arms
        }
        found = in_parallel(jobs, stop=stop)
    return [
        Compared(
            f"Street, {name}",
            {arm: found[name, arm] for arm in OF_MATCHERS},
            MEASURED,
            tuple(HELD_OUT_NAMES),
            "held-out pairs, which overlap: the intervals are too narrow",
        )
        for name in config.matchers
    ]


def _scored(
    camera: StereoCamera,
    readings: Sequence[Reading],
    arm: Arm,
    *,
    held_out: Sequence[HeldOutRays],
    config: StreetConfig,
    track: Track,
) -> dict[int, list[Score]]:
    """The scores of an arm's map by each held-out pair."""
    grid, model = GridConfig(cell_m=config.cell_m), SensorModel(max_range_m=config.max_range_m)
    made = fused(camera, track(readings, "mapping", len(readings)), arm, grid=grid, model=model)
    judge = partial(
        held_out_scores,
        made,
        cell_m=config.cell_m,
        min_range_m=camera.focal_baseline_px_m / config.num_disparities,
        max_range_m=config.max_range_m,
    )
    return {k: judge(rays) for k, rays in enumerate(held_out)}


def _matched(street: Recording, config: StreetConfig, n: int, track: Track) -> Iterator[Mapping[str, Reading]]:
    """The readings of each of the first n pairs by matcher."""
    matchers = {name: matcher(name, num_disparities=config.num_disparities) for name in config.matchers}
    for each in track(Subset(street, 0, n), "matching", n):
        yield {name: Reading(m.match(each.left, each.right), each.T_world_cam) for name, m in matchers.items()}


def _agreed(
    camera: StereoCamera, pair: Mapping[str, Reading], config: StreetConfig, rng: np.random.Generator
) -> HeldOutRays:
    """Rays to what all matchers find within AGREE_PX, at their mean."""
    found = [reading.disparity for reading in pair.values()]
    d, sigma = (np.stack([getattr(each, name) for each in found]) for name in ("disparity_px", "sigma_px"))
    agreed = np.ptp(d, axis=0) <= AGREE_PX  # False where one is NaN
    both = Disparity(np.where(agreed, d.mean(axis=0), np.nan), np.where(agreed, sigma.mean(axis=0), np.nan))
    return HeldOutRays.of_disparity(
        camera,
        both,
        next(iter(pair.values())).T_world_cam,
        n=config.rays,
        max_range_m=config.max_range_m,
        max_sigma_m=SURE_CELLS * config.cell_m,
        rng=rng,
    )
