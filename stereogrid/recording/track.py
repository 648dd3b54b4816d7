"""What the odometry poses of a recording say together."""

from collections.abc import Sequence

import numpy as np

from ..geometry import FloatArray, inverse, rotation_angle_rad
from ..observation import Odometry


def odometry_track(T_odom_base: Sequence[FloatArray] | FloatArray) -> tuple[Odometry, ...]:
    """One Odometry a pose (4, 4): travelled_m and turned_rad are summed from the first pose on.

    Raises InvalidInputError when a pose is not rigid.
    """
    track: list[Odometry] = []
    for T in T_odom_base:
        if not track:
            track.append(Odometry(T))
            continue
        last = track[-1]
        step = inverse(last.T_odom_base) @ T
        travelled_m = last.travelled_m + float(np.linalg.norm(step[:3, 3]))
        track.append(Odometry(T, travelled_m, last.turned_rad + rotation_angle_rad(step)))
    return tuple(track)
