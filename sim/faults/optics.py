"""The lens, from the scene to the raw picture, and rectification, from the raw picture back."""

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from stereogrid.camera import StereoCamera
from stereogrid.errors import InvalidInputError
from stereogrid.geometry import FloatArray, as_floats
from stereogrid.observation import FloatImage, Image

from .kinds import CameraFaults
from .streams import LEFT, stream

Maps = tuple[FloatImage, FloatImage]


def unknown_rotation(faults: CameraFaults, seed: int) -> FloatArray:
    """R_calibrated_true (3, 3) of the right camera: what its calibration does not know, about an axis by seed."""
    axis = stream(seed, "calibration").standard_normal(3)
    turn = np.deg2rad(faults.calibration_error_deg) * axis / np.linalg.norm(axis)
    R: FloatArray = Rotation.from_rotvec(turn).as_matrix()
    return R


@dataclass(frozen=True)
class Lens:
    """One camera's lens. scene: the pinhole camera whose pictures come in; raw: the sensor and its intrinsics.

    k1: radial distortion; R_scene_raw (3, 3): how the real camera is turned in the scene camera's frame.
    """

    scene: StereoCamera
    raw: StereoCamera
    k1: float
    R_scene_raw: FloatArray

    def __post_init__(self) -> None:
        folds = 2 / 3 / np.sqrt(3 * -self.k1) if self.k1 < 0 else np.inf
        if not _radius(self.raw).max() < folds:
            raise InvalidInputError(f"distortion_k1 = {self.k1} folds the picture of a camera this wide")

    @classmethod
    def of_rectified(cls, rectified: StereoCamera, faults: CameraFaults, seed: int, side: int) -> "Lens":
        """The lens of a side of the rig whose rectified pictures are given: its sensor sees all of them."""
        corner = _radius(rectified).max()
        # A pincushion lens spreads its picture: so much wider the sensor has to see.
        wider = max(1.0, 1.0 + faults.distortion_k1 * corner**2)
        raw = StereoCamera(
            rectified.focal_px / wider,
            rectified.cx_px,
            rectified.cy_px,
            rectified.baseline_m,
            rectified.width_px,
            rectified.height_px,
        )
        return cls(rectified, raw, faults.distortion_k1, _turn(faults, seed, side))

    @classmethod
    def of_sensor(cls, raw: StereoCamera, faults: CameraFaults, seed: int, side: int) -> "Lens":
        """The lens of a side of a rig with these sensors; its scene is wide enough for all that they see."""
        corner = _radius(raw).max()
        beyond_px = raw.focal_px * corner * (_undistorted(np.array([corner]), faults.distortion_k1)[0] - 1)
        margin = int(np.ceil(max(beyond_px, 0.0) + raw.focal_px * np.deg2rad(faults.calibration_error_deg))) + 4
        scene = StereoCamera(
            raw.focal_px,
            raw.cx_px + margin,
            raw.cy_px + margin,
            raw.baseline_m,
            raw.width_px + 2 * margin,
            raw.height_px + 2 * margin,
        )
        return cls(scene, raw, faults.distortion_k1, _turn(faults, seed, side))

    @property
    def is_straight(self) -> bool:
        """Whether the raw picture is the scene's, pixel by pixel."""
        return self.k1 == 0 and self.scene == self.raw and np.array_equal(self.R_scene_raw, np.eye(3))

    def projected(self, light: FloatImage) -> FloatImage:
        """The light (H, W) on the sensor, given the scene camera's picture: distorted, and in focus."""
        if self.is_straight:
            return light
        # OpenCV's cubic kernel shifts a picture by up to .05 px; this one, and the lens itself, hardly blur.
        picture: FloatImage = cv2.remap(light, *self._scene_of_raw, cv2.INTER_LANCZOS4, borderMode=cv2.BORDER_REPLICATE)
        return np.maximum(picture, 0)

    def rectified(self, raw: Image) -> Image:
        """The raw picture (H, W) uint8 as one of the scene camera, by a calibration that knows all but R_scene_raw."""
        if self.k1 == 0 and self.scene == self.raw:
            return raw
        picture: Image = cv2.remap(raw, *self._raw_of_scene, cv2.INTER_LINEAR)
        return picture

    @cached_property
    def _scene_of_raw(self) -> Maps:
        """Where in the scene's picture each raw pixel looks."""
        x, y = _rays(self.raw)
        shrink = _undistorted(np.hypot(x, y), self.k1)
        # By einsum: unlike matmul it sums in one order on any number of threads, and this reaches pixels.
        rays = np.einsum("hwa,ba->hwb", np.stack([x * shrink, y * shrink, np.ones_like(x)], axis=-1), self.R_scene_raw)
        return _pixels(self.scene, rays[..., 0] / rays[..., 2], rays[..., 1] / rays[..., 2])

    @cached_property
    def _raw_of_scene(self) -> Maps:
        """Where in the raw picture the calibration looks for each pixel of the scene's."""
        x, y = _rays(self.scene)
        grow = 1 + self.k1 * (x**2 + y**2)
        return _pixels(self.raw, x * grow, y * grow)


def _turn(faults: CameraFaults, seed: int, side: int) -> FloatArray:
    return np.eye(3) if side == LEFT else unknown_rotation(faults, seed)


def vignette(camera: StereoCamera, loss: float) -> FloatImage:
    """Share (H, W) of the light that arrives: 1 in the middle, 1 - loss in the farthest corner."""
    square = _radius(camera) ** 2
    share: FloatImage = (1.0 - loss * square / square.max()).astype(np.float32)
    return share


def defocused(light: FloatImage, blur_px: float) -> FloatImage:
    """The picture (H, W) blurred with a deviation of blur_px."""
    if blur_px == 0:
        return light
    blurred: FloatImage = cv2.GaussianBlur(light, (0, 0), blur_px)
    return blurred


def _rays(camera: StereoCamera) -> tuple[FloatArray, FloatArray]:
    rays = camera.ray_directions
    return rays[..., 0], rays[..., 1]


def _radius(camera: StereoCamera) -> FloatArray:
    return np.hypot(*_rays(camera))


def _pixels(camera: StereoCamera, x: FloatArray, y: FloatArray) -> Maps:
    column, row = (camera.focal_px * x + camera.cx_px).astype(np.float32), (camera.focal_px * y + camera.cy_px)
    return column, row.astype(np.float32)


def _undistorted(distorted: FloatArray, k1: float) -> FloatArray:
    """true / distorted for radii with distorted = true (1 + k1 true^2), by Newton's method."""
    true = distorted.copy()
    for _ in range(12):
        true -= (true * (1 + k1 * true**2) - distorted) / (1 + 3 * k1 * true**2)
    return as_floats(np.divide(true, distorted, out=np.ones_like(true), where=distorted > 0))
