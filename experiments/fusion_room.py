"""Arms on a real room: measured depths as the disparities of a virtual rig, other frames' depths as the truth."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from threading import Event

import cv2
import numpy as np

from stereogrid.camera import StereoCamera
from stereogrid.config import GridConfig
from stereogrid.errors import InvalidInputError, RecordingError
from stereogrid.geometry import FloatArray, from_rotation
from stereogrid.mapping_run import Track
from stereogrid.observation import Disparity
from stereogrid.scoring import Score
from stereogrid.scoring.held_out import HELD_OUT_NAMES, HeldOutRays, held_out_scores
from stereogrid.sensor_model import SensorModel

from .compared import Compared
from .fusion_arms import FIRST, OF_INDEPENDENT, Reading, fused
from .parallel import Stage, counted, in_parallel, until

ROOM = Path("sequences") / "rgbd_7scenes"
FOCAL_PX, CENTRE_PX, SIZE_PX = 585.0, (320.0, 240.0), (640, 480)
"""Of the depth camera."""
KINECT_SIGMA_PX = 0.05
"""Of the measured depths, as disparities of a rig with a baseline of 6 cm: a Kinect errs by about 1.4 mm at 1 m and by
the square of the depth farther off (Khoshelham and Elberink, Sensors 12, 2012)."""
ROUNDING = 0.01
"""Of the numbers in the files of poses, at most."""
NEAREST_M = 0.5
"""A Kinect sees nothing nearer."""


@dataclass(frozen=True)
class RoomConfig:
    """The room: measured depths become disparities of a virtual rig with noise that is independent from pixel to pixel.

    every: of the frames, one in so many is used. n_seeds: of the noise. rays: drawn from each held-out frame.
    """

    baseline_m: float = 0.06
    sigma_px: float = 0.25
    cell_m: float = 0.05
    max_range_m: float = 4.0
    every: int = 2
    n_seeds: int = 3
    rays: int = 1000

    def __post_init__(self) -> None:
        for name in ("baseline_m", "sigma_px", "every", "n_seeds", "rays"):
            if not getattr(self, name) > 0:
                raise InvalidInputError(f"{name} must be positive, not {getattr(self, name)}")

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
    """The frames of a folder of *.depth.png [mm] with their *.pose.txt, by name. RecordingError when one is wrong."""
    for path in sorted(folder.glob("*.depth.png")):
        image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
        pose_path = path.with_name(path.name.replace(".depth.png", ".pose.txt"))
        try:
            T_world_cam = np.loadtxt(pose_path).reshape(4, 4)
        except (OSError, ValueError) as error:
            raise RecordingError(f"{pose_path}: missing, or not the 16 numbers of a pose") from error
        if image is None or image.dtype != np.uint16 or image.ndim != 2:
            raise RecordingError(f"{path}: not a depth image of 16 bits")
        yield DepthFrame(np.where(image > 0, image / 1000, np.nan), nearly_rigid(T_world_cam, pose_path))


def nearly_rigid(T: FloatArray, path: Path) -> FloatArray:
    """The pose (4, 4) with the rotation nearest to its own, as rounded files need it; RecordingError if that is far."""
    u, _, vt = np.linalg.svd(T[:3, :3]) if np.isfinite(T).all() else (np.zeros((3, 3)), None, np.zeros((3, 3)))
    rotation = u @ vt
    if np.abs(rotation - T[:3, :3]).max(initial=0) > ROUNDING or not np.linalg.det(rotation) > 0:
        raise RecordingError(f"{path}: no rotation and position")
    return from_rotation(rotation, T[:3, 3])


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
    measured = Disparity(config.camera.disparity_px(frame.depth_m), KINECT_SIGMA_PX)
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
    noise_px = rng.normal(0, config.sigma_px, frame.depth_m.shape)
    disparity_px = config.camera.disparity_px(frame.depth_m) + noise_px
    disparity_px[~(disparity_px > 0)] = np.nan
    return Reading(Disparity(disparity_px, config.sigma_px, correlation_px=1.0), frame.T_world_cam)
