"""The safety core, in time that the tests make: whatever is asked of it and happens to it, the robot is safe."""

import math
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from robot_reports import report

import arcos
from arcos import Code, Command
from hardware.errors import RobotError
from hardware.pioneer import Limits
from hardware.pioneer.safety import Phase, Safety
from stereogrid.errors import InvalidInputError

TICK_S = 0.02
REPORT_S = 0.1
LIMITS = Limits()


@dataclass
class Bench:
    """A Safety, its time, and all that it said. robot: what its next reports say; None: none come."""

    safety: Safety = field(default_factory=Safety)
    now_s: float = 100.0
    said: list[tuple[float, Command]] = field(default_factory=list)
    robot: dict[str, Any] | None = field(default_factory=dict)
    obeys: bool = True
    _report_s: float = 100.0

    def run(self, duration_s: float, *, ask: tuple[float, float] | None = None) -> list[tuple[int, Any]]:
        """Let time pass, asking for a velocity in each tick if told to; what was said meanwhile."""
        first = len(self.said)
        for _ in range(round(duration_s / TICK_S)):
            self.now_s += TICK_S
            if ask is not None:
                self.safety.drive(*ask, self.now_s, self.now_s)
            if self.robot is not None and self.now_s >= self._report_s:
                self._report_s = self.now_s + REPORT_S
                self.safety.hear(report(stamp_s=self.now_s, **self.robot), self.now_s)
            for command in self.safety.tick(self.now_s):
                self.said.append((self.now_s, command))
                if command.code == Code.ENABLE and self.obeys and self.robot is not None:
                    self.robot = {**self.robot, "motors_on": command.argument == 1, "e_stopped": False}
        return [(command.code, command.argument) for _, command in self.said[first:]]

    def open(self) -> "Bench":
        self.robot = {"motors_on": False}
        self.safety.opened(LIMITS, self.now_s)
        self.run(0.3)
        return self

    def arm(self) -> "Bench":
        self.safety.arm(self.now_s, 2.0)
        self.run(0.5)
        assert self.safety.phase is Phase.ARMED
        return self

    def velocities(self, since_s: float = 0.0) -> list[tuple[float, int, Any]]:
        return [(s, c.code, c.argument) for s, c in self.said if c.code in (Code.VEL, Code.RVEL) and s > since_s]


def armed() -> Bench:
    return Bench().open().arm()


ACTIONS = st.one_of(
    st.tuples(st.just("run"), st.floats(0.02, 1.2)),
    st.tuples(st.just("drive"), st.tuples(*[st.one_of(st.floats(), st.floats(-2, 2))] * 2)),
    st.tuples(st.sampled_from(["arm", "disarm", "stop", "e_stop", "reset", "lost", "open", "mute", "heal"]), st.none()),
    st.tuples(
        st.just("robot"),
        st.sampled_from(
            [
                {"stalled": (True, False)},
                {"front_bumpers": 4},
                {"rear_bumpers": 1},
                {"e_stopped": True},
                {"battery_v": 10.9},
                {"motors_on": False},
                {"speed_mps": 0.3},
            ]
        ),
    ),
)


def do(bench: Bench, action: str, argument: Any) -> None:
    safety, now_s = bench.safety, bench.now_s
    if action == "run":
        bench.run(argument)
    elif action == "drive":
        safety.drive(*argument, now_s, now_s)
    elif action == "arm":
        safety.arm(now_s, 1.0)
    elif action == "disarm":
        safety.disarm(now_s)
    elif action == "stop":
        safety.halt()
    elif action == "e_stop":
        safety.e_stop("test", now_s)
    elif action == "reset":
        safety.reset(now_s)
    elif action == "lost":
        safety.lost()
    elif action == "open":
        safety.opened(LIMITS, now_s)
    elif action == "mute":
        bench.robot = None
    elif action == "heal":
        bench.robot = {}
    else:
        bench.robot = {**(bench.robot or {}), **argument}


@given(st.lists(ACTIONS, min_size=4, max_size=40))
def test_whatever_happens_the_robot_moves_only_when_armed_fresh_heard_and_within_its_limits(
    actions: list[tuple[str, Any]],
) -> None:
    bench = Bench().open()
    for action, argument in [("arm", None), ("run", 0.5), *actions, ("run", 0.1)]:
        before, since_s = bench.safety.phase, bench.now_s
        try:
            do(bench, action, argument)
        except (RobotError, InvalidInputError):
            assert action in ("drive", "arm", "reset")
        moved = [(s, code, value) for s, code, value in bench.velocities(since_s) if value]
        limit = {Code.VEL: 300, Code.RVEL: 30}
        assert all(abs(value) <= limit[Code(code)] for _, code, value in moved)
        if moved:
            # Only a phase that was armed as it began can have moved, and no command outlives its half second.
            assert before is Phase.ARMED and action == "run"
            assert moved[-1][0] - since_s <= 0.5 + 2 * TICK_S
        latched = bench.safety.latched
        assert not (latched and bench.safety.phase in (Phase.ARMED, Phase.ARMING))
    if bench.safety.phase is Phase.AWAY:
        assert bench.safety.tick(bench.now_s) == []


@given(st.floats(-5, 5), st.floats(-5, 5))
def test_a_velocity_is_clamped_and_rounded_towards_no_more(speed_mps: float, turn_radps: float) -> None:
    bench = armed()
    said = bench.run(0.2, ask=(speed_mps, turn_radps))
    speed, turn = dict(said)[Code.VEL], dict(said)[Code.RVEL]
    assert speed == round(1000 * max(-0.3, min(speed_mps, 0.3)))
    assert turn == round(max(-30, min(math.degrees(turn_radps), 30)))


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_a_velocity_that_is_no_number_is_refused_and_the_last_one_not_kept_alive(bad: float) -> None:
    bench = armed()
    bench.run(0.2, ask=(0.2, 0.0))
    for velocity in ((bad, 0.0), (0.0, bad)):
        with pytest.raises(InvalidInputError, match="must be finite"):
            bench.safety.drive(*velocity, bench.now_s, bench.now_s)
    assert dict(bench.run(0.7))[Code.VEL] == 0


def test_nothing_moves_before_it_is_armed() -> None:
    bench = Bench().open()
    with pytest.raises(RobotError, match="not armed"):
        bench.safety.drive(0.1, 0.0, bench.now_s, bench.now_s)
    assert {code for code, _ in bench.run(1.0)} == {Code.PULSE}


def test_a_command_holds_for_half_a_second_and_no_longer() -> None:
    bench = armed()
    bench.run(0.1, ask=(0.2, 0.1))
    asked_s = bench.now_s
    bench.run(1.0)
    after = bench.velocities(asked_s)
    assert all(value != 0 for s, _, value in after if s < asked_s + 0.5 - TICK_S)
    zeros = [s for s, code, value in after if value == 0]
    assert asked_s + 0.5 < zeros[0] <= asked_s + 0.5 + 2 * TICK_S
    assert all(value == 0 for s, _, value in after if s >= zeros[0])
    assert bench.safety.stale_commands == 1 and bench.safety.phase is Phase.ARMED


def test_a_command_that_was_long_on_its_way_is_as_old_as_when_it_was_asked() -> None:
    bench = armed()
    bench.safety.drive(0.2, 0.0, bench.now_s - 0.6, bench.now_s)
    assert all(value == 0 for code, value in bench.run(0.2) if code in (Code.VEL, Code.RVEL))


def test_a_pulse_is_sent_at_least_each_half_second_whatever_the_phase() -> None:
    bench = Bench().open()
    bench.run(1.0)
    bench.arm().run(1.0, ask=(0.2, 0.0))
    bench.safety.e_stop("test", bench.now_s)
    bench.run(1.0)
    pulses = [s for s, command in bench.said if command.code == Code.PULSE]
    assert max(b - a for a, b in pairwise(pulses)) < 0.3
    assert bench.now_s - pulses[-1] < 0.3


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"stalled": (True, False), "fault": "left wheel stalls"}, "left wheel stalls"),
        ({"front_bumpers": 4, "fault": "front bumper 3"}, "front bumper 3"),
        ({"rear_bumpers": 1, "fault": "rear bumper 1"}, "rear bumper 1"),
        ({"e_stopped": True, "fault": "e-stop"}, "e-stop"),
        ({"motors_on": False}, "the robot switched its motors off"),
    ],
)
def test_a_fault_stops_latches_and_switches_off(change: dict[str, Any], reason: str) -> None:
    bench = armed()
    bench.run(0.2, ask=(0.2, 0.1))
    bench.robot = {**(bench.robot or {}), **change}
    bench.obeys = False
    said = bench.run(0.12)
    assert said[-3:] == [(Code.STOP, None), (Code.VEL, 0), (Code.RVEL, 0)] and bench.safety.latched == reason
    assert (Code.ENABLE, 0) in bench.run(1.0)
    with pytest.raises(RobotError, match=reason):
        bench.safety.drive(0.1, 0.0, bench.now_s, bench.now_s)
    with pytest.raises(RobotError, match=f"{reason}.*reset it first"):
        bench.safety.arm(bench.now_s, 1.0)
    bench.robot, bench.obeys = {}, True
    bench.run(0.2)
    assert bench.safety.latched == reason
    bench.safety.reset(bench.now_s)
    assert bench.safety.phase is Phase.IDLE
    bench.arm()


def test_what_is_still_pressed_cannot_be_reset() -> None:
    bench = armed()
    bench.robot = {"front_bumpers": 1, "fault": "front bumper 1"}
    bench.run(0.3)
    with pytest.raises(RobotError, match="cannot be reset: front bumper 1"):
        bench.safety.reset(bench.now_s)
    assert bench.safety.latched == "front bumper 1"


def test_an_e_stop_is_said_until_it_is_reset_even_over_a_new_connection() -> None:
    bench = armed()
    bench.run(0.2, ask=(0.2, 0.0))
    bench.safety.e_stop("a test", bench.now_s)
    assert bench.run(TICK_S)[:3] == [(Code.E_STOP, None), (Code.STOP, None), (Code.VEL, 0)]
    assert sum(code == Code.E_STOP for code, _ in bench.run(1.0)) >= 8
    bench.safety.lost()
    bench.safety.opened(LIMITS, bench.now_s)
    assert sum(code == Code.E_STOP for code, _ in bench.run(1.0)) >= 8
    assert bench.safety.latched == "e-stop (a test)"
    bench.safety.reset(bench.now_s)
    assert all(code != Code.E_STOP for code, _ in bench.run(1.0))
    bench.arm()


def test_a_silent_robot_is_stopped_and_takes_no_command_until_it_reports() -> None:
    bench = armed()
    bench.run(0.2, ask=(0.2, 0.0))
    bench.robot = None
    silent_s = bench.now_s
    for _ in range(40):
        if bench.safety.is_silent(bench.now_s + TICK_S):
            break
        bench.run(TICK_S, ask=(0.2, 0.0))
    said = bench.run(0.2)
    assert bench.now_s - silent_s < 0.8
    assert said[:3] == [(Code.STOP, None), (Code.VEL, 0), (Code.RVEL, 0)]
    with pytest.raises(RobotError, match="no report came from it"):
        bench.safety.drive(0.2, 0.0, bench.now_s, bench.now_s)
    bench.robot = {}
    bench.run(0.2)
    assert dict(bench.run(0.2, ask=(0.2, 0.0)))[Code.VEL] == 200


def test_nothing_survives_a_lost_connection_but_the_latch() -> None:
    bench = armed()
    bench.run(0.2, ask=(0.2, 0.0))
    bench.safety.lost()
    assert bench.run(1.0) == []
    bench.safety.opened(LIMITS, bench.now_s)
    assert bench.safety.phase is Phase.IDLE
    assert all(code in (Code.PULSE, Code.ENABLE) and argument != 1 for code, argument in bench.run(1.0))


def test_arming_needs_the_robots_word() -> None:
    bench = Bench().open()
    bench.obeys = False
    bench.safety.arm(bench.now_s, 1.0)
    said = bench.run(0.9)
    assert said.count((Code.ENABLE, 1)) >= 5 and bench.safety.phase is Phase.ARMING
    assert (Code.SETA, 300) in said and (Code.SETA, -1000) in said and (Code.SETRA, 100) in said
    bench.run(0.6)
    assert bench.safety.phase is Phase.IDLE and "motors are on" in bench.safety.refused


def test_a_low_battery_does_not_arm_and_a_sag_does_not_stop_but_an_empty_one_does() -> None:
    bench = Bench().open()
    bench.robot = {"motors_on": False, "battery_v": 11.4, "fault": "battery 11.4 V"}
    bench.run(0.2)
    with pytest.raises(RobotError, match=r"battery 11\.4 V, below 11\.5 V"):
        bench.safety.arm(bench.now_s, 1.0)
    bench = armed()
    for low_v, lasts_s in ((11.0, 1.0), (12.0, 0.3), (11.2, 1.8)):
        bench.robot = {"battery_v": low_v, "fault": f"battery {low_v} V" if low_v < 11.5 else ""}
        bench.run(lasts_s, ask=(0.2, 0.0))
    assert bench.safety.phase is Phase.ARMED
    bench.run(0.4)
    assert bench.safety.latched == "battery 11.2 V"
    with pytest.raises(RobotError, match=r"battery 11\.2 V"):
        bench.safety.reset(bench.now_s)


def test_the_motors_go_off_when_the_robot_rests_or_does_not_come_to_rest() -> None:
    for speed_mps, least_s, most_s in ((0.0, 0.1, 0.4), (0.2, 1.4, 1.7)):
        bench = armed()
        bench.robot = {"speed_mps": speed_mps}
        bench.safety.disarm(bench.now_s)
        since_s = bench.now_s
        bench.run(2.0)
        off_s = next(s for s, c in bench.said if (c.code, c.argument) == (Code.ENABLE, 0) and s > since_s)
        assert least_s <= off_s - since_s <= most_s
        assert not any(value for _, _, value in bench.velocities(since_s))


def test_a_first_word_after_a_pause_of_the_driver_is_a_stop() -> None:
    bench = armed()
    bench.run(0.2, ask=(0.2, 0.0))
    paused_s = bench.now_s
    bench.now_s += 5.0
    assert bench.safety.tick(bench.now_s)[:2] == [Command(Code.STOP), Command(Code.VEL, 0)]
    assert not any(value for _, _, value in bench.velocities(paused_s))


def test_limits_are_never_above_the_robots_own() -> None:
    wide = Limits(speed_mps=9.0, turn_radps=99.0, acceleration_mps2=9.0, deceleration_mps2=9.0)
    robot = arcos.robot_of("p3at")
    assert wide.within(robot, None).speed_mps == pytest.approx(1.2)
    slow = arcos.ConfigReply(top_speed_mmps=700, top_acceleration_mmps2=1500, top_turn_degps=0)
    own = wide.within(robot, slow)
    assert (own.speed_mps, own.acceleration_mps2) == (pytest.approx(0.7), pytest.approx(1.5))
    assert own.turn_radps == pytest.approx(math.radians(300))
    assert LIMITS.within(robot, slow).speed_mps == 0.3


@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf])
def test_limits_that_limit_nothing_are_refused(value: float) -> None:
    with pytest.raises(InvalidInputError, match="speed_mps must be finite and > 0"):
        Limits(speed_mps=value)
