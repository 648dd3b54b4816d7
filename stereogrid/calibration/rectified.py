"""A rig whose pictures come rectified, as a simulated robot's do."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol

from ..camera import StereoCamera
from ..errors import InvalidInputError
from ..geometry import FloatArray, as_floats, as_pose, from_rotation
from ..observation import Image
from ..tomlfile import config_from_table
from .rig import StereoCalibration


class Rig(Protocol):
    """Two cameras whose pictures can be mapped: a CalibrationFile, or a RectifiedRig."""

    @property
    def camera(self) -> StereoCamera:
        """The rectified pair."""

    @property
    def T_base_cam(self) -> FloatArray | None:
        """(4, 4) of the rectified left camera, where it is known."""

    def rectify(self, left: Image, right: Image) -> tuple[Image, Image]:
        """The rectified pair of what the cameras send, each (H, W) uint8."""


@dataclass(frozen=True)
class _CameraJson:
    """What a server of rectified pictures says of them (camera.json)."""

    focal_px: float
    cx_px: float
    cy_px: float
    baseline_m: float
    width_px: int
    height_px: int
    T_base_cam: tuple[tuple[float, ...], ...]


@dataclass(frozen=True, eq=False)
class RectifiedRig:
    """camera: the pair as it comes; T_base_cam (4, 4) of the left one.

    Raises InvalidInputError for numbers that no two cameras side by side have.
    """

    camera: StereoCamera
    T_base_cam: FloatArray | None = None

    def __post_init__(self) -> None:
        if self.T_base_cam is not None:
            object.__setattr__(self, "T_base_cam", as_pose(self.T_base_cam, "T_base_cam"))
        camera, straight = self.camera, as_floats([0.0] * 5)
        # Such a rig is a raw one too: its numbers must be as possible.
        T_right_left = from_rotation([[1, 0, 0], [0, 1, 0], [0, 0, 1]], [-camera.baseline_m, 0, 0])
        StereoCalibration((camera.K,) * 2, (straight,) * 2, T_right_left, (camera.width_px, camera.height_px))

    @classmethod
    def from_table(cls, table: Mapping[str, Any]) -> "RectifiedRig":
        """From the seven numbers of a camera.json; a wrong one is named.

        Raises ConfigError or InvalidInputError.
        """
        said = config_from_table(_CameraJson, table)
        camera = StereoCamera(said.focal_px, said.cx_px, said.cy_px, said.baseline_m, said.width_px, said.height_px)
        return cls(camera, as_pose(_square(said.T_base_cam), "T_base_cam"))

    def rectify(self, left: Image, right: Image) -> tuple[Image, Image]:
        """The pair itself, once its size is seen to be right."""
        for side, image in (("left", left), ("right", right)):
            if image.shape != self.camera.shape:
                raise InvalidInputError(f"the {side} image is {image.shape}, the camera {self.camera.shape}")
        return left, right


def _square(rows: tuple[tuple[float, ...], ...]) -> FloatArray:
    if len({len(row) for row in rows}) != 1:
        raise InvalidInputError(f"T_base_cam must be 4 rows of 4 numbers, not {[list(row) for row in rows]}")
    return as_floats(rows)
