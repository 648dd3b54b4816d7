"""Between two ticks the robot is on the shortest way from one pose to the next."""

import numpy as np
import pytest

from stereogrid.errors import InvalidInputError
from stereogrid.geometry import FloatArray, from_yaw, yaw_rad
from stereogrid.recording import Ticks


def turning() -> Ticks:
    """One second a tick, a tenth of a turn a second across the seam at pi, one metre a second along y."""
    poses = [from_yaw(3.0 + 0.1 * k, [0.0, float(k), 0.0]) for k in range(5)]
    return Ticks(np.arange(5.0), np.array(poses), np.outer(np.arange(5.0), [1.0, 2.0]))


@pytest.mark.parametrize("time_s", [0.0, 1.0, 1.25, 2.5, 4.0])
def test_the_pose_between_two_ticks_is_turned_and_moved_by_its_share(time_s: float) -> None:
    T = turning().T_world_base_at(time_s)
    expected = from_yaw(3.0 + 0.1 * time_s, [0.0, time_s, 0.0])
    np.testing.assert_allclose(T, expected, atol=1e-12)


@pytest.mark.parametrize(("time_s", "nearest"), [(-1.0, 0), (9.0, 4)])
def test_before_and_after_the_drive_the_robot_stands(time_s: float, nearest: int) -> None:
    ticks = turning()
    np.testing.assert_array_equal(ticks.T_world_base_at(time_s), ticks.T_world_base[nearest])


def test_a_pose_that_was_asked_for_may_be_changed() -> None:
    ticks = turning()
    ticks.T_world_base_at(-1.0)[:] = 0
    assert yaw_rad(ticks.T_world_base[0]) == pytest.approx(3.0)


@pytest.mark.parametrize(
    ("stamp_s", "poses", "wheels"),
    [
        (np.zeros(0), np.zeros((0, 4, 4)), np.zeros((0, 2))),
        (np.arange(2.0), np.zeros((3, 4, 4)), np.zeros((2, 2))),
        (np.arange(2.0), np.zeros((2, 4, 4)), np.zeros((2, 4))),
        (np.zeros(2), np.zeros((2, 4, 4)), np.zeros((2, 2))),
    ],
)
def test_ticks_that_do_not_fit_together_are_refused(stamp_s: FloatArray, poses: FloatArray, wheels: FloatArray) -> None:
    with pytest.raises(InvalidInputError, match="ticks"):
        Ticks(stamp_s, poses, wheels)
