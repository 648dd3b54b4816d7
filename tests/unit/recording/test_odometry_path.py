"""Between two reports the robot was on the shortest way; where nothing was told, nothing is claimed."""

import numpy as np
import pytest

from stereogrid.geometry import from_yaw, yaw_rad
from stereogrid.recording.odometry_path import UNKNOWN, OdometryPath

S = 10**9
T0 = 1_700_000_000 * S


def circle(n: int = 50, *, frames: list[str] | None = None) -> OdometryPath:
    """A tenth of a second a report, 1 m/s on a circle of 2 m, through the seam at pi."""
    turn = 0.05 * np.arange(n)
    poses = np.array([from_yaw(3.0 + a, [2 * np.sin(a), 2 - 2 * np.cos(a), 0]) for a in turn])
    return OdometryPath.of(T0 + np.arange(n) * S // 10, poses, frames or ["odom"] * n)


def moments(*seconds: float) -> np.ndarray:
    return T0 + np.round(np.array(seconds) * S).astype(np.int64)


def test_at_a_report_the_odometry_is_the_reports() -> None:
    path = circle()
    for each, T, way in zip(path.at(path.stamps_ns), path.T_odom_base, path.travelled_m, strict=True):
        np.testing.assert_allclose(each.T_odom_base, T, atol=1e-12)
        assert each.travelled_m == way


def test_between_reports_it_is_close_to_the_true_arc() -> None:
    """The chord's distance from the arc is the most that it can be off: s^2 / (8 r) = .6 mm."""
    seconds = np.linspace(0, 4.8, 777)
    for at_s, each in zip(seconds, circle().at(moments(*seconds)), strict=True):
        a = 0.5 * at_s
        true = from_yaw(3.0 + a, [2 * np.sin(a), 2 - 2 * np.cos(a), 0])
        assert np.linalg.norm(each.T_odom_base[:3, 3] - true[:3, 3]) < 0.00064
        assert abs(yaw_rad(np.linalg.inv(true) @ each.T_odom_base)) < 1e-7
        assert each.turned_rad == pytest.approx(a, abs=1e-7)
        assert each.travelled_m == pytest.approx(at_s, rel=2e-4)


def test_the_way_is_that_along_all_reports_not_from_pair_to_pair() -> None:
    """Forwards and back between two pairs: half a metre and half a radian each way."""
    poses = np.array([from_yaw(a, [a, 0, 0]) for a in (0, 0.5, 0)])
    path = OdometryPath.of(moments(0, 1, 2), poses, ["odom"] * 3)
    first, last = path.at(moments(0, 2))
    np.testing.assert_allclose(first.T_odom_base, last.T_odom_base)
    assert last.travelled_m == pytest.approx(1.0) and last.turned_rad == pytest.approx(1.0)


def test_outside_of_all_reports_nothing_is_known() -> None:
    assert circle().pieces_at(moments(-0.001, 0, 0.05, 4.9, 4.901), 0.5).tolist() == [UNKNOWN, 0, 0, 0, UNKNOWN]


def test_between_reports_that_are_far_apart_nothing_is_known() -> None:
    path = OdometryPath.of(moments(0, 0.1, 0.7, 0.8), np.tile(np.eye(4), (4, 1, 1)), ["odom"] * 4)
    assert path.pieces_at(moments(0.05, 0.1, 0.3, 0.7, 0.75), 0.5).tolist() == [0, 0, UNKNOWN, 0, 0]
    assert path.pieces_at(moments(0.3), 0.7).tolist() == [0]


def test_where_the_frame_changes_a_new_piece_begins_that_has_gone_nowhere_yet() -> None:
    path = circle(6, frames=["odom", "odom", "odom", "odom_1", "odom_1", "odom_1"])
    assert path.pieces_at(moments(0.1, 0.2, 0.25, 0.3, 0.4), 0.5).tolist() == [0, 0, UNKNOWN, 1, 1]
    assert path.travelled_m[3] == path.turned_rad[3] == 0
    assert path.travelled_m[4] == pytest.approx(path.travelled_m[1])


def test_a_robot_that_stands_has_gone_nowhere() -> None:
    path = OdometryPath.of(moments(*range(100)), np.tile(from_yaw(0.7, [1, 2, 0]), (100, 1, 1)), ["odom"] * 100)
    assert path.travelled_m[-1] == 0 and path.turned_rad[-1] == 0


def test_a_single_report_is_known_at_its_own_moment() -> None:
    path = OdometryPath.of(moments(1), np.eye(4)[None], ["odom"])
    assert path.pieces_at(moments(0.9, 1, 1.1), 0.5).tolist() == [UNKNOWN, 0, UNKNOWN]
    assert len(path.at(moments(1))) == 1
