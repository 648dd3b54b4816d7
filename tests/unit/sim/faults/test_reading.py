"""Noise comes after the truth, by (seed, index, side) alone; pairs are lost and pictures repeated as often as said."""

from itertools import pairwise

import cv2
import numpy as np
import pytest
from faults_scenes import FewObservations

pytest.importorskip("embreex")

from sim.faults import PRESETS, CameraFaults, FaultyCameras
from stereogrid.camera import StereoCamera
from stereogrid.observation import Recording
from stereogrid.recording import poses, stamps_s

MINORU = PRESETS["minoru"].still
LARGE = StereoCamera(834.0, 319.5, 239.5, 0.06, 640, 480)


def test_the_faults_of_an_observation_depend_on_seed_index_and_side_only() -> None:
    short, long = (list(FaultyCameras(FewObservations(n), MINORU, seed=7)) for n in (2, 5))
    for a, b in zip(short, long, strict=False):
        assert np.array_equal(a.left, b.left) and np.array_equal(a.right, b.right)
    assert not np.array_equal(long[0].left, long[1].left)
    assert not np.array_equal(long[0].left, long[0].right)
    other = next(iter(FaultyCameras(FewObservations(1), MINORU, seed=8)))
    assert not np.array_equal(long[0].left, other.left)


def test_a_faulty_recording_is_a_recording_and_can_be_read_twice() -> None:
    faulty = FaultyCameras(FewObservations(4, (60, 160, 200)), MINORU, seed=1)
    assert isinstance(faulty, Recording) and len(faulty) == 4
    assert [o.left.tobytes() for o in faulty] == [o.left.tobytes() for o in faulty]


def test_the_number_of_threads_changes_nothing() -> None:
    threads, images = cv2.getNumThreads(), []
    try:
        for count in (1, 4):
            cv2.setNumThreads(count)
            images.append([o.right.tobytes() for o in FaultyCameras(FewObservations(2, camera=LARGE), MINORU, seed=1)])
    finally:
        cv2.setNumThreads(threads)
    assert images[0] == images[1]


def test_stamps_odometry_and_truth_pass_untouched() -> None:
    for a, b in zip(FewObservations(2), FaultyCameras(FewObservations(2), MINORU, seed=1), strict=True):
        assert b.stamp_s == a.stamp_s and b.truth is not None
        assert np.array_equal(a.odometry.T_odom_base, b.odometry.T_odom_base)
        assert np.array_equal(a.T_world_cam, b.T_world_cam)


def test_dropped_pairs_are_missing_and_the_others_are_as_without_drops() -> None:
    whole = list(FaultyCameras(FewObservations(400), CameraFaults(full_well_e=500.0), seed=3))
    dropping = FaultyCameras(FewObservations(400), CameraFaults(full_well_e=500.0, drop_share=0.2), seed=3)
    left = list(dropping)
    assert len(left) == len(dropping) == len(poses(dropping))
    assert stamps_s(dropping).tolist() == [each.stamp_s for each in left]
    # 80 are expected, give or take three deviations of a binomial.
    assert 400 - len(left) == pytest.approx(80, abs=24)
    for observation in left:
        assert np.array_equal(observation.left, whole[int(observation.stamp_s)].left)


def test_more_are_dropped_of_a_greater_share_and_the_same_ones() -> None:
    few, many = (
        {o.stamp_s for o in FaultyCameras(FewObservations(100), CameraFaults(drop_share=share), seed=0)}
        for share in (0.1, 0.4)
    )
    assert many < few


def test_on_places_apart_exposure_has_settled_on_each() -> None:
    """Along a drive the second picture would get the gain of the first."""
    faults, places = CameraFaults(auto_exposure=1.0), FewObservations(4, (60, 150))
    lights = [np.mean((each.left / 255.0) ** 2) for each in FaultyCameras(places, faults, 0, settled=True)]
    assert lights == pytest.approx([0.18] * 4, rel=0.03)
    late = [np.mean((each.left / 255.0) ** 2) for each in FaultyCameras(places, faults, 0)]
    assert late[1] > 0.5


def test_all_may_be_dropped() -> None:
    nothing = FaultyCameras(FewObservations(3), CameraFaults(drop_share=1.0), seed=0)
    assert len(nothing) == 0 and list(nothing) == []


def test_a_repeated_picture_is_the_one_before_bit_for_bit_on_one_side() -> None:
    faults = CameraFaults(full_well_e=500.0, repeat_share=0.3)
    seen = list(FaultyCameras(FewObservations(300), faults, seed=2))
    stale = {"left": 0, "right": 0}
    for before, now in pairwise(seen):
        same = [np.array_equal(getattr(before, side), getattr(now, side)) for side in stale]
        assert not all(same)
        for side, is_same in zip(stale, same, strict=True):
            stale[side] += is_same
    assert sum(stale.values()) == pytest.approx(90, abs=24)
    assert min(stale.values()) > 25


def test_what_is_repeated_is_what_arrived_last() -> None:
    """The pictures of a pair that was dropped never come again."""
    faults = CameraFaults(full_well_e=500.0, repeat_share=1.0, drop_share=0.4)
    seen = list(FaultyCameras(FewObservations(30), faults, seed=2))
    for before, now in pairwise(seen):
        assert np.array_equal(before.left, now.left) or np.array_equal(before.right, now.right)
