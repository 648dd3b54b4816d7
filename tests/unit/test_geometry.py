"""Poses are a group, they move points as a rigid body does, and a matrix that is no pose is refused by name."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stereogrid import as_printed
from stereogrid.errors import InvalidInputError, StereogridError, unknown_name
from stereogrid.geometry import (
    R_BASE_OPTICAL,
    as_pose,
    between,
    from_quaternion_wxyz,
    from_rotation,
    from_yaw,
    inverse,
    nearest_pose,
    quaternion_wxyz,
    rotation_angle_rad,
    transform,
    yaw_rad,
)

lengths = st.floats(-100, 100)
triples = st.tuples(lengths, lengths, lengths)
quaternions = (
    st.tuples(*[st.floats(-1, 1)] * 4).filter(lambda q: np.linalg.norm(q) > 0.1).map(lambda q: q / np.linalg.norm(q))
)
poses = st.builds(from_quaternion_wxyz, quaternions, triples)
clouds = st.lists(triples, min_size=1, max_size=5).map(np.array)


@given(poses, poses, clouds)
def test_moving_twice_is_moving_by_the_product(T_a_b, T_b_c, points_c):
    np.testing.assert_allclose(
        transform(T_a_b @ T_b_c, points_c), transform(T_a_b, transform(T_b_c, points_c)), atol=1e-9
    )


@given(poses, clouds)
def test_the_inverse_brings_points_back(T_a_b, points_b):
    np.testing.assert_allclose(transform(inverse(T_a_b), transform(T_a_b, points_b)), points_b, atol=1e-9)
    np.testing.assert_allclose(T_a_b @ inverse(T_a_b), np.eye(4), atol=1e-9)


@given(poses, triples, triples)
def test_a_pose_keeps_distances_and_handedness(T_a_b, p, q):
    moved = transform(T_a_b, [p, q])
    assert np.linalg.norm(moved[0] - moved[1]) == pytest.approx(np.linalg.norm(np.subtract(p, q)), abs=1e-9)
    assert np.linalg.det(T_a_b[:3, :3]) == pytest.approx(1)


@given(poses, clouds)
def test_a_cloud_of_any_shape_moves_point_by_point(T_a_b, points_b):
    stacked = np.stack([points_b, points_b + 1])
    one_by_one = [[transform(T_a_b, p) for p in row] for row in stacked]
    np.testing.assert_allclose(transform(T_a_b, stacked), one_by_one, atol=1e-9)


@given(quaternions, triples)
def test_quaternions_survive_the_way_through_a_matrix(q, t_m):
    back = quaternion_wxyz(from_quaternion_wxyz(q, t_m))
    # q and -q are one rotation; w >= 0 chooses.
    np.testing.assert_allclose(np.abs(back @ q), 1, atol=1e-9)
    assert back[0] >= 0


@given(poses, poses, st.floats(0, 1))
def test_between_two_poses_turn_and_way_are_shared_out(T_a_b, T_a_c, share):
    T = as_pose(between(T_a_b, T_a_c, share))
    way, turn = T_a_c[:3, 3] - T_a_b[:3, 3], rotation_angle_rad(inverse(T_a_b) @ T_a_c)
    np.testing.assert_allclose(T[:3, 3] - T_a_b[:3, 3], share * way, atol=1e-9)
    assert rotation_angle_rad(inverse(T_a_b) @ T) == pytest.approx(share * turn, abs=1e-6)
    assert rotation_angle_rad(inverse(T) @ T_a_c) == pytest.approx((1 - share) * turn, abs=1e-6)


def test_quaternions_are_written_w_first():
    quarter_turn_left = from_quaternion_wxyz([np.sqrt(0.5), 0, 0, np.sqrt(0.5)], [0, 0, 0])
    np.testing.assert_allclose(transform(quarter_turn_left, [1, 0, 0]), [0, 1, 0], atol=1e-12)
    np.testing.assert_allclose(quaternion_wxyz(np.eye(4)), [1, 0, 0, 0])


@given(st.floats(-np.pi, np.pi, exclude_min=True), triples)
def test_yaw_is_read_as_it_was_given(yaw, t_m):
    T = from_yaw(yaw, t_m)
    assert np.angle(np.exp(1j * (yaw_rad(T) - yaw))) == pytest.approx(0, abs=1e-12)
    assert rotation_angle_rad(T) == pytest.approx(abs(yaw), abs=1e-7)
    np.testing.assert_allclose(T[:3, 3], t_m)


def test_a_quarter_turn_to_the_left_looks_along_y():
    np.testing.assert_allclose(transform(from_yaw(np.pi / 2, [1, 2, 3]), [2, 0, 0]), [1, 4, 3], atol=1e-12)


def test_an_optical_frame_looks_forward_with_right_and_down_as_in_the_image():
    T_base_cam = from_rotation(R_BASE_OPTICAL)
    right, down, ahead = transform(T_base_cam, np.eye(3))
    np.testing.assert_array_equal(ahead, [1, 0, 0])
    np.testing.assert_array_equal(right, [0, -1, 0])
    np.testing.assert_array_equal(down, [0, 0, -1])
    as_pose(T_base_cam)


@given(st.floats(-3, 3).filter(lambda yaw: abs(np.sin(yaw)) > 0.1), triples, triples.filter(lambda p: abs(p[0]) > 1))
def test_eq7_as_printed_turns_the_wrong_way(yaw, t_m, p_cam):
    """P_w = R^T P_c + T, with R = R_world_cam, turns by -yaw; no test with R = 1 or T = 0 alone can see it."""
    T_world_cam = from_yaw(yaw, t_m)
    printed = as_printed.world_points(T_world_cam[:3, :3], t_m, [p_cam])
    np.testing.assert_allclose(printed, transform(from_yaw(-yaw, t_m), [p_cam]), atol=1e-9)
    assert np.linalg.norm(printed - transform(T_world_cam, [p_cam])) > 0.1
    still = np.eye(3)
    np.testing.assert_allclose(
        as_printed.world_points(still, t_m, [p_cam]), transform(from_rotation(still, t_m), [p_cam])
    )


def test_eq7_places_a_point_seen_by_a_turned_and_shifted_camera():
    """A camera at (1, 2, .5) that looks along world y sees, 3 m ahead and .4 m right of its axis, (1.4, 5, .5)."""
    T_world_cam = from_yaw(np.pi / 2, [1, 2, 0.5]) @ from_rotation(R_BASE_OPTICAL)
    np.testing.assert_allclose(transform(T_world_cam, [0.4, 0, 3]), [1.4, 5, 0.5], atol=1e-12)
    printed = as_printed.world_points(T_world_cam[:3, :3], [1, 2, 0.5], [[0.4, 0, 3]])
    assert np.linalg.norm(printed - [1.4, 5, 0.5]) > 1


NOT_RIGID = {
    "stretched": (np.diag([1.01, 1, 1, 1]), "not rigid"),
    "mirrored": (np.diag([-1.0, 1, 1, 1]), "determinant -1"),
    "sheared": (np.eye(4) + 0.01 * np.eye(4, k=1), "not rigid"),
    "of zeros": (np.diag([0.0, 0, 0, 1]), "not rigid"),
    "with NaN": (np.full((4, 4), np.nan), "NaN or infinity"),
    "infinitely far": (from_rotation(np.eye(3), [np.inf, 0, 0]), "NaN or infinity"),
    "transposed": (from_rotation(np.eye(3), [1, 2, 3]).T, "must end with the row 0 0 0 1"),
    "without its last row": (np.eye(4)[:3], "must be a (4, 4) matrix, not (3, 4)"),
}


@pytest.mark.parametrize("kind", NOT_RIGID)
def test_a_matrix_that_is_no_pose_is_refused_by_name(kind):
    matrix, reason = NOT_RIGID[kind]
    with pytest.raises(InvalidInputError) as refusal:
        as_pose(matrix, "T_odom_base")
    assert "T_odom_base" in str(refusal.value)
    assert reason in str(refusal.value)


@given(poses)
def test_a_pose_printed_with_six_digits_is_still_a_pose(T):
    as_pose(np.round(T, 6))


def test_a_checked_pose_does_not_change_with_the_callers_array():
    mine = np.eye(4)
    checked = as_pose(mine)
    mine[0, 3] = 5
    assert checked[0, 3] == 0


def test_an_unknown_name_is_answered_with_the_choices_in_order():
    error = unknown_name("matcher", "sgmb", ["sgbm", "bm"])
    assert str(error) == "no matcher named 'sgmb'; did you mean 'sgbm'? choose from: bm, sgbm"
    assert isinstance(error, StereogridError)
    assert isinstance(error, ValueError)


def test_a_rounded_rotation_is_made_one_and_the_position_stays():
    T = from_yaw(0.5, [1, 2, 3])
    for rounded in (np.round(T, 3), np.round(T, 3)[:3]):
        made = nearest_pose(rounded)
        np.testing.assert_allclose(made, T, atol=1e-3)
        np.testing.assert_allclose(made[:3, :3] @ made[:3, :3].T, np.eye(3), atol=1e-12)
        assert (made[:3, 3] == [1, 2, 3]).all()


@pytest.mark.parametrize(
    "wrong",
    [np.diag([1, 1, 1.05, 1]), np.diag([-1, 1, 1, 1]), np.full((4, 4), np.nan), np.eye(3), np.diag([1, 1, 1, 2])],
    ids=["stretched", "mirrored", "nan", "no position", "last row"],
)
def test_what_no_rounding_explains_is_refused(wrong):
    with pytest.raises(InvalidInputError, match="the mount"):
        nearest_pose(wrong, "the mount")
