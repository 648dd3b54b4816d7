"""The wheels run 1.4 to 1.6 times as far as the turn asks, as the real robot's; `python -m sim turning` has it all."""

import numpy as np
import pytest

pytest.importorskip("pybullet")

from sim.robot.ground import SURFACES
from sim.robot.pioneer import TICK_S, Pioneer
from sim.robot.turning import Turned, ratio, rough, slope, summary
from sim.scene.scene import World

REAL = 588 / 398


@pytest.mark.parametrize(
    ("speed_mps", "turn_radps"),
    [(0.0, 0.1), (0.0, -0.3), (0.0, 0.8), (0.0, -1.2), (0.1, 0.25), (0.4, -1.0), (0.7, 0.7), (0.7, -0.14), (-0.3, 0.3)],
)
def test_on_a_plane_every_turn_costs_what_the_real_robot_pays(speed_mps: float, turn_radps: float) -> None:
    with Pioneer() as robot:
        assert ratio(robot, speed_mps, turn_radps, 2.0) == pytest.approx(REAL, rel=0.01)


@pytest.mark.parametrize("surface", SURFACES)
@pytest.mark.parametrize("payload_kg", [0.0, 12.0])
def test_neither_the_surface_nor_the_load_changes_it(surface: str, payload_kg: float) -> None:
    for speed, turn in ((0.0, 0.8), (0.4, 0.4)):
        with Pioneer(surface=surface, payload_kg=payload_kg) as robot:
            assert ratio(robot, speed, turn, 1.0) == pytest.approx(REAL, rel=0.02)


@pytest.mark.parametrize("degrees", [5.0, 10.0])
@pytest.mark.parametrize("payload_kg", [0.0, 12.0])
@pytest.mark.parametrize(
    ("speed_mps", "turn_radps"), [(0.0, 0.1), (0.0, -0.8), (0.0, 1.2), (0.4, -1.0), (0.7, 0.14), (-0.5, 0.25)]
)
def test_nor_does_a_slope_by_much(degrees: float, payload_kg: float, speed_mps: float, turn_radps: float) -> None:
    with Pioneer(slope(degrees), payload_kg=payload_kg) as robot:
        assert 1.4 <= ratio(robot, speed_mps, turn_radps, 2.0) <= 1.6


@pytest.fixture(scope="module")
def bumpy() -> World:
    return rough()


@pytest.mark.parametrize(("speed_mps", "turn_radps"), [(0.0, 0.3), (0.0, -1.2), (0.3, 0.3), (-0.5, 0.25)])
def test_nor_do_bumps(bumpy: World, speed_mps: float, turn_radps: float) -> None:
    with Pioneer(bumpy, surface="asphalt") as robot:
        assert 1.4 <= ratio(robot, speed_mps, turn_radps, 4.0) <= 1.6


def test_a_straight_drive_is_straight_and_as_long_as_the_wheels_say() -> None:
    with Pioneer() as robot:
        for k in range(300):
            robot.drive(min(0.4, 0.02 * k), 0.0)
        x, y, _ = robot.T_world_base[:3, 3]
        assert x == pytest.approx(robot.odometry.travelled_m, rel=1e-4)
        assert abs(y) < 1e-6


def test_a_rebuilt_robot_moves_the_same_bit_for_bit(bumpy: World) -> None:
    def drive() -> bytes:
        with Pioneer(bumpy, surface="grass", payload_kg=5.0) as robot:
            for k in range(90):
                robot.drive(0.4, np.sin(k * TICK_S))
            return robot.T_world_base.tobytes() + robot.encoders_rad().tobytes()

    assert drive() == drive()


def test_the_summary_names_the_extremes_of_each_ground() -> None:
    turns = [Turned("ice", 0.0, 0.3, 0.0, 1.5), Turned("ice", 0.2, 0.3, 0.0, 1.4), Turned("mud", 0.0, 1.0, 12.0, 1.6)]
    lines = list(summary(turns))
    assert lines[0] == "ice, 0 kg: 1.4500, from 1.400 (0.2 m/s, 0.3 rad/s) to 1.500 (0 m/s, 0.3 rad/s)"
    assert lines[1].startswith("mud, 12 kg: 1.6000")
