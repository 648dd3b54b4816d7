"""Arms on simulated worlds, where the truth is known: a corridor drive seen by matchers, and frames of known noise."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from threading import Event

from stereogrid.config import GridConfig
from stereogrid.mapping_run import Track
from stereogrid.matching import matcher
from stereogrid.observation import Recording
from stereogrid.scoring import Score
from stereogrid.scoring.truth import MapTruth
from stereogrid.sensor_model import SensorModel

from .compared import Compared
from .drives import OBSTACLES_M, score_grid
from .frames import FramesConfig, make_frames
from .fusion_arms import CLAMPS, FIRST, MEASURED, OF_INDEPENDENT, OF_MATCHERS, USUAL_CLAMP, Reading, fused, fused_within
from .matched_maps import Seeing
from .parallel import Stage, counted, in_parallel, until

SHOWN = (
    "auc",
    "occupied_precision",
    "occupied_recall",
    "occupied_f1",
    "brier_balanced",
    "log_loss",
    "log_loss_balanced",
    "ece_width",
    "unsafe_occupied",
    "accuracy_m",
    "completeness_m",
)
OF_OBSTACLES = ("obstacle_auc", "obstacle_occupied_f1")
OF_CLAMPS = ("auc", "occupied_f1", "brier_balanced", "log_loss", "log_loss_balanced", "ece_width", "unsafe_occupied")
SEEDS = "seeds of the image noise"
Scores = list[Score]


@dataclass(frozen=True)
class Drive:
    """A recorded drive, its truth, and how it is seen and mapped."""

    recording: Recording
    truth: MapTruth
    seeing: Seeing


def compare_on_drive(drive: Drive, matchers: Sequence[str], *, clamps_of: str, stage: Stage) -> list[Compared]:
    """The arms of each matcher, and the clamps of the matcher clamps_of, "" of none; pairs are matched once a seed."""
    seeds, stop = drive.seeing.noise_seeds, Event()
    steps = len(matchers) * (len(drive.recording) + len(OF_MATCHERS)) + len(CLAMPS) * (clamps_of in matchers)
    with stage("mapping the drive", steps * len(seeds)) as step:
        track = until(stop, counted(step))
        jobs = {
            (name, seed): partial(one_seed, drive, name, seed, with_clamps=name == clamps_of, track=track)
            for seed in seeds
            for name in matchers
        }
        found = in_parallel(jobs, stop=stop)
    shown = (*SHOWN, *OF_OBSTACLES)
    arms = [
        Compared(f"Corridor, {name}", by_arm(found, name, seeds, OF_MATCHERS), MEASURED, shown, SEEDS)
        for name in matchers
    ]
    if clamps_of not in matchers:
        return arms
    clamps = by_arm(found, clamps_of, seeds, CLAMPS)
    return [*arms, Compared(f"Clamps: corridor, {clamps_of}", clamps, USUAL_CLAMP, OF_CLAMPS, SEEDS)]


def by_arm(
    found: Mapping[tuple[str, int], Mapping[str, Scores]], name: str, seeds: Sequence[int], arms: Mapping[str, object]
) -> dict[str, dict[int, Scores]]:
    """What was found for a matcher, arm by arm."""
    return {arm: {seed: found[name, seed][arm] for seed in seeds} for arm in arms}


def one_seed(drive: Drive, name: str, seed: int, *, with_clamps: bool, track: Track) -> dict[str, Scores]:
    """The scores of every arm, and of every clamp if with_clamps, of one matcher with one seed of the noise."""
    chosen = matcher(name, num_disparities=drive.seeing.num_disparities)
    seen = drive.seeing.noisy(drive.recording, seed)
    readings = [
        Reading(chosen.match(each.left, each.right), each.T_world_cam) for each in track(seen, "matching", len(seen))
    ]
    obstacles, makers = drive.truth.between(*OBSTACLES_M), _makers(drive, readings, with_clamps=with_clamps)
    named = track(makers, "mapping", len(makers))
    return {arm: score_grid(drive.truth, obstacles, makers[arm]()) for arm in named}


def _makers(drive: Drive, readings: Sequence[Reading], *, with_clamps: bool) -> dict[str, Callable]:
    """What makes the map of each arm."""
    camera, mapping = drive.recording.camera, drive.seeing.mapping
    known = {"grid": mapping.grid, "model": mapping.model}
    arms = {name: partial(fused, camera, readings, arm, **known) for name, arm in OF_MATCHERS.items()}
    if not with_clamps:
        return arms
    make = partial(fused_within, camera, readings, OF_MATCHERS[MEASURED], **known)
    return {**arms, **{name: partial(make, clamp=clamp) for name, clamp in CLAMPS.items()}}


def compare_on_frames(
    frames: FramesConfig, cells_m: Sequence[float], *, seeds: Sequence[int], stage: Stage
) -> list[Compared]:
    """The arms on frames whose noise is independent from pixel to pixel, and said to be so; a world a seed."""
    stop = Event()
    with stage("mapping frames", len(seeds) * len(cells_m) * len(OF_INDEPENDENT)) as step:
        track = until(stop, counted(step))
        jobs = {seed: partial(one_world, replace(frames, seed=seed), cells_m, track) for seed in seeds}
        found = in_parallel(jobs, stop=stop)
    return [
        Compared(
            f"Independent noise, cells of {cell_m:g} m",
            {arm: {seed: found[seed][cell_m, arm] for seed in seeds} for arm in OF_INDEPENDENT},
            FIRST,
            SHOWN,
            "worlds with noise of their own",
        )
        for cell_m in cells_m
    ]


def one_world(config: FramesConfig, cells_m: Sequence[float], track: Track) -> dict[tuple[float, str], Scores]:
    """The scores by size of cells [m] and arm."""
    made = make_frames(config)
    readings = [Reading(disparity, T_world_cam) for disparity, T_world_cam in made]
    model = SensorModel(max_range_m=config.range_m)
    truths = {cell_m: made.truth(cell_m) for cell_m in cells_m}
    wanted = [(cell_m, name) for cell_m in cells_m for name in OF_INDEPENDENT]
    found = {}
    for cell_m, name in track(wanted, "mapping", len(wanted)):
        grid = fused(made.camera, readings, OF_INDEPENDENT[name], grid=GridConfig(cell_m=cell_m), model=model)
        found[cell_m, name] = truths[cell_m].score(grid, prior=model.prior)
    return found
