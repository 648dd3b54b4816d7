"""Arms on a real room: measured depths as the disparities of a virtual rig, other frames' depths as the truth."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from threading import Event
from typing import Annotated

import numpy as np

from stereogrid.camera import StereoCamera
from stereogrid.config import GridConfig
from stereogrid.described import Doc, check_fields
from stereogrid.errors import RecordingError
from stereogrid.geometry import FloatArray
from stereogrid.mapping_run import Track
from stereogrid.observation import Disparity
from stereogrid.recording.rgbd_files import read_depth_m, read_pose_file
from stereogrid.recording.rgbd_frames import PATTERN, PER_M
from stereogrid.recording.virtual_rig import measured_disparity, with_noise
from stereogrid.scoring import Score
from stereogrid.scoring.held_out import HELD_OUT_NAMES, HeldOutRays, held_out_scores
from stereogrid.sensor_model import SensorModel

from .compared import Compared
from .drives import N_SEEDS
from .fusion_arms import FIRST, OF_INDEPENDENT, Reading, fused
from .parallel import Stage, counted, in_parallel, until

ROOM = Path("sequences") / "rgbd_7scenes"
FOCAL_PX, CENTRE_PX, SIZE_PX = 585.0, (320.0, 240.0), (640, 480)
"""Of the depth camera."""
NEAREST_M = 0.5
"""A Kinect sees nothing nearer."""


@dataclass(frozen=True)
class RoomConfig:
    """The room: measured depths become disparities of a virtual rig with noise independent from pixel to pixel."""

    baseline_m: Annotated[float, Doc("Of the virtual rig.", "m", above=0)] = 0.06
    sigma_px: Annotated[float, Doc("Noise of the disparities: standard deviation.", "px", above=0)] = 0.25
    cell_m: Annotated[float, Doc("Edge of a cell.", "m", above=0)] = 0.05
    max_range_m: Annotated[float, Doc("Depths beyond it are not used.", "m", above=0)] = 4.0
    every: Annotated[int, Doc("Of the frames, one in so many is used.", above=0)] = 2
    n_seeds: Annotated[int, N_SEEDS] = 3
    rays: Annotated[int, Doc("Drawn from each held-out frame.", above=0)] = 1000

    def __post_init__(self) -> None:
        check_fields(self)

    @property
    def camera(self) -> StereoCamera:
        """The virtual rig."""
        return StereoCamera(FOCAL_PX, *CENTRE_PX, self.baseline_m, *SIZE_PX)


@dataclass(frozen=True)
class DepthFrame:
    """A measured depth_m (H, W) [m], NaN where unknown, and T_world_cam (4, 4)."""

    depth_m: FloatArray
    T_world_cam: FloatArray


def read_depths(folder: Path) -> Iterator[DepthFrame]:
    """The frames of a folder of frame-*.depth.png [mm] and their poses, by name. RecordingError when one is wrong."""
    for path in sorted(folder.glob(PATTERN)):
        pose_path = path.with_name(path.name.replace(".depth.png", ".pose.txt"))
        yield DepthFrame(read_depth_m(path, SIZE_PX[::-1], PER_M), read_pose_file(pose_path))


def compare_in_room(folder: Path, config: RoomConfig, stage: Stage) -> Compared:
    """The arms on the depths in folder/frames, scored by those in folder/heldout_depth; the units are noise seeds."""
    stop = Event()
    frames, held_out = (list(read_depths(folder / name))[:: config.every] for name in ("frames", "heldout_depth"))
    if not (frames and held_out):
        raise RecordingError(f"{folder}: expected frames/ and heldout_depth/ with *.depth.png and *.pose.txt")
    rays = HeldOutRays.joined(_rays(each, config, np.random.default_rng(k)) for k, each in enumerate(held_out))
    seeds = range(1, config.n_seeds + 1)
    with stage("mapping the room", len(seeds) * len(OF_INDEPENDENT) * len(frames)) as step:
        track = until(stop, counted(step))
        jobs = {
            (arm, seed): partial(_scored, frames, rays, config, arm=arm, seed=seed, track=track)
            for seed in seeds
            for arm in OF_INDEPENDENT
        }
        found = in_parallel(jobs, stop=stop)
    scores = {arm: {seed: found[arm, seed] for seed in seeds} for arm in OF_INDEPENDENT}
    return Compared("Room, independent noise", scores, FIRST, tuple(HELD_OUT_NAMES), "seeds of the noise")


def _rays(frame: DepthFrame, config: RoomConfig, rng: np.random.Generator) -> HeldOutRays:
    measured = measured_disparity(config.camera, frame.depth_m)
    reach_m = config.max_range_m
    return HeldOutRays.of_disparity(
        config.camera, measured, frame.T_world_cam, n=config.rays, max_range_m=reach_m, rng=rng
    )


def _scored(
    frames: Sequence[DepthFrame], rays: HeldOutRays, config: RoomConfig, *, arm: str, seed: int, track: Track
) -> list[Score]:
    readings = (
        noisy(config, each, np.random.default_rng([seed, n]))
        for n, each in enumerate(track(frames, "mapping", len(frames)))
    )
    grid, model = GridConfig(cell_m=config.cell_m), SensorModel(max_range_m=config.max_range_m)
    made = fused(config.camera, readings, OF_INDEPENDENT[arm], grid=grid, model=model)
    reach = {"min_range_m": NEAREST_M, "max_range_m": config.max_range_m}
    return held_out_scores(made, rays, cell_m=config.cell_m, **reach)


def noisy(config: RoomConfig, frame: DepthFrame, rng: np.random.Generator) -> Reading:
    """What the virtual rig would read: noise of config.sigma_px that is independent, and said to be so."""
    disparity_px = with_noise(config.camera.disparity_px(frame.depth_m), config.sigma_px, rng)
    return Reading(Disparity(disparity_px, config.sigma_px, correlation_px=1.0), frame.T_world_cam)
