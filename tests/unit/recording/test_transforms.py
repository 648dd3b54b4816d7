"""Trees of frames obey the laws of composition, whatever order and form they are told in."""

from typing import Any

import numpy as np
import pytest
from drawn_bags import Sent, cdr, transform

from stereogrid.geometry import FloatArray, from_rotation, from_yaw, inverse
from stereogrid.recording import ros2_messages as ros2
from stereogrid.recording.contents import Contents
from stereogrid.recording.transforms import Transforms

A, B, C = from_yaw(0.3, [1, 0, 0]), from_yaw(-0.2, [0, 2, 0.5]), from_yaw(1.0, [0.1, 0.2, 0.3])


def told(stamp_ns: int, parent: str, child: str, T: FloatArray) -> bytes:
    return cdr(Sent("/tf", "tf2_msgs/msg/TFMessage", transform(stamp_ns, parent, child, T), 0))


def static(parent: str, child: str, T: FloatArray) -> Any:
    return ros2.decoder("tf2_msgs/msg/TFMessage")(told(0, parent, child, T)).transforms[0]


def tree(fixed: list[Any], moving: list[bytes] | None = None) -> Transforms:
    return Transforms(Contents(static_transforms=fixed, transforms=moving or []))


def test_fixed_frames_are_composed_up_and_down_the_tree() -> None:
    frames = tree([static("base", "mast", A), static("mast", "left", B), static("base", "laser", C)])
    np.testing.assert_allclose(frames.fixed("base", "left"), A @ B, atol=1e-12)
    np.testing.assert_allclose(frames.fixed("left", "laser"), inverse(A @ B) @ C, atol=1e-12)
    np.testing.assert_allclose(frames.fixed("left", "left"), np.eye(4), atol=1e-12)
    assert frames.fixed("base", "elsewhere") is None
    assert frames.fixed_relatives("left") == ["left", "base", "laser", "mast"]
    assert not frames.world and frames.moving("left") is None


def test_a_ring_of_frames_ends() -> None:
    frames = tree([static("a", "b", A), static("b", "c", B), static("c", "a", C)])
    assert frames.fixed("a", "nowhere") is None and frames.moving("a") is None
    assert set(frames.fixed_relatives("a")) >= {"a"}


def test_moving_frames_are_composed_at_the_stamps_of_the_one_that_is_told_most() -> None:
    """odom -> base every 10 ms; map -> odom twice: from map, only where both are known."""
    moving = [told(10 * k, "/odom", "/base", from_yaw(0.01 * k, [0.1 * k, 0, 0])) for k in range(11)]
    moving += [told(20, "map", "odom", from_yaw(0.0, [1, 0, 0])), told(60, "map", "odom", from_yaw(0.0, [2, 0, 0]))]
    frames = tree([static("base", "left", B)], moving)
    world, body, stamps_ns, T = frames.moving("left")  # type: ignore[misc]
    assert (world, body, len(stamps_ns)) == ("odom", "base", 11) and frames.world
    np.testing.assert_allclose(T[4], from_yaw(0.04, [0.4, 0, 0]), atol=1e-12)
    renamed = tree([static("base", "left", B)], [each.replace(b"odom", b"chas") for each in moving])
    world, body, stamps_ns, T = renamed.moving("left")  # type: ignore[misc]
    assert world == "map" and stamps_ns.tolist() == [20, 30, 40, 50, 60]
    np.testing.assert_allclose(T[2], from_rotation(np.eye(3), [1.5, 0, 0]) @ from_yaw(0.04, [0.4, 0, 0]), atol=1e-12)


def test_over_a_gap_in_what_moves_nothing_is_known() -> None:
    """base every .1 s in chassis; chassis in map until .4 s, and from 1.4 s on."""
    ms = 1_000_000
    moving = [told(100 * k * ms, "chassis", "base", from_yaw(0.01 * k, [0.1 * k, 0, 0])) for k in range(20)]
    moving += [told(k * ms, "map", "chassis", from_yaw(0.0, [k, 0, 0])) for k in (0, 200, 400, 1400, 1900)]
    world, body, stamps_ns, T = tree([], moving).moving("base")  # type: ignore[misc]
    assert (world, body) == ("map", "base")
    assert (stamps_ns // ms).tolist() == [0, 100, 200, 300, 400, 1400, 1500, 1600, 1700, 1800, 1900]
    np.testing.assert_allclose(T[6], from_yaw(0.15, [1501.5, 0, 0]), atol=1e-9)


def test_a_robot_that_stands_in_the_world_moves_as_far_as_anyone_knows() -> None:
    frames = tree([static("base", "left", B)], [told(k, "odom", "base", A) for k in range(3)])
    found = frames.moving("left")
    assert found is not None and len(found[2]) == 3
    same = tree([], [told(k, "base", "left", B) for k in range(3)])
    np.testing.assert_allclose(same.fixed("base", "left"), B, atol=1e-12)


def test_of_two_parents_the_one_that_is_told_more_counts_and_wrong_ones_are_passed_over() -> None:
    nan = from_yaw(0.0, [np.nan, 0, 0])
    moving = [told(k, "odom", "base", from_yaw(0.0, [k, 0, 0])) for k in range(3)]
    moving += [told(k, "vicon", "base", from_yaw(0.0, [0, k, 0])) for k in range(2)] + [told(9, "odom", "base", nan)]
    frames = tree([], moving)
    assert frames.n_wrong == 1
    world, _, stamps_ns, T = frames.moving("base")  # type: ignore[misc]
    assert world == "odom" and stamps_ns.tolist() == [0, 1, 2] and T[2, 0, 3] == pytest.approx(2)
