"""What the correlation of errors is measured on: pairs with truth, a rig that stands still, and short drives."""

import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from sim.faults import PRESETS, FaultyCameras
from sim.record import record_drive
from stereogrid.camera import Rectification, StereoCamera
from stereogrid.errors import RecordingError
from stereogrid.geometry import FloatArray, inverse
from stereogrid.matching import matcher
from stereogrid.observation import FloatImage, Image, Observation

from .sigma_scenes import Scene, corridor_scenes, real_scenes

COARSEST_STEP_PX = 0.35
"""Scenes whose truth is rounded more coarsely are left out: rounding adds errors that reach less far than the
matcher's. Motorcycle's L falls by 4 to 7 % with its truth rounded to .25 px, and by up to a half at .5 px."""
CORRIDOR_SEED = 0
STATIC = Path("sequences") / "euroc_static"
STATIC_DISPARITIES = 64
DRIVE_SEEDS = (0, 5)
DRIVE_NOISE = "mild"
DRIVES = {0.02: 0.3, 0.25: 3.5}
"""Distance between two pairs: length of the drive [m]. Pairs several steps apart give the distances in between."""
EVERY_AGAIN = 5
"""Of so many views one is taken a second time, with other noise."""
SLOW, SLOW_WINDOW = ("kz2",), (240, 400)
"""Matchers that see only a window (H, W) in the middle of each image, and less of what moves: minutes, not an hour."""


@dataclass(frozen=True)
class View:
    """A noisy pair (H, W) of a drive, its true depth_m (H, W), NaN = unknown, and its true pose (4, 4)."""

    left: Image
    right: Image
    depth_m: FloatArray
    T_world_cam: FloatArray


@dataclass(frozen=True)
class ShortDrive:
    """Views of one drive in their order; again: by place in views, the same view with other noise."""

    camera: StereoCamera
    views: Sequence[View]
    again: Mapping[int, View]


def scenes(data: Path) -> Iterator[Scene]:
    """Pairs with fine truth: the real ones under data/stereo, and a corridor's with CORRIDOR_FAULTS."""
    yield from (scene for scene in real_scenes(data) if scene.step_px <= COARSEST_STEP_PX)
    yield from corridor_scenes(CORRIDOR_SEED)


def matched(name: str, left: Image, right: Image, num_disparities: int) -> tuple[FloatImage, FloatImage]:
    """Disparity and sigma (H, W) [px] by the matcher of this name; NaN outside of the window of a SLOW one."""
    part = _middle(left.shape) if name in SLOW else (slice(None), slice(None))
    chosen = matcher(name, num_disparities=-(-num_disparities // 16) * 16)
    found = chosen.match(np.ascontiguousarray(left[part]), np.ascontiguousarray(right[part]))
    disparity_px, sigma_px = (np.full(left.shape, np.nan, np.float32) for _ in range(2))
    disparity_px[part], sigma_px[part] = found.disparity_px, found.sigma_px
    return disparity_px, sigma_px


def _middle(shape: tuple[int, ...]) -> tuple[slice, slice]:
    first = [max(have - want, 0) // 2 for have, want in zip(shape, SLOW_WINDOW, strict=True)]
    rows, columns = (slice(start, start + want) for start, want in zip(first, SLOW_WINDOW, strict=True))
    return rows, columns


def scene_errors(name: str, scene: Scene) -> FloatArray:
    """(found - true) / sigma (H, W) of the matched pixels that both images show, NaN elsewhere."""
    disparity_px, sigma_px = matched(name, scene.left, scene.right, scene.num_disparities)
    return np.where(scene.visible, (disparity_px - scene.truth_px) / sigma_px, np.nan)


def static_pairs(data: Path) -> list[tuple[Image, Image]]:
    """Rectified pairs (H, W) uint8 of a rig that stands on the floor. Raises RecordingError when they are missing."""
    folder = data / STATIC
    names = sorted(path.name for path in (folder / "cam0").glob("*.png"))
    if len(names) < 3:
        raise RecordingError(f"{folder}: expected cam0/ and cam1/ with at least three .png images each of a still rig")
    (K0, D0, T0, size_px), (K1, D1, T1, _) = (_calibration(folder / f"cam{side}_sensor.yaml") for side in (0, 1))
    rectification = Rectification.from_calibration((K0, K1), (D0, D1), inverse(T1) @ T0, size_px)
    return [rectification.rectify(*(_grey(folder / f"cam{side}" / name) for side in (0, 1))) for name in names]


def _grey(path: Path) -> Image:
    image = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
    if image is None:
        raise RecordingError(f"{path}: missing, or not a readable image")
    found: Image = image
    return found


def _calibration(path: Path) -> tuple[FloatArray, list[float], FloatArray, tuple[int, int]]:
    """K (3, 3), distortion, T_body_cam (4, 4) and (width, height) of an EuRoC sensor.yaml."""
    if not path.is_file():
        raise RecordingError(f"{path}: missing: the camera's intrinsics, distortion and T_BS")
    file = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
    node = {name: file.getNode(name) for name in ("intrinsics", "distortion_coefficients", "resolution")}
    node["T_BS"] = file.getNode("T_BS").getNode("data")
    held = {name: [each.at(n).real() for n in range(each.size())] for name, each in node.items()}
    try:
        fu, fv, cu, cv = held["intrinsics"]
        width, height = held["resolution"]
        T_body_cam = np.reshape(held["T_BS"], (4, 4))
    except ValueError as error:
        raise RecordingError(f"{path}: intrinsics, resolution or T_BS do not have 4, 2 and 16 numbers") from error
    K = np.array([[fu, 0, cu], [0, fv, cv], [0, 0, 1]])
    return K, held["distortion_coefficients"], T_body_cam, (int(width), int(height))


def short_drives() -> Iterator[ShortDrive]:
    """The first metres of the corridor with pairs at each spacing of DRIVES, for each of DRIVE_SEEDS."""
    for seed in DRIVE_SEEDS:
        for every_m, distance_m in DRIVES.items():
            yield _short_drive(seed, every_m, distance_m)


def _short_drive(seed: int, every_m: float, distance_m: float) -> ShortDrive:
    from stereogrid.recording import open_recording

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "drive.mcap"
        record_drive(path, world="corridor", seed=seed, every_m=every_m, max_distance_m=distance_m)
        drive = open_recording(path)
        faults = PRESETS[DRIVE_NOISE]
        # Each drive and each second look has noise of its own.
        base = 1000 * seed + round(100 * every_m)
        views, others = ([_view(each) for each in FaultyCameras(drive, faults, base + k)] for k in (0, 500))
    return ShortDrive(drive.camera, views, {n: others[n] for n in range(0, len(views), EVERY_AGAIN)})


def _view(observation: Observation) -> View:
    truth = observation.truth
    assert truth is not None
    assert truth.depth_m is not None
    depth_m = np.where(truth.depth_m > 0, truth.depth_m, np.nan).astype(float)
    depth_m[np.isinf(depth_m)] = np.nan
    return View(observation.left, observation.right, depth_m, truth.T_world_cam)
