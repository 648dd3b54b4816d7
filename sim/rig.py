"""The stereo rig on the robot: where the cameras sit and what they see."""

from dataclasses import dataclass, field

from scipy.spatial.transform import Rotation

from stereogrid.camera import StereoCamera
from stereogrid.geometry import R_BASE_OPTICAL, FloatArray, as_pose, from_rotation, transform
from stereogrid.observation import Image

from .render import Renderer, View

MINORU = StereoCamera(focal_px=834.0, cx_px=319.5, cy_px=239.5, baseline_m=0.06, width_px=640, height_px=480)
"""The Minoru webcam: 60 mm apart, 42 degrees wide at 640 x 480."""


def mount(x_m: float = 0.10, height_m: float = 0.40, pitch_rad: float = 0.0, baseline_m: float = 0.06) -> FloatArray:
    """T_base_cam (4, 4) of a rig on the centre line of the P3-AT.

    height_m of the lenses above the ground: the top plate is at 0.274 m, and a stand of 0.126 m keeps the plate
    out of the picture (its edge, 0.15 m ahead, is then 40 degrees below the axis). pitch_rad > 0 looks down;
    level by default, so that the horizon is in the middle and the map's slice at camera height is seen best.
    """
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

    def look(self, renderer: Renderer, T_world_base: FloatArray) -> tuple[View, Image]:
        """The left view with its true depth, and the right image (H, W) uint8, from a robot at T_world_base."""
        T_world_cam = T_world_base @ self.T_base_cam
        left = renderer.view(self.camera, T_world_cam)
        return left, renderer.view(self.camera, self.right_of(T_world_cam)).gray
