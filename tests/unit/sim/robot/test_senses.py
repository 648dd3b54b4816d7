"""What the robot senses: ranges, bumpers, stalled wheels and a battery that runs down."""

import numpy as np
import pytest

pytest.importorskip("pybullet")

from plain_worlds import GREY, block, world

from sim.robot.battery import Battery
from sim.robot.pioneer import TICK_S, Pioneer
from sim.robot.sonar import HEADINGS_RAD, PLACES_M, SonarNoise
from sim.robot.touch import StallWatch, bumpers
from sim.robot.turning import slope
from sim.scene.movers import Mover
from sim.scene.solids import box
from sim.scene.terrain import Terrain
from stereogrid.errors import InvalidInputError
from stereogrid.geometry import from_yaw

WALL = block((1.0, -2.0, 0.0), (1.2, 2.0, 1.0))


def test_the_sonars_stand_in_two_rings_that_mirror_each_other() -> None:
    assert PLACES_M.shape == (16, 3) and PLACES_M[3].tolist() == [0.245, 0.027, 0.25]
    mirror = [7, 6, 5, 4, 3, 2, 1, 0, 15, 14, 13, 12, 11, 10, 9, 8]
    assert PLACES_M[mirror] == pytest.approx(PLACES_M * [1, -1, 1])
    assert HEADINGS_RAD[mirror] == pytest.approx(-HEADINGS_RAD)


def test_a_wall_ahead_is_heard_by_the_sonars_that_face_it_at_its_distance() -> None:
    with Pioneer(world(WALL)) as robot:
        ranges = robot.sonar_m()
    # The middle two see it under 10 degrees, so along the side of their cones at right angles.
    assert ranges[[3, 4]] == pytest.approx(1.0 - 0.245, abs=0.005)
    assert (ranges[[0, 7, *range(8, 16)]] == 5.0).all()


def test_a_wall_beside_is_not_heard_where_it_is_hit_at_a_flat_angle() -> None:
    with Pioneer(world(block((-5.0, 1.0, 0.0), (5.0, 1.2, 1.0)))) as robot:
        ranges = robot.sonar_m()
    assert ranges[[0, 15]] == pytest.approx(1.0 - 0.136, abs=0.005)
    assert (ranges[[3, 4, 5, 6, 7, 8, 9, 10, 11, 12]] == 5.0).all()


def test_a_lamp_post_of_six_centimetres_is_heard_at_three_metres() -> None:
    yaw = HEADINGS_RAD[3]
    x, y = PLACES_M[3, :2] + 3.0 * np.array([np.cos(yaw), np.sin(yaw)])
    post = block((-0.03, -0.03, 0.0), (0.03, 0.03, 2.0), from_yaw(yaw, (x, y, 0.0)))
    with Pioneer(world(post)) as robot:
        assert robot.sonar_m()[3] == pytest.approx(2.97, abs=0.01)


def test_flat_ground_grass_and_what_hangs_high_are_not_heard() -> None:
    flat = Terrain(np.zeros((3, 3)), (-20.0, -20.0), 20.0, "grey")
    grass = box("grass", (0.6, -1.0, 0.0), (0.7, 1.0, 0.4), GREY, soft=True)
    with Pioneer(world(grass, block((0.5, -2.0, 2.0), (1.0, 2.0, 2.2)), terrain=flat)) as robot:
        assert (robot.sonar_m() == 5.0).all()


def test_a_bank_of_earth_is_heard() -> None:
    heights = np.tile(np.where(np.arange(41) >= 25, 1.5, 0.0), (41, 1))
    with Pioneer(world(terrain=Terrain(heights, (-8.0, -8.0), 0.4, "grey"))) as robot:
        assert robot.sonar_m()[3] == pytest.approx(1.6 - 0.245 + 0.07, abs=0.05)


def test_a_mover_is_heard_where_it_is_now_and_pushes_the_robot() -> None:
    body = (box("body", (-0.2, -0.2, 0.0), (0.2, 0.2, 1.7), GREY),)
    walker = Mover("walker", body, np.array([[3.0, 0.0], [-3.0, 0.0]]), speed_mps=1.0)
    with Pioneer(world(movers=(walker,))) as robot:
        for _ in range(30):
            robot.drive(0.0, 0.0)
        assert robot.sonar_m()[3] == pytest.approx(2.0 - 0.2 - 0.245, abs=0.02)
        for _ in range(60):
            robot.drive(0.0, 0.0)
        assert robot.bumpers[0] and not robot.bumpers[1]
        # Its front is where the walker's is.
        assert robot.T_world_base[0, 3] + 0.254 == pytest.approx(0.0 - 0.2, abs=0.05)
        assert robot.sonar_m()[3] == pytest.approx(0.15)


def test_noise_of_the_sonars_spreads_and_misses_as_told() -> None:
    rng = np.random.default_rng(0)
    ranges = SonarNoise(spread=0.01, missed=0.2).applied(np.full(20000, 2.0), rng)
    heard = ranges[ranges < 5.0]
    assert len(heard) / len(ranges) == pytest.approx(0.8, abs=0.01)
    assert heard.std() == pytest.approx(0.02, rel=0.03) and heard.mean() == pytest.approx(2.0, rel=1e-3)
    assert SonarNoise().applied(np.array([0.2, 5.0]), rng).tolist() == [0.2, 5.0]
    with pytest.raises(InvalidInputError, match="missed"):
        SonarNoise(missed=1.0)


def test_the_robot_hears_with_noise_that_follows_from_its_seed() -> None:
    def heard(noise: SonarNoise | None, seed: int = 0) -> list[list[float]]:
        with Pioneer(world(WALL), sonar_noise=noise, seed=seed) as robot:
            return [robot.sonar_m().tolist() for _ in range(3)]

    noise = SonarNoise(spread=0.02)
    clean, noisy = np.array(heard(None)), np.array(heard(noise, 1))
    assert (clean == clean[0]).all() and np.ptp(noisy[:, 3]) > 0
    assert noisy[:, 3] == pytest.approx(clean[:, 3], rel=0.1)
    assert heard(noise, 1) == noisy.tolist() != heard(noise, 2)
    with pytest.raises(InvalidInputError, match="seed"):
        Pioneer(seed=-1)


@pytest.mark.parametrize("speed_mps", [0.3, -0.3])
def test_a_wall_presses_all_segments_of_the_bumper_that_meets_it(speed_mps: float) -> None:
    walls = (WALL, block((-1.2, -2.0, 0.0), (-1.0, 2.0, 1.0)))
    with Pioneer(world(*walls)) as robot:
        for _ in range(150):
            robot.drive(speed_mps, 0.0)
        assert robot.bumpers == ((0b11111, 0) if speed_mps > 0 else (0, 0b11111))
        assert abs(robot.T_world_base[0, 3]) + 0.254 == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize(("y_m", "segment"), [(0.19, 0), (0.1, 1), (0.0, 2), (-0.1, 3), (-0.19, 4)])
def test_a_post_presses_the_segment_that_meets_it(y_m: float, segment: int) -> None:
    with Pioneer(world(block((0.6, y_m - 0.02, 0.0), (0.64, y_m + 0.02, 1.0)))) as robot:
        while not any(robot.bumpers) and robot.time_s < 3.0:
            robot.drive(0.2, 0.0)
        assert robot.bumpers == (1 << segment, 0)


def test_bumpers_are_numbered_on_round_the_robot() -> None:
    assert bumpers([(0.25, 0.2), (0.25, -0.2)]) == (0b10001, 0)
    assert bumpers([(-0.25, -0.2)]) == (0, 0b00001)
    assert bumpers([(0.1, 0.25), (-0.1, -0.25)]) == (0, 0)


def test_wheels_that_hold_against_a_wall_stall_and_those_that_slip_do_not() -> None:
    pushed = {}
    for surface in ("carpet", "ice"):
        with Pioneer(world(WALL), surface=surface, payload_kg=12.0) as robot:
            for _ in range(240):
                robot.drive(0.3, 0.0)
            pushed[surface] = robot.stalled
            assert (robot.odometry.travelled_m > 2.0) == (surface == "ice")
    assert pushed == {"carpet": (True, True), "ice": (False, False)}


def test_one_side_may_stall_alone_and_only_after_a_while() -> None:
    watch = StallWatch()
    states = [watch.update((3.0, -3.0), (0.1, -3.0), TICK_S) for _ in range(12)]
    assert states[0] == (False, False) and states[-1] == (True, False)
    assert watch.update((0.0, 0.0), (0.0, 0.0), TICK_S) == (False, False)


def test_the_battery_falls_faster_the_harder_the_robot_works() -> None:
    volts = {}
    for name, speed in (("parked", 0.0), ("driving", 0.5)):
        with Pioneer(slope(8)) as robot:
            for _ in range(150):
                robot.drive(speed, 0.0)
            volts[name] = (robot.battery_v, robot.battery.rest_v)
    assert volts["driving"] < volts["parked"] < (12.9, 12.9)


def test_an_idle_battery_lasts_its_charge_and_no_longer() -> None:
    battery = Battery()
    battery.draw((0.0, 0.0), (0.0, 0.0), 9 * 3600.0)
    assert 11.9 < battery.rest_v < 12.0
    battery.draw((0.0, 0.0), (0.0, 0.0), 90 * 3600.0)
    assert battery.rest_v == 11.0
    with pytest.raises(InvalidInputError, match=r"11 to 12\.9, not 14"):
        Pioneer(battery_v=14.0)


def test_motors_that_are_off_let_the_robot_roll_down_a_slope() -> None:
    with Pioneer(slope(5)) as robot:
        for _ in range(60):
            robot.drive_wheels(0.0, 0.0)
        assert robot.motors_on and abs(robot.T_world_base[0, 3]) < 1e-3
        for _ in range(60):
            robot.coast()
        assert not robot.motors_on and robot.T_world_base[0, 3] < -0.5
        assert robot.wheel_speeds_mps[0] < -0.3


def test_each_side_may_be_driven_alone() -> None:
    with Pioneer() as robot:
        for _ in range(60):
            robot.drive_wheels(0.0, 0.2)
        left, right = robot.encoders_rad()
        assert robot.wheel_speeds_mps == pytest.approx([0.0, 0.2], abs=1e-3)
        assert abs(left) < 0.01 and right == pytest.approx(0.2 * 2 / 0.11, rel=0.02)
        with pytest.raises(InvalidInputError, match="finite"):
            robot.drive_wheels(np.nan, 0.0)
