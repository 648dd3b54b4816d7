"""A robot that does what it is told, late and in whole degrees, ends where its leg ends."""

import math

import numpy as np
import pytest

from hardware.motion_runs.driving import STEP_S
from hardware.motion_runs.legs import DRIVING, TURNING, Leg, Pace, Steering
from stereogrid.errors import InvalidInputError
from stereogrid.geometry import from_yaw, yaw_rad

REPORTED_EVERY = 2
"""A report every second step, and commands that take a step to arrive: 100 and 50 ms."""


def drive(leg, *, veers_radps=0.0, start=None):
    """Poses (steps, 4, 4) and velocities (steps, 2) of a robot that is led through a leg."""
    pose = np.eye(4) if start is None else start
    steering, seen, asked = Steering(leg, pose), pose, (0.0, 0.0)
    poses, velocities = [pose], []
    for step in range(2000):
        if step % REPORTED_EVERY == 0:
            seen = pose
        speed, turn = asked[0], math.radians(round(math.degrees(asked[1]))) + veers_radps
        pose = pose @ from_yaw(turn * STEP_S, [speed * STEP_S, 0, 0])
        poses.append(pose)
        velocity = steering.velocity(seen, STEP_S)
        if velocity is None:
            return np.array(poses), np.array(velocities)
        asked = velocity
        velocities.append(velocity)
    raise AssertionError("it never got there")


@pytest.mark.parametrize("distance_m", [0.5, 2.0, 5.0])
def test_a_straight_leg_ends_within_two_centimetres_and_never_stops_short(distance_m):
    poses, velocities = drive(Leg("straight", distance_m), start=from_yaw(2.0, [3.0, -1.0, 0]))
    gone_m = np.linalg.norm(poses[-1][:3, 3] - poses[0][:3, 3])
    assert 0 <= gone_m - distance_m < 0.02
    assert velocities[:, 0].max() <= DRIVING.fastest
    assert np.diff(velocities[:, 0]).max() <= DRIVING.change * STEP_S + DRIVING.slowest


def test_a_robot_that_veers_is_held_on_its_heading():
    veering, _ = drive(Leg("straight", 5.0), veers_radps=math.radians(1.5))
    assert max(abs(yaw_rad(pose)) for pose in veering) < math.radians(2.5)
    # Left alone it would have turned by some 30 degrees.
    assert abs(veering[-1][1, 3]) < 0.25


@pytest.mark.parametrize("turn_deg", [90, -90, 150, -150, 350])
def test_a_turn_ends_within_two_degrees_on_the_right_side(turn_deg):
    poses, velocities = drive(Leg("turn", math.radians(turn_deg), TURNING), start=from_yaw(3.0))
    turned = np.unwrap([yaw_rad(pose) for pose in poses])
    over = math.degrees(turned[-1] - turned[0]) - turn_deg
    assert 0 <= over * np.sign(turn_deg) < 2
    assert not velocities[:, 0].any()
    assert abs(velocities[:, 1]).max() <= TURNING.fastest


def test_it_slows_down_before_the_end():
    _, velocities = drive(Leg("straight", 2.0))
    assert velocities[len(velocities) // 2, 0] == pytest.approx(DRIVING.fastest)
    assert velocities[-1, 0] < 0.2 * DRIVING.fastest


@pytest.mark.parametrize(("kind", "amount"), [("straight", -1.0), ("straight", 0.0), ("turn", math.nan), ("arc", 1.0)])
def test_a_leg_that_is_none_is_refused(kind, amount):
    with pytest.raises(InvalidInputError, match="a leg"):
        Leg(kind, amount)


@pytest.mark.parametrize("pace", [(0.2, 0.3, 1.0), (0.2, 0.0, 1.0), (0.2, 0.1, 0.0), (math.inf, 0.1, 1.0)])
def test_a_pace_that_is_none_is_refused(pace):
    with pytest.raises(InvalidInputError, match="a pace needs"):
        Pace(*pace)
