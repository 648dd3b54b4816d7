"""Pairs with known disparity to fit and test sigma on: real ones, a simulated corridor's, and drawn planes."""

import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from sim.faults import CameraFaults, FaultyPair, camera_faults
from sim.record import record_drive
from stereogrid.camera import StereoCamera
from stereogrid.geometry import FloatArray
from stereogrid.observation import FloatImage, Image, Observation
from stereogrid.recording import open_recording

from .pairs import Mask, open_pair, seen_by_both

REAL: dict[str, tuple[int, ...]] = {
    "tsukuba": (1,),
    "venus": (1,),
    "teddy": (1,),
    "motorcycle": (1, 2),
    "aloe": (2, 3),
}
"""Folders of shared/data/stereo, and the times by which each is shrunk."""
CORRIDOR_SEEDS = (0, 5)
CORRIDOR_SHARES = (0.2, 0.5, 0.85)
"""How far down the drive the corridor is looked at: along it, before a wall, along it."""
CORRIDOR_DISPARITIES = 80
CORRIDOR_WEIGHT, PLANES_WEIGHT = 0.75, 0.25
"""Errors on drawn planes are smaller than cameras allow: they are there to keep the tables from running wild."""
PLANES_SHAPE = (300, 400)
_PLANES_CAMERA = StereoCamera(520.0, 199.5, 149.5, 0.06, PLANES_SHAPE[1], PLANES_SHAPE[0])
CORRIDOR_FAULTS = {name: camera_faults(name, calibration_error_deg=0.0).still for name in ("ideal", "mild", "minoru")}
"""Sigma is of what the matcher errs by: a calibration that is wrong shifts all of a picture's disparities alike."""
PLANES_FAULTS = {
    "clean": CameraFaults(),
    "faint": CameraFaults(defocus_px=0.3, exposure_mismatch=0.03, full_well_e=33000),
    "plain": CameraFaults(defocus_px=0.6, exposure_mismatch=0.08, full_well_e=7200),
    "strong": CameraFaults(defocus_px=0.8, exposure_mismatch=0.14, full_well_e=1800),
}
"""Shot noise of .7, 1.5 and 3 gray levels."""


@dataclass(frozen=True)
class Scene:
    """A grey pair (H, W) uint8, the left one's truth_px (H, W), NaN = unknown, and the pixels that both show.

    group: scenes that share anything, so that all of them are held out together; row: those reported together.
    weight: of the group in a fit, a real one's being 1.
    """

    group: str
    row: str
    left: Image
    right: Image
    truth_px: FloatArray
    visible: Mask
    num_disparities: int
    step_px: float = 0.0
    weight: float = 1.0

    @property
    def is_real(self) -> bool:
        """Whether cameras took it."""
        return self.group in REAL


def scenes(data: Path) -> Iterator[Scene]:
    """All of them; data: shared/data."""
    yield from real_scenes(data)
    for seed in CORRIDOR_SEEDS:
        yield from corridor_scenes(seed)
    yield from plane_scenes(seed=3)


def real_scenes(data: Path) -> Iterator[Scene]:
    """The pairs of REAL under data/stereo."""
    for name, sizes in REAL.items():
        whole = open_pair(data / "stereo" / name)
        for times in sizes:
            pair = whole if times == 1 else whole.shrunk(times)
            yield Scene(name, pair.name, *pair.grey, pair.truth_px, pair.visible, pair.num_disparities, pair.step_px)


def corridor_scenes(seed: int) -> Iterator[Scene]:
    """Views of the corridor painted by seed, each with each of CORRIDOR_FAULTS."""
    with tempfile.TemporaryDirectory() as folder:
        drive = open_recording(record_drive(Path(folder) / "drive.mcap", world="corridor", seed=seed, every_m=2.0))
        observations = list(drive)
    for share in CORRIDOR_SHARES:
        n = int(share * len(observations))
        depth_m = _depth_m(observations[n])
        truth_px = drive.camera.disparity_px(np.where(depth_m > 0, depth_m, np.nan)).astype(float)
        truth_px[truth_px == 0] = np.nan
        pair = observations[n].left, observations[n].right
        for preset, faults in CORRIDOR_FAULTS.items():
            left, right = FaultyPair(drive.camera, faults, seed).taken(pair, n)
            group = f"corridor {seed}"
            visible = seen_by_both(truth_px)[0]
            count, weight = CORRIDOR_DISPARITIES, CORRIDOR_WEIGHT
            yield Scene(group, f"{group}, {preset}", left, right, truth_px, visible, count, weight=weight)


def _depth_m(observation: Observation) -> FloatImage:
    assert observation.truth is not None
    assert observation.truth.depth_m is not None
    return observation.truth.depth_m


def plane_scenes(seed: int) -> Iterator[Scene]:
    """Slanted, textured planes before one another, each set seen with each of PLANES_FAULTS."""
    for n in range(2):
        rng = np.random.default_rng([seed, n])
        pair, truth_px = draw_planes(rng)
        count = (int(np.ceil(truth_px.max())) + 16) // 16 * 16
        for name, faults in PLANES_FAULTS.items():
            left, right = FaultyPair(_PLANES_CAMERA, faults, seed).taken(pair, n)
            visible = seen_by_both(truth_px)[0]
            yield Scene("planes", f"planes, {name}", left, right, truth_px, visible, count, weight=PLANES_WEIGHT)


def draw_planes(rng: np.random.Generator, n: int = 9) -> tuple[tuple[Image, Image], FloatArray]:
    """A pair (H, W) uint8 of a background and n ellipses cut from slanted planes, and the true disparity (H, W)."""
    height, width = PLANES_SHAPE
    row, column = np.mgrid[:height, :width].astype(np.float32)
    pictures = [np.zeros(PLANES_SHAPE, np.float32) for _ in range(2)]
    truth_px = np.zeros(PLANES_SHAPE)
    for k, base_px in enumerate(np.linspace(6, 45, n + 1)):
        texture, slant = _texture(rng), rng.uniform(-0.06, 0.06, 2) * (1 if k else 0.2)
        centre, radius = rng.uniform(0.1, 0.9, 2) * (height, width), rng.uniform(25, 70, 2) if k else (1e4, 1e4)
        plane_px = base_px + slant[0] * (row - centre[0])
        # x_right = x - d(x, y), solved for the column x of the left image that is seen there.
        seen_from_right = (column + plane_px - slant[1] * centre[1]) / (1 - slant[1])
        for side, source in enumerate((column, seen_from_right.astype(np.float32))):
            inside = ((row - centre[0]) / radius[0]) ** 2 + ((source - centre[1]) / radius[1]) ** 2 < 1
            # The texture is as wide as the drawing's reach, so that none of it is drawn from beyond its edges.
            grey = cv2.remap(texture, source + 100, row, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT)
            pictures[side][inside] = grey[inside]
            if side == 0:
                truth_px[inside] = (plane_px + slant[1] * (column - centre[1]))[inside]
    left, right = (np.clip(np.rint(picture), 0, 255).astype(np.uint8) for picture in pictures)
    return (left, right), truth_px


def _texture(rng: np.random.Generator) -> FloatImage:
    """Grey noise (H, W + 300) of two scales and a contrast drawn for it, smooth enough to be seen between pixels."""
    shape = (PLANES_SHAPE[0], PLANES_SHAPE[1] + 300)
    total = np.full(shape, rng.uniform(70, 180), np.float32)
    for scale_px in (rng.uniform(0.9, 1.6), rng.uniform(2, 6)):
        layer = cv2.GaussianBlur(rng.normal(size=shape).astype(np.float32), (0, 0), scale_px)
        total += layer / layer.std() * np.float32(np.exp(rng.uniform(np.log(2), np.log(25))))
    return total
