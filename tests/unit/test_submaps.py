"""A drive mapped piece by piece: sharp within a piece, and placed no more surely than its pose is known."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from scipy.stats import norm

from stereogrid.errors import MapTooLargeError
from stereogrid.geometry import from_rotation, from_yaw
from stereogrid.grid import OccupancyGrid
from stereogrid.mapper import Mapper
from stereogrid.motion import Growth, MotionError
from stereogrid.observation import Observation, Odometry
from stereogrid.sensor_model import SensorModel

from .grid.scenes import CAMERA, FORWARD, constant_disparity, random_disparity

MODEL = SensorModel(max_range_m=3.0)
CELL_M = 0.1
WALL_M = 2.05
BLANK = np.zeros(CAMERA.shape, np.uint8)


def at(x_m, travelled_m, *, turned_rad=0.0):
    T_odom_base = from_yaw(turned_rad, (x_m, 0.0, 0.0))
    return Observation(0.0, BLANK, BLANK, Odometry(T_odom_base, travelled_m), T_odom_base @ FORWARD)


def mapped(observations, disparities, error, **options):
    grid = OccupancyGrid(CELL_M, model=MODEL, **options)
    mapper = Mapper(CAMERA, None, grid, error)
    for observation, disparity in zip(observations, disparities, strict=True):
        mapper.fuse(observation, disparity)
    mapper.finish()
    return grid


def drive(n, step_m=0.3):
    rng = np.random.default_rng(1)
    seen = [at(step_m * k, step_m * k, turned_rad=0.05 * k) for k in range(n)]
    return seen, [random_disparity(rng) for _ in range(n)]


ALMOST_EXACT = MotionError(way="submaps", along=Growth(b=1e-6))


@pytest.mark.parametrize("submap_m", [0.0, 0.7, 100.0])
def test_pieces_of_exact_poses_make_up_the_whole_map(submap_m):
    exact = mapped(*drive(8), MotionError(way="none"), clamp=None)
    pieces = mapped(*drive(8), replace(ALMOST_EXACT, submap_m=submap_m), clamp=None)
    assert pieces.sha256() == exact.sha256()


def test_where_no_error_is_told_there_are_no_pieces_and_the_clamp_acts_as_ever():
    exact, told_zero = (mapped(*drive(8), MotionError(way=way), clamp=1.0) for way in ("none", "submaps"))
    assert told_zero.sha256() == exact.sha256()


def wall_before(x_m):
    return constant_disparity(CAMERA.focal_baseline_px_m / (WALL_M - x_m), 0.05)


@pytest.mark.parametrize("looks", [3, 30])
def test_a_wall_is_as_likely_in_each_cell_as_the_pose_lets_it_be_however_often_it_is_seen(looks):
    """The last pose, 10 m from where it was certain, errs by 2 % of the way: 20 cm along it."""
    error = MotionError(way="submaps", along=Growth(b=0.02), submap_m=1.0)
    seen = [at(0.0, 0.0), *(at(0.001 * k, 10.0) for k in range(looks))]
    # The first observation sees nothing: it only says where the pose was certain.
    far = constant_disparity(0.1, 1.0)
    start = Observation(0.0, BLANK, BLANK, Odometry(from_yaw(0.0, (-10.0, 0.0, 0.0))), from_rotation(np.eye(3)))
    grid = mapped([start, *seen[1:]], [far, *(wall_before(0.0) for _ in range(looks))], error)
    # What lies behind it is not known.
    k = np.arange(-3, 1)
    p = grid.probability(np.stack([WALL_M + k * CELL_M, np.full(4, 0.05), np.full(4, 0.05)], axis=1))
    share = norm.cdf((k + 0.5) * CELL_M, scale=0.2) - norm.cdf((k - 0.5) * CELL_M, scale=0.2)
    # The wall itself fills a cell or two of its piece.
    assert (p > share).all()
    assert (p < 3 * share).all()


def test_one_error_for_all_observations_is_not_taken_for_independent_ones():
    def surest(way, looks):
        error = MotionError(way=way, along=Growth(b=0.02))
        start = Observation(0.0, BLANK, BLANK, Odometry(from_yaw(0.0, (-10.0, 0.0, 0.0))), from_rotation(np.eye(3)))
        seen = [start, *(at(0.0, 10.0) for _ in range(looks))]
        walls = [constant_disparity(0.1, 1.0), *(wall_before(0.0) for _ in range(looks))]
        p = mapped(seen, walls, error).probability([[WALL_M - 0.2, 0.05, 0.05]])
        return abs(float(p[0]) - 0.15)

    # One sigma before the wall's place .12 to .18 is right: fused one by one, 30 looks grow sure of one or the other.
    assert surest("submaps", 30) < 0.15 < surest("rss", 30)


def test_a_piece_ends_where_the_pose_is_known_again():
    error = MotionError(way="submaps", along=Growth(b=0.1), submap_m=100.0)
    seen = [at(0.0, 0.0), at(9.0, 9.0), at(9.0, 0.0)]
    sure, unsure = (mapped(seen[:n], [wall_before(0.0)] * n, error) for n in (3, 2))
    wall = [[9.0 + WALL_M, 0.05, 0.05]]
    assert sure.probability(wall) > 0.8 > unsure.probability(wall)


def test_finishing_twice_adds_nothing_and_more_may_follow():
    error = MotionError(way="submaps", along=Growth(b=0.01))
    grid = OccupancyGrid(CELL_M, model=MODEL)
    mapper = Mapper(CAMERA, None, grid, error)
    mapper.fuse(at(0.0, 0.0), wall_before(0.0))
    assert grid.n_known == 0
    mapper.finish()
    once = grid.sha256()
    assert grid.n_known > 0
    mapper.finish()
    assert grid.sha256() == once
    mapper.fuse(at(0.5, 0.5), wall_before(0.5))
    mapper.finish()
    assert grid.sha256() != once


def test_ends_of_other_ways_change_nothing():
    exact = mapped(*drive(3), MotionError(way="rss", along=Growth(b=0.01)))
    grid = OccupancyGrid(CELL_M, model=MODEL)
    mapper = Mapper(CAMERA, None, grid, MotionError(way="rss", along=Growth(b=0.01)))
    for observation, disparity in zip(*drive(3), strict=True):
        mapper.fuse(observation, disparity)
    assert grid.sha256() == exact.sha256()


@pytest.mark.parametrize("fusion", ["cell", "sum_of_rays"])
def test_both_rules_of_fusion_can_be_mapped_by_pieces(fusion):
    make = partial(mapped, [at(0.0, 0.0), at(0.1, 0.1)], [wall_before(0.0), wall_before(0.1)], fusion=fusion)
    sharp, spread = make(ALMOST_EXACT), make(MotionError(way="submaps", position_m=0.2))
    assert sharp.probability([[WALL_M, 0.05, 0.05]]) > spread.probability([[WALL_M, 0.05, 0.05]])


def test_a_map_that_outgrows_its_limit_says_so_and_keeps_what_it_has():
    error = replace(ALMOST_EXACT, submap_m=0.0)
    grid = OccupancyGrid(CELL_M, model=MODEL)
    mapper = Mapper(CAMERA, None, grid, error)
    mapper.fuse(at(0.0, 0.0), wall_before(0.0))
    mapper.finish()
    before = grid.sha256()
    mapper.fuse(at(50.0, 50.0), wall_before(0.0))
    grid.memory_limit_gb = grid.n_bytes / 1e9
    with pytest.raises(MapTooLargeError, match="its limit is"):
        mapper.finish()
    assert grid.sha256() == before
