"""A robot that falls: its server goes on, tells it to whoever asks, and has a new one for the next client."""

import re
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager

import numpy as np
import pytest
from arcos_client import Bench, Client, TcpWire, order
from kinematic_body import KinematicBody
from plain_worlds import world
from served_robot import ServedRobot

import arcos
from arcos import Code, Sip
from sim.firmware.tcp import TcpLink
from sim.robot.pioneer import Pioneer, SimulationError
from sim.scene.scene import World
from sim.scene.terrain import Terrain

START_M = 3.0
"""The terrain begins this far behind the robot, and at both sides of it."""


def cliff() -> World:
    """The ground ends at a drop of 3 m, half a metre ahead of the robot."""
    heights = np.tile(np.where(np.arange(61) * 0.1 - START_M < 0.75, 0.0, -3.0), (61, 1))
    return world(terrain=Terrain(heights, (-START_M, -START_M), 0.1, "grey"))


def small_ground() -> World:
    """The ground ends a metre ahead of the robot."""
    return world(terrain=Terrain(np.zeros((61, 41)), (-START_M, -START_M), 0.1, "grey"))


@contextmanager
def served(scene: World) -> Iterator[ServedRobot]:
    with ExitStack() as robots:

        def renew() -> Pioneer:
            robots.close()
            return robots.enter_context(Pioneer(scene))

        with ServedRobot(TcpLink(0), renew(), speed_up=3, renew=renew) as robot:
            yield robot


def connected(robot: ServedRobot) -> Client:
    assert isinstance(robot.link, TcpLink)
    client = Client(TcpWire(robot.link.port))
    client.connect()
    client.send(order(Code.ENABLE, 1), order(Code.VEL, 400))
    return client


def lies(sip: Sip) -> bool:
    return sip.e_stopped and not sip.motors_on and not sip.moving and sip.stalled == (True, True)


@pytest.mark.parametrize(("scene", "what"), [(cliff, "tipped over"), (small_ground, "left the ground")])
def test_a_robot_that_falls_lies_until_a_client_opens_a_new_one(scene: Callable[[], World], what: str) -> None:
    with served(scene()) as robot:
        for life in (1, 2):
            client = connected(robot)
            # A robot that lay would not drive, nor be at its start.
            start = client.drive_until(lambda sip: sip.moving)
            assert start.motors_on and not start.e_stopped and start.x_raw < 100
            fallen = client.drive_until(lies)
            client.send(order(Code.ENABLE, 1), order(Code.VEL, 400), order(Code.E_STOP), order(Code.CLOSE, 1))
            falls = [line for line in robot.lines if what in line]
            assert len(falls) == life
            assert re.search(r"at x = \S+ m, y = \S+ m after \d+\.\d s: it lies there until a client", falls[-1])
            assert fallen.x_raw > start.x_raw
            client.close()
        assert sum("a new robot stands at the start" in line for line in robot.lines) == 1


def test_a_client_that_stays_is_told_and_may_open_a_new_robot_over_the_same_connection() -> None:
    with served(small_ground()) as robot:
        client = connected(robot)
        client.drive_until(lies)
        client.send(order(Code.ENABLE, 1), order(Code.VEL, 400))
        assert all(lies(client.sip()) for _ in range(10))
        client.send(order(Code.CLOSE, 1))
        client.connect()
        client.send(order(Code.ENABLE, 1), order(Code.VEL, -400))
        back = client.drive_until(lambda sip: sip.left_mmps < -300)
        assert back.motors_on and back.stalled == (False, False)
        client.close()


def test_where_no_robot_can_take_its_place_a_fall_ends_the_loop() -> None:
    with (
        pytest.raises(SimulationError, match="left the ground"),
        Pioneer(small_ground()) as body,
        ServedRobot(TcpLink(0), body, speed_up=3) as robot,
    ):
        client = connected(robot)
        while robot.thread.is_alive():
            client.send(arcos.SYNC0)
            robot.thread.join(0.1)


def test_nothing_but_a_new_connection_gets_a_fallen_robot_up() -> None:
    bench = Bench().connect()
    bench.run(0.5)
    bench.firmware.fall()
    for packet in (order(Code.ENABLE, 1), order(Code.ENABLE, 0), order(Code.E_STOP), order(Code.OPEN, 1)):
        bench.tell(packet)
        assert all(lies(sip) for sip in bench.run(1.5)) and bench.firmware.has_fallen


def test_the_new_robot_is_at_its_origin_and_hears_what_came_with_the_opening() -> None:
    bench = Bench().connect()
    bench.tell(order(Code.VEL, 200))
    assert bench.run(2.0)[-1].x_raw > 200
    bench.firmware.fall()
    bench.tell(order(Code.CLOSE, 1))
    bench.body = KinematicBody(time_s=bench.body.time_s)
    bench.connect()
    assert not bench.firmware.has_fallen
    bench.tell(order(Code.VEL, 200))
    sips = bench.run(1.5)
    assert sips[0].x_raw == pytest.approx(0, abs=2) and sips[0].motors_on and not sips[0].e_stopped
    assert sips[-1].left_mmps == 200
