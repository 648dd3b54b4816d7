"""An afternoon of repeated runs: ask, drive, ask where the robot truly is, keep; the robot moves on Enter alone."""

import math
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

import numpy as np

from stereogrid.errors import InvalidInputError
from stereogrid.geometry import yaw_rad
from stereogrid.motion import Run, Runs, append_readings, read_runs

from ..errors import RobotError
from ..pioneer.robot import RobotDriver, RobotReport
from .driving import Pressed, StoppedError, drive_leg, moved, newest
from .legs import Leg
from .measured import angle_rad, far_off, length_m
from .plan import Plan, Pose, next_name


class Person(Protocol):
    """Who stands beside the robot."""

    def tell(self, line: str) -> None:
        """Something to read."""

    def ask(self, question: str) -> str:
        """The answer. Raises EOFError when there will be no more."""

    def confirm(self, question: str) -> str:
        """The same, of an answer that was typed after the question alone."""

    def watching(self) -> AbstractContextManager[Pressed]:
        """Within it keys are no answers, but seen at once."""

    def progress(self, line: str) -> None:
        """Something to read that the next such line replaces."""


class LeftOutError(Exception):
    """The rest of this run is not wanted."""


class EndedError(Exception):
    """No more runs are wanted."""


@dataclass
class Session:
    """Runs of a plan, until enough are in the file at path. Raises InvalidInputError where it is no file of runs."""

    robot: RobotDriver
    person: Person
    plan: Plan
    path: Path
    held: list[Run] = field(init=False)

    def __post_init__(self) -> None:
        self.held = list(read_runs(self.path)) if self.path.exists() else []
        if any(not run.has_headings for run in self.held):
            raise InvalidInputError(
                f"{self.path}: has no headings, which these runs have; name another file with --out"
            )

    def run(self) -> None:
        """All that are left; returns too when the person wants no more."""
        self._say_left()
        try:
            while kind := self._next_kind():
                try:
                    self._one_run(kind)
                except (LeftOutError, RobotError) as error:
                    self.person.tell(f"  {error}\n  This run ends here; marks that were kept stay.")
                self._say_left()
        except (EndedError, EOFError):
            return

    def _next_kind(self) -> str:
        """The kind of which most are left; "" for none."""
        left = self.plan.left(self.held)
        kind = max(left, key=lambda kind: left[kind])
        return kind if left[kind] else ""

    def _say_left(self) -> None:
        left = self.plan.left(self.held)
        if any(left.values()):
            named = " and ".join(f"{count} {_runs(kind, count)}" for kind, count in left.items() if count)
            self.person.tell(f"\n{named} left{self._on()}; {self.path} holds {len(self.held)} so far.")

    def _on(self) -> str:
        return f" on {self.plan.surface}" if self.plan.surface else ""

    def _one_run(self, kind: str) -> None:
        done = self.plan.done(kind, self.held)
        legs, name = self.plan.legs(kind, done), next_name(self.held)
        start = self.plan.start(kind, done)
        self._introduce(name, legs, start)
        odo: list[Pose] = []
        true: list[Pose] = [start]
        for number, leg in enumerate(legs, start=1):
            self._wait_for_enter(leg)
            if not odo:
                first = newest(self.robot)
                odo.append(_pose(first))
            report = self._drive(leg)
            if report.odometry_lost != first.odometry_lost:
                raise StoppedError("the robot's odometry was lost since this run began")
            run = self._measure(name, odo, true, report, f"mark {number} of {len(legs)}")
            append_readings(self.path, run, 0 if number == 1 else number)
            self.held = list(read_runs(self.path))
            odo, true = ([tuple(row) for row in rows.tolist()] for rows in (run.odo, run.true))
            self.person.tell(f"  Kept in {self.path}.")

    def _introduce(self, name: str, legs: list[Leg], start: Pose) -> None:
        whole = Leg(legs[0].kind, math.fsum(leg.amount for leg in legs))
        self.person.tell(f"Run {name}{self._on()}: {whole.describe()}, {len(legs)} mark{'s' * (len(legs) > 1)}.")
        if start[2]:
            self.person.tell("  It goes back along the line: what a slope of the floor does is then no bias.")
        where = "the mark at the far end of the line, facing back" if start[2] else "its start mark, facing ahead"
        self.person.tell(f"  Put the robot on {where}, and step out of its way.")

    def _wait_for_enter(self, leg: Leg) -> None:
        while True:
            answer = (
                self.person.confirm(f"  Stand clear. Enter drives {leg.describe()}, any key then stops it; q ends: ")
                .strip()
                .lower()
            )
            if answer in ("q", "quit"):
                raise EndedError
            if not answer:
                return

    def _drive(self, leg: Leg) -> RobotReport:
        if self.robot.status().latched:
            self.robot.reset()
        with self.person.watching() as pressed:
            return drive_leg(self.robot, leg, pressed, lambda done: self.person.progress(f"  {leg.describe(done)}"))

    def _measure(self, name: str, odo: list[Pose], true: list[Pose], report: RobotReport, mark: str) -> Run:
        """The run up to this mark, as a person measured it; asked again until it can be true."""
        while True:
            seen = _from(odo[0], _pose(report))
            self.person.tell(
                f"  At {mark} odometry says {round(1000 * seen[0])} mm ahead, {_aside(round(1000 * seen[1]))} mm, "
                f"turned {_aside(round(math.degrees(seen[2]), 1))} degrees. Measure from the mark where this run began:"
            )
            pose = self._ask_pose()
            now = newest(self.robot)
            try:
                if moved(report, now):
                    raise InvalidInputError("the robot was moved meanwhile: measure again where it stands now")
                run = Run(
                    name,
                    np.array([*odo, _pose(report)]),
                    np.array([*true, _onto(true[0], pose)]),
                    surface=self.plan.surface,
                )
                Runs((run,))
            except InvalidInputError as error:
                self.person.tell(f"  {error}")
                report = now
                continue
            if not (doubt := far_off(pose, seen)) or self._sure(doubt):
                return run

    def _ask_pose(self) -> Pose:
        ahead_m = self._ask_value("ahead [mm, or name the unit: 2.01 m]", length_m)
        left_m = self._ask_value("to the left [mm; to the right is negative]", length_m)
        return ahead_m, left_m, self._ask_value("heading [degrees; to the left is positive]", angle_rad)

    def _ask_value(self, what: str, value: Callable[[str], float]) -> float:
        while True:
            answer = self.person.ask(f"    {what}: ").strip()
            if answer.lower() == "drop":
                raise LeftOutError("Dropped.")
            try:
                return value(answer)
            except InvalidInputError as error:
                self.person.tell(f'    {error}; "drop" leaves this mark out')

    def _sure(self, doubt: str) -> bool:
        answer = self.person.ask(f"  {doubt[0].upper()}{doubt[1:]}. Is what you typed right? y or n: ")
        return answer.strip().lower() in ("y", "yes")


def _runs(kind: str, count: int) -> str:
    return ("turn" if kind == "turn" else "straight run") + "s" * (count != 1)


def _aside(value: float) -> str:
    """To which side, and how much: without a sign, which people misread."""
    return f"to the {'right' if value < 0 else 'left'} by {abs(value):g}"


def _pose(report: RobotReport) -> Pose:
    T = report.odometry.T_odom_base
    return float(T[0, 3]), float(T[1, 3]), yaw_rad(T)


def _from(start: Pose, pose: Pose) -> Pose:
    """A pose as seen from another one."""
    dx, dy = pose[0] - start[0], pose[1] - start[1]
    c, s = math.cos(start[2]), math.sin(start[2])
    return c * dx + s * dy, c * dy - s * dx, math.remainder(pose[2] - start[2], 2 * math.pi)


def _onto(start: Pose, pose: Pose) -> Pose:
    """A pose that is seen from a start, where that start is known."""
    c, s = math.cos(start[2]), math.sin(start[2])
    return start[0] + c * pose[0] - s * pose[1], start[1] + s * pose[0] + c * pose[1], start[2] + pose[2]
