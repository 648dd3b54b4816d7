"""Match, model, integrate, and nothing else."""

from dataclasses import replace

import numpy as np
import pytest

from stereogrid.errors import InvalidInputError, MapTooLargeError, RecordingError
from stereogrid.geometry import from_yaw
from stereogrid.grid import OccupancyGrid
from stereogrid.mapper import Mapper
from stereogrid.mapping_run import build_map, map_while_it_fits
from stereogrid.motion import Growth, MotionError, PoseUncertainty
from stereogrid.observation import Observation, Odometry
from stereogrid.sensor_model import SensorModel

from .grid.scenes import CAMERA, FORWARD, constant_disparity, random_disparity

MODEL = SensorModel(max_range_m=3.0)


class Scripted:
    """A matcher that gives prepared disparities and remembers what it was shown."""

    def __init__(self, disparities):
        self.disparities, self.seen = list(disparities), []

    def match(self, left, right):
        self.seen.append((left, right))
        return self.disparities[len(self.seen) - 1]


def observation(n, travelled_m=0.0):
    left, right = np.random.default_rng(n).integers(0, 256, (2, *CAMERA.shape), dtype=np.uint8)
    T = from_yaw(0.1 * n, [0.1 * n, 0, 0]) @ FORWARD
    return Observation(float(n), left, right, Odometry(np.eye(4), travelled_m=travelled_m), T)


def disparities(n):
    rng = np.random.default_rng(3)
    return [random_disparity(rng) for _ in range(n)]


def test_a_step_fuses_what_the_matcher_found_at_the_claimed_pose_and_returns_it():
    made = disparities(3)
    matcher = Scripted(made)
    mapper = Mapper(CAMERA, matcher, OccupancyGrid(0.1, model=MODEL))
    by_hand = OccupancyGrid(0.1, model=MODEL)
    for n, disparity in enumerate(made):
        seen = observation(n)
        assert mapper.step(seen) is disparity
        assert matcher.seen[n][0] is seen.left
        assert matcher.seen[n][1] is seen.right
        by_hand.integrate(CAMERA, disparity, seen.T_world_cam)
    assert mapper.grid.sha256() == by_hand.sha256()


def test_without_a_matcher_the_observations_own_disparities_are_fused():
    made = disparities(2)
    mapper, by_hand = (Mapper(CAMERA, matcher, OccupancyGrid(0.1, model=MODEL)) for matcher in (None, Scripted(made)))
    for n, disparity in enumerate(made):
        assert mapper.step(replace(observation(n), disparity=disparity)) is disparity
        by_hand.step(observation(n))
    assert mapper.grid.sha256() == by_hand.grid.sha256()
    with pytest.raises(InvalidInputError, match=r"the observation at 2\.0 s carries no disparity: give a matcher"):
        mapper.step(observation(2))


def test_a_matchers_disparity_comes_before_the_observations_own():
    found, own = disparities(2)
    mapper = Mapper(CAMERA, Scripted([found]), OccupancyGrid(0.1, model=MODEL))
    assert mapper.step(replace(observation(0), disparity=own)) is found


def test_eps_comes_from_the_distance_travelled():
    motion = MotionError(along=Growth(0.01, 0.05), kappa=2.0)
    disparity = constant_disparity(4.0, 0.1)
    mapper = Mapper(CAMERA, Scripted([disparity]), OccupancyGrid(0.1, model=MODEL), motion)
    mapper.step(observation(0, travelled_m=4.0))
    by_hand = OccupancyGrid(0.1, model=MODEL)
    # 2 sqrt(0.01 * 4 + (0.05 * 4)^2)
    by_hand.integrate(CAMERA, disparity, FORWARD, motion_sigma_m=2 * np.sqrt(0.08))
    exact = OccupancyGrid(0.1, model=MODEL)
    exact.integrate(CAMERA, disparity, FORWARD)
    assert mapper.grid.sha256() == by_hand.sha256() != exact.sha256()


def test_by_the_way_pose_each_observation_is_fused_with_the_covariance_of_its_pose():
    error = MotionError(way="pose", along=Growth(0.01), heading=Growth(0.01), position_m=0.1)
    made, drive = disparities(3), [observation(n, travelled_m=0.1 * n) for n in range(3)]
    mapper = Mapper(CAMERA, Scripted(made), OccupancyGrid(0.1, model=MODEL), error)
    by_hand = OccupancyGrid(0.1, model=MODEL)
    uncertainty = PoseUncertainty(error)
    for disparity, each in zip(made, drive, strict=True):
        mapper.step(each)
        by_hand.integrate(CAMERA, disparity, each.T_world_cam, pose_covariance=uncertainty.step(each))
    assert mapper.grid.sha256() == by_hand.sha256()
    exact, certain = (
        Mapper(CAMERA, Scripted(made), OccupancyGrid(0.1, model=MODEL), MotionError(way=way))
        for way in ("none", "pose")
    )
    for each in drive:
        exact.step(each)
        certain.step(each)
    assert exact.grid.sha256() == certain.grid.sha256() != mapper.grid.sha256()


def test_without_a_motion_error_poses_count_as_exact():
    disparity = constant_disparity(4.0, 0.1)
    grids = []
    for travelled_m in (0.0, 100.0):
        mapper = Mapper(CAMERA, Scripted([disparity]), OccupancyGrid(0.1, model=MODEL))
        mapper.step(observation(0, travelled_m))
        grids.append(mapper.grid.sha256())
    assert grids[0] == grids[1]


def test_a_grid_that_cannot_hold_one_view_is_refused_before_the_first_step():
    matcher = Scripted([])
    with pytest.raises(MapTooLargeError, match="GB"):
        Mapper(CAMERA, matcher, OccupancyGrid(0.0005, model=MODEL))
    assert not matcher.seen


def test_a_disparity_of_another_size_is_refused():
    other = constant_disparity(4.0, 0.1).disparity_px[:-1]
    mapper = Mapper(CAMERA, Scripted([]), OccupancyGrid(0.1, model=MODEL))
    with pytest.raises(InvalidInputError, match=r"\(59, 80\), the camera \(60, 80\)"):
        mapper.fuse(observation(0), type(constant_disparity(4.0, 0.1))(other, np.float32(0.1)))


class Drive(list):
    camera, T_base_cam = CAMERA, FORWARD


class Config:
    """Stands for a MappingConfig whose matcher is scripted."""

    def __init__(self, made, memory_limit_gb=4.0):
        self.matcher, self.memory_limit_gb = Scripted(made), memory_limit_gb

    def build_mapper(self, camera):
        return Mapper(camera, self.matcher, OccupancyGrid(0.1, model=MODEL, memory_limit_gb=self.memory_limit_gb))


def test_a_run_remembers_its_path_its_density_and_a_sample():
    made = disparities(4)
    drive = Drive(observation(n) for n in range(4))
    mapped = build_map(drive, Config(made))
    np.testing.assert_array_equal(mapped.path_T_world_cam, [each.T_world_cam for each in drive])
    np.testing.assert_array_equal(mapped.path_m, [each.T_world_cam[:3, 3] for each in drive])
    assert mapped.density == pytest.approx(np.mean([each.density for each in made]))
    seen, disparity = mapped.sample
    assert any(seen is each and disparity is found for each, found in zip(drive, made, strict=True))


def test_given_disparities_take_the_matchers_place():
    made = disparities(3)
    drive = Drive(observation(n) for n in range(3))
    by_matcher = build_map(drive, Config(made))
    unused = Config([])
    given = build_map(drive, unused, disparity_of=lambda each: made[int(each.stamp_s)])
    assert not unused.matcher.seen
    assert given.grid.sha256() == by_matcher.grid.sha256()


def test_a_recording_without_observations_is_refused():
    with pytest.raises(RecordingError, match="no complete observation"):
        build_map(Drive(), Config([]))


def test_a_drive_that_ends_before_its_first_quarter_has_a_sample():
    class Promising(Drive):
        def __len__(self):
            return 100

    mapped = build_map(Promising(observation(n) for n in range(2)), Config(disparities(2)))
    assert mapped.sample[0].stamp_s == 1
    assert mapped.stopped is None


def far_apart(n):
    """Observations that share no cell."""
    for number in range(n):
        each = observation(number)
        yield replace(each, T_world_cam=from_yaw(0.0, [10.0 * number, 0, 0]) @ FORWARD)


def test_a_map_that_outgrows_its_limit_holds_what_came_before_and_says_what_stopped_it():
    made, drive = disparities(12), Drive(far_apart(12))
    mapped = map_while_it_fits(drive, Config(made, memory_limit_gb=0.0006))
    n = len(mapped.path_m)
    assert 1 < n < 12
    assert isinstance(mapped.stopped, MapTooLargeError)
    assert "its limit is 0.0006 GB" in str(mapped.stopped)
    assert mapped.density == pytest.approx(np.mean([each.density for each in made[:n]]))
    before = build_map(Drive(drive[:n]), Config(made))
    assert mapped.grid.sha256() == before.grid.sha256()
    assert before.stopped is None


def test_who_needs_the_whole_map_gets_an_error_where_it_does_not_fit():
    with pytest.raises(MapTooLargeError, match=r"its limit is 0\.0006 GB"):
        build_map(Drive(far_apart(12)), Config(disparities(12), memory_limit_gb=0.0006))
