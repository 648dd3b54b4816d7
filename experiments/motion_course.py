"""The simulated robot's marked lines and turns, and what a robot with faults, or with known noise, says of them."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import cycle, islice

import numpy as np

from sim.robot.pioneer import TICK_S, Pioneer
from sim.robot.turning import rough
from sim.robot.wheel_faults import WheelFaults
from stereogrid.geometry import FloatArray, from_yaw, inverse, yaw_rad
from stereogrid.motion import MotionError, MotionNoise, Run

SPEED_MPS, TURN_RADPS, RAMP_S = 0.25, 0.4, 1.0
MARKS_M = (1.0, 2.0, 3.0, 4.0, 5.0)
MARKS_RAD = tuple(np.radians([90.0, 180.0, 270.0, 360.0]))
STEP = 0.1
"""Known noise is added in steps of so many metres or radians: its growth does not depend on them."""
WAYS = {"forth": (1, 0), "back": (-1, 0), "left": (0, 1), "right": (0, -1)}
"""Signs of speed and turn."""
LONGEST_S = 120.0
BUMPS_M = 0.01
"""The standard deviation of the height of uneven ground, over some decimetres."""


@dataclass(frozen=True, eq=False)
class Course:
    """One manoeuvre as it truly was, tick by tick: it is the same each time, and errors are drawn upon it.

    true (K, 3): x, y [m], heading [rad]; wheels_rad (K, 2); reached (K,): how far [m or rad]; marks: ticks of the start
    and of the marks.
    """

    surface: str
    way: str
    true: FloatArray
    wheels_rad: FloatArray
    reached: FloatArray
    marks: tuple[int, ...]

    @property
    def turns(self) -> bool:
        """Whether it is a turn on the spot."""
        return WAYS[self.way][1] != 0

    def run(self, name: str, odo: FloatArray) -> Run:
        """A run over the course; odo (1 + marks, 3)."""
        return Run(name, odo, self.true[list(self.marks)], surface=self.surface)

    def faulty(self, name: str, faults: WheelFaults, rng: np.random.Generator) -> Run:
        """As a robot with these faults would tell it."""
        return self.run(name, faults.believed(self.wheels_rad, rng)[list(self.marks), :3])

    def noisy(self, name: str, error: MotionError, rng: np.random.Generator) -> Run:
        """As odometry would tell it that is true but for noise of known growth."""
        even = np.searchsorted(self.reached, np.arange(0.0, self.reached[self.marks[-1]], STEP))
        poses = [from_yaw(heading, (x, y, 0.0)) for x, y, heading in self.true]
        walk, odo, before = MotionNoise(error).walk(poses[0], rng), [self.true[0]], 0
        for tick in sorted({*even.tolist(), *self.marks} - {0}):
            T = walk(inverse(poses[before]) @ poses[tick])
            before = tick
            if tick in self.marks:
                odo.append(np.array([T[0, 3], T[1, 3], yaw_rad(T)]))
        return self.run(name, np.array(odo))


def drive(surface: str, way: str, bumps: int | None = None) -> Course:
    """Drive a way past its last mark, on flat ground or over bumps that are drawn by that seed."""
    ahead, turn = WAYS[way]
    world = None if bumps is None else rough(bumps, BUMPS_M)
    ends = MARKS_RAD if turn else MARKS_M
    poses, wheels, heading_rad = [], [], 0.0
    with Pioneer(world, surface=surface) as robot:
        T_start = T_before = robot.T_world_base
        while True:
            heading_rad += yaw_rad(inverse(T_before) @ robot.T_world_base)
            T_before = robot.T_world_base
            x_m, y_m, _ = (inverse(T_start) @ T_before)[:3, 3]
            poses.append((x_m, y_m, heading_rad))
            wheels.append(robot.encoders_rad())
            if (abs(heading_rad) if turn else np.hypot(x_m, y_m)) >= ends[-1] or robot.time_s > LONGEST_S:
                break
            share = min(robot.time_s / RAMP_S + TICK_S, 1.0)
            robot.drive(share * ahead * SPEED_MPS, share * turn * TURN_RADPS)
    true = np.array(poses)
    reached = np.abs(true[:, 2]) if turn else np.hypot(true[:, 0], true[:, 1])
    marks = (0, *np.searchsorted(np.maximum.accumulate(reached), ends).tolist())
    name = surface if bumps is None else bumpy(surface)
    return Course(name, way, true, np.array(wheels), np.maximum.accumulate(reached), marks)


def bumpy(surface: str) -> str:
    """What a surface with bumps is called."""
    return f"{surface}, bumpy"


def drawn_faults(faults: WheelFaults, rng: np.random.Generator) -> WheelFaults:
    """The faults of one run: its radii and track err anew by the amounts of faults, the rest is drawn on the way."""
    left, right, track = rng.standard_normal(3) * [faults.left_radius, faults.right_radius, faults.track]
    return replace(faults, left_radius=left, right_radius=right, track=track)


def in_turn(courses: Sequence[Course], count: int) -> Iterator[tuple[str, Course]]:
    """count straight runs and count turns, with their names: the courses of each kind by turns."""
    for turns in (False, True):
        kind = cycle([course for course in courses if course.turns == turns])
        for number, course in enumerate(islice(kind, count), start=1):
            yield f"{course.way}-{number}", course


def faulty_runs(courses: Sequence[Course], faults: WheelFaults, count: int, rng: np.random.Generator) -> list[Run]:
    """count straight runs and count turns by a robot whose faults are drawn for each."""
    return [course.faulty(name, drawn_faults(faults, rng), rng) for name, course in in_turn(courses, count)]


def noisy_runs(courses: Sequence[Course], error: MotionError, count: int, rng: np.random.Generator) -> list[Run]:
    """count straight runs and count turns with odometry that errs as error says."""
    return [course.noisy(name, error, rng) for name, course in in_turn(courses, count)]
