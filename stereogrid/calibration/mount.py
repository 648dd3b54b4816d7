"""Where the cameras sit on the robot, as a person measures it."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from ..errors import InvalidInputError
from ..geometry import R_BASE_OPTICAL, FloatArray, as_pose, from_rotation

MOST_AWAY_M = 3.0
"""No robot of ours carries a camera further from the point on the ground between its wheels."""


@dataclass(frozen=True)
class Mount:
    """The left lens in `base`: x_m ahead of the middle between the wheels, y_m to its left, z_m above the ground.

    pitch_deg > 0 looks down, yaw_deg > 0 to the left, roll_deg > 0 leans to the right; turned by yaw, then pitch, then
    roll. The axes are those of the rectified pictures: x along the line from lens to lens, as a person sees it. A lens
    alone may squint by a degree. Raises InvalidInputError for a lens in the ground, or out of a robot's reach.
    """

    x_m: float
    y_m: float
    z_m: float
    pitch_deg: float = 0.0
    yaw_deg: float = 0.0
    roll_deg: float = 0.0

    def __post_init__(self) -> None:
        for name in ("x_m", "y_m"):
            if not abs(getattr(self, name)) <= MOST_AWAY_M:
                raise InvalidInputError(
                    f"{name} must be -{MOST_AWAY_M:g} to {MOST_AWAY_M:g}, not {getattr(self, name)}"
                )
        if not 0 < self.z_m <= MOST_AWAY_M:
            raise InvalidInputError(f"z_m, the lens above the ground, must be 0 to {MOST_AWAY_M:g}, not {self.z_m}")
        for name, most in (("pitch_deg", 90), ("yaw_deg", 180), ("roll_deg", 180)):
            if not abs(getattr(self, name)) <= most:
                raise InvalidInputError(f"{name} must be -{most} to {most}, not {getattr(self, name)}")

    @classmethod
    def of(cls, T_base_cam: FloatArray) -> "Mount":
        """The mount of a left camera at T_base_cam (4, 4)."""
        T = as_pose(T_base_cam, "T_base_cam")
        turns_deg = Rotation.from_matrix(T[:3, :3] @ R_BASE_OPTICAL.T).as_euler("ZYX", degrees=True)
        # Rounded to far below what can be measured, so that a person reads 5.0 and not 5.000000000000001.
        x, y, z, yaw, pitch, roll = (float(value) for value in np.round([*T[:3, 3], *turns_deg], 9))
        return cls(x, y, z, pitch, yaw, roll)

    @classmethod
    def parse(cls, text: str) -> "Mount":
        """From "x,y,z" or "x,y,z,pitch,yaw,roll" (or fewer), as the commands' --mount has it."""
        try:
            numbers = [float(part) for part in text.split(",")]
            if not 3 <= len(numbers) <= 6:
                raise ValueError
        except ValueError:
            raise InvalidInputError(
                f"--mount must be x,y,z or x,y,z,pitch,yaw,roll [m, degrees], not {text!r}"
            ) from None
        return cls(*numbers)

    @property
    def T_base_cam(self) -> FloatArray:
        """(4, 4): from the left rectified optical frame to `base`."""
        turn = Rotation.from_euler("ZYX", [self.yaw_deg, self.pitch_deg, self.roll_deg], degrees=True).as_matrix()
        return from_rotation(turn @ R_BASE_OPTICAL, [self.x_m, self.y_m, self.z_m])
