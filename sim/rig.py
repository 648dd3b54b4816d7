"""The stereo rig on the robot: where the cameras sit and what they see."""

from dataclasses import dataclass, field
from math import pi
from typing import Any

from scipy.spatial.transform import Rotation

from stereogrid.camera import StereoCamera
from stereogrid.errors import InvalidInputError
from stereogrid.geometry import R_BASE_OPTICAL, FloatArray, as_pose, from_rotation, transform
from stereogrid.observation import Image

from .rendering.render import View
from .rendering.renderers import Photographer

MINORU = StereoCamera(focal_px=834.0, cx_px=319.5, cy_px=239.5, baseline_m=0.06, width_px=640, height_px=480)
"""The Minoru webcam: 60 mm apart, 42 degrees wide at 640 x 480."""


MOST_PX = 4096
HIGHEST_M = 3.0


def webcam(
    width_px: int, height_px: int, *, focal_px: float | None = None, baseline_m: float = MINORU.baseline_m
) -> StereoCamera:
    """A pair of such a size with the optical axes in the middle; by default 42 degrees wide.

    Raises InvalidInputError for a size that no webcam has, or a number out of range.
    """
    for name, size_px in (("width", width_px), ("height", height_px)):
        if not 16 <= size_px <= MOST_PX:
            raise InvalidInputError(f"the images' {name} must be 16 to {MOST_PX} px, not {size_px}")
    return StereoCamera(
        focal_px=MINORU.focal_px * width_px / MINORU.width_px if focal_px is None else focal_px,
        cx_px=(width_px - 1) / 2,
        cy_px=(height_px - 1) / 2,
        baseline_m=baseline_m,
        width_px=width_px,
        height_px=height_px,
    )


def mount(x_m: float = 0.10, height_m: float = 0.40, pitch_rad: float = 0.0, baseline_m: float = 0.06) -> FloatArray:
    """T_base_cam (4, 4) of a rig on the centre line of the P3-AT.

    height_m of the lenses above the ground: the top plate is at 0.274 m, and a stand of 0.126 m keeps the plate
    out of the picture (its edge, 0.15 m ahead, is then 40 degrees below the axis). pitch_rad > 0 looks down;
    level by default, so that the horizon is in the middle and the map's slice at camera height is seen best.
    Raises InvalidInputError for lenses in the ground or higher than a robot carries them.
    """
    if not 0 < height_m <= HIGHEST_M:
        raise InvalidInputError(f"the lenses' height must be over 0 and at most {HIGHEST_M:g} m, not {height_m}")
    if not abs(pitch_rad) <= pi / 2:
        raise InvalidInputError(f"the cameras' pitch must be within a right angle, not {pitch_rad} rad")
    nod = Rotation.from_euler("y", pitch_rad).as_matrix()
    return from_rotation(nod @ R_BASE_OPTICAL, [x_m, baseline_m / 2, height_m])


@dataclass(frozen=True)
class StereoRig:
    """Two identical, rectified pinhole cameras at T_base_cam (4, 4), the left one's pose."""

    camera: StereoCamera = MINORU
    T_base_cam: FloatArray = field(default_factory=mount)

    def __post_init__(self) -> None:
        object.__setattr__(self, "T_base_cam", as_pose(self.T_base_cam, "T_base_cam"))

    def right_of(self, T_world_cam: FloatArray) -> FloatArray:
        """The right camera's pose (4, 4), given the left one's."""
        return from_rotation(T_world_cam[:3, :3], transform(T_world_cam, [self.camera.baseline_m, 0.0, 0.0]))

    def look(self, renderer: Photographer, T_world_base: FloatArray, *, time_s: float = 0.0) -> tuple[View, Image]:
        """The left view with its true depth, and the right image (H, W) uint8, from a robot at T_world_base.

        time_s: since the start, which says where the world's movers are.
        """
        T_world_cam = T_world_base @ self.T_base_cam
        left = renderer.view(self.camera, T_world_cam, time_s=time_s)
        return left, renderer.view(self.camera, self.right_of(T_world_cam), time_s=time_s).gray


def calibration(rig: StereoRig) -> dict[str, Any]:
    """What a client must know of a rig to use its pictures: they are rectified."""
    camera = rig.camera
    return {
        "focal_px": camera.focal_px,
        "cx_px": camera.cx_px,
        "cy_px": camera.cy_px,
        "baseline_m": camera.baseline_m,
        "width_px": camera.width_px,
        "height_px": camera.height_px,
        "T_base_cam": rig.T_base_cam.tolist(),
    }
