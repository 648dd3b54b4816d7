"""Odometry from raw counters: laws of unwrapping, of gaps and of stamps, and a robot of another program."""

import math
from collections.abc import Callable
from dataclasses import replace
from itertools import accumulate, pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from robot_reports import report, sip

from arcos import ROBOTS, PacketParser, Sip, robot_of
from arcos.sip import stall_bumpers
from hardware.pioneer import RobotReport
from hardware.pioneer.odometry import PLAY_RAW, Tracker
from hardware.pioneer.reports import Reports
from hardware.pioneer.stamps import LATE_S, SteadyStamps
from stereogrid.geometry import from_yaw, yaw_rad
from stereogrid.observation import Odometry

STEP = st.tuples(st.integers(-300, 300), st.integers(-300, 300), st.integers(-500, 500))


def tracked(poses: list[tuple[int, int, int]], bits: int, subclass: str = "p3at") -> list[RobotReport]:
    """Reports each .1 s of a robot whose counters have so many bits."""
    mask = (1 << bits) - 1
    tracker = Tracker(robot_of(subclass), 11.5)
    return [
        tracker.report(sip(x_raw=x & mask, y_raw=y & mask, heading_raw=(h + 2048) % 4096 - 2048), 0.1 * k)
        for k, (x, y, h) in enumerate(poses)
    ]


@given(
    st.tuples(st.integers(0, 70000), st.integers(0, 70000), st.integers(-2048, 2047)),
    st.lists(STEP, min_size=1, max_size=60),
    st.sampled_from([15, 16]),
    st.sampled_from(sorted(ROBOTS)),
)
def test_the_odometry_is_what_the_robot_went_since_its_first_report_whatever_wraps(
    start: tuple[int, int, int], steps: list[tuple[int, int, int]], bits: int, subclass: str
) -> None:
    poses = list(accumulate(steps, lambda a, b: (a[0] + b[0], a[1] + b[1], a[2] + b[2]), initial=start))
    last = tracked(poses, bits, subclass)[-1].odometry
    robot = robot_of(subclass)
    unit_m = 0.001 * robot.distance_mm
    gone = np.array(poses[-1]) - np.array(start)
    # As seen from where the robot stood at first.
    gone_m = from_yaw(-start[2] * robot.angle_rad, (0, 0, 0))[:2, :2] @ gone[:2] * unit_m
    assert last.T_odom_base[:2, 3] == pytest.approx(gone_m, abs=1e-9)
    assert math.remainder(yaw_rad(last.T_odom_base) - gone[2] * robot.angle_rad, math.tau) == pytest.approx(0, abs=1e-9)
    # The path is as long as its steps but for the play, and at least what lies between its ends.
    length = sum(math.hypot(dx, dy) for dx, dy, _ in steps) * unit_m
    assert last.travelled_m <= length + 1e-9
    assert last.travelled_m >= length - 2 * PLAY_RAW * len(steps) * unit_m - 1e-9
    assert last.travelled_m >= np.linalg.norm(gone[:2] * unit_m) - PLAY_RAW * unit_m - 1e-9
    turned = sum(abs(turn) for *_, turn in steps) * robot.angle_rad
    assert turned - 2 * PLAY_RAW * len(steps) * robot.angle_rad - 1e-9 <= last.turned_rad <= turned + 1e-9


@given(st.integers(-2048, 2047), st.integers(-2048, 2047), st.integers(-2048, 2047))
def test_a_robot_that_drives_ahead_goes_along_its_heading_from_the_first_report_on_and_after_a_new_connection(
    start: int, turned: int, again: int
) -> None:
    robot = robot_of("p3at-sh")
    tracker = Tracker(robot, 11.5)

    def ahead(heading: int, at_s: float) -> tuple[np.ndarray, np.ndarray]:
        """Where a metre ahead at this heading of the robot's own leads, from where."""
        x, y = (round(1000 * f(heading * robot.angle_rad)) for f in (math.cos, math.sin))
        before = tracker.report(sip(x_raw=20000, y_raw=20000, heading_raw=heading), at_s).odometry.T_odom_base
        after = tracker.report(sip(x_raw=20000 + x, y_raw=20000 + y, heading_raw=heading), at_s + 0.1)
        return before, after.odometry.T_odom_base

    before, after = ahead(start, 0.0)
    np.testing.assert_allclose(before, np.eye(4), atol=1e-12)
    np.testing.assert_allclose(after[:3, 3], [1, 0, 0], atol=1e-3)
    tracker.report(sip(x_raw=20000, y_raw=20000, heading_raw=turned), 0.2)
    for heading in (turned, again):
        before, after = ahead(heading, 0.3)
        np.testing.assert_allclose(after[:3, 3] - before[:3, 3], before[:3, 0], atol=1e-3)
        # A new connection, to counters that may begin anywhere: the pose is kept.
        tracker.reconnected()


def test_counters_that_jitter_at_rest_make_no_path() -> None:
    rng = np.random.default_rng(7)
    poses = [(int(x), 0, int(h)) for x, h in rng.integers(0, 2, (500, 2))]
    last = tracked(poses, 15)[-1].odometry
    assert (last.travelled_m, last.turned_rad) == (0.0, 0.0)


def test_a_gap_that_could_hide_a_turn_of_the_counter_is_counted_and_not_guessed() -> None:
    for subclass, fine_s, lost_s in (("p3at", 1.5, 1.6), ("p3at-sh", 3.3, 3.5)):
        for gap_s, lost in ((fine_s, 0), (lost_s, 1)):
            tracker = Tracker(robot_of(subclass), 11.5)
            tracker.report(sip(x_raw=100), 0.0)
            after = tracker.report(sip(x_raw=1100, heading_raw=50), gap_s)
            unit_m = 0.001 * robot_of(subclass).distance_mm
            assert after.odometry_lost == lost
            assert after.odometry.T_odom_base[0, 3] == pytest.approx(0.0 if lost else 1000 * unit_m)
            # The heading is never ambiguous by more than whole turns.
            assert yaw_rad(after.odometry.T_odom_base) == pytest.approx(50 * 0.001534)
            again = tracker.report(sip(x_raw=1200, heading_raw=50), gap_s + 0.1)
            assert again.odometry.T_odom_base[0, 3] == pytest.approx((100 if lost else 1100) * unit_m)


def test_a_new_connection_keeps_the_pose_and_says_that_it_may_be_wrong() -> None:
    tracker = Tracker(robot_of("p3at"), 11.5)
    tracker.report(sip(), 0.0)
    before = tracker.report(sip(x_raw=200), 0.1).odometry
    tracker.reconnected()
    after = tracker.report(sip(x_raw=3, heading_raw=700), 0.2)
    assert after.odometry_lost == 1
    assert np.array_equal(after.odometry.T_odom_base, before.T_odom_base)
    assert after.odometry.travelled_m == before.travelled_m


def test_reports_are_in_metres_radians_and_volts_and_name_their_fault() -> None:
    tracker = Tracker(robot_of("p3at"), 11.5)
    one = tracker.report(sip(left_mmps=100, right_mmps=200, battery_dv=114, flags=0), 5.0)
    assert (one.stamp_s, one.speed_mps, one.motors_on) == (5.0, pytest.approx(0.15), False)
    assert one.turn_radps == pytest.approx(50 * 0.0034)
    assert (one.battery_v, one.fault) == (pytest.approx(11.4), "battery 11.4 V")
    bits = {
        "front bumper 1, 5": stall_bumpers(stalled=(True, True), front=0b10001, rear=0),
        "rear bumper 3": stall_bumpers(stalled=(False, False), front=0, rear=0b100),
        "right wheel stalls": stall_bumpers(stalled=(False, True), front=0, rear=0),
        "left wheel stalls": stall_bumpers(stalled=(True, False), front=0, rear=0),
        "both wheels stall": stall_bumpers(stalled=(True, True), front=0, rear=0),
        "": 0,
    }
    assert [tracker.report(sip(stall_bumpers=each), 6.0).fault for each in bits.values()] == list(bits)
    assert tracker.report(sip(flags=0b100001), 6.0).fault == "e-stop"


def moving_reports() -> list[RobotReport]:
    return [
        report(stamp_s=k * 0.1, odometry=Odometry(from_yaw(3.0 + 0.2 * k, [0.1 * k, -0.05 * k, 0.0]), 0.2 * k, 0.3 * k))
        for k in range(5)
    ]


@given(st.floats(0.0, 0.4))
def test_the_odometry_between_reports_is_that_of_even_motion(stamp_s: float) -> None:
    reports = Reports()
    for each in moving_reports():
        reports.put(each)
    found = reports.odometry_at(stamp_s)
    assert found is not None
    k = stamp_s / 0.1
    expected = from_yaw(3.0 + 0.2 * k, [0.1 * k, -0.05 * k, 0.0])
    assert found.T_odom_base == pytest.approx(expected, abs=1e-9)
    assert (found.travelled_m, found.turned_rad) == (pytest.approx(0.2 * k), pytest.approx(0.3 * k))


def test_the_odometry_is_not_known_before_after_or_in_a_gap() -> None:
    reports = Reports()
    assert reports.odometry_at(0.0) is None
    kept = moving_reports()
    for each in (*kept, replace(kept[-1], stamp_s=0.5, odometry_lost=1), replace(kept[-1], stamp_s=1.2)):
        reports.put(each)
    assert [reports.odometry_at(s) is None for s in (-0.01, 0.39, 0.45, 0.8, 1.21)] == [True, False, True, True, True]


@given(st.lists(st.floats(0.0, LATE_S), min_size=2, max_size=80), st.floats(0.08, 0.12))
def test_stamps_rise_and_are_never_late_and_never_early_by_more_than_their_bound(
    delays_s: list[float], period_s: float
) -> None:
    stamps = SteadyStamps()
    arrived_s = list(accumulate((k * period_s + late for k, late in enumerate(delays_s)), max))
    stamped = [stamps.steady(each) for each in arrived_s]
    assert all(a < b for a, b in pairwise(stamped))
    assert all(-1e-4 <= a - s <= LATE_S + 1e-9 for a, s in zip(arrived_s, stamped, strict=True))


def test_stamps_are_steadier_than_the_arrivals_and_follow_the_robots_own_period() -> None:
    rng = np.random.default_rng(3)
    for period_s in (0.1, 0.107):
        true_s = period_s * np.arange(300)
        arrived_s = true_s + rng.choice([0.0, 0.0, 0.01, 0.02], 300)
        stamps = SteadyStamps()
        error_s = np.array([stamps.steady(each) for each in arrived_s]) - true_s
        assert error_s[50:].std() < 0.6 * (arrived_s - true_s)[50:].std()
        assert abs(error_s[50:].mean()) < 0.01


def test_after_a_pause_stamps_start_again() -> None:
    stamps = SteadyStamps()
    for arrived_s in (0.0, 0.1, 0.2):
        stamps.steady(arrived_s)
    assert stamps.steady(3.0) == 3.0


def test_another_programs_robot_is_followed_to_where_it_says_it_went(real_data: Callable[[str], Path]) -> None:
    stream = (real_data("arcos") / "ariacoda_simpleMotion_vs_AMRISim.r2c.bin").read_bytes()
    tracker = Tracker(robot_of("p3at-sh"), 11.5)
    sips = [Sip.decode(body) for body in PacketParser().feed(stream) if Sip.is_sip(body)]
    reports = [tracker.report(each, 0.1 * k) for k, each in enumerate(sips)]
    last = reports[-1].odometry
    # .326 m until it stood against a wall, which its bits tell; then turns to +534 and to -534 of 4096.
    assert last.T_odom_base[:2, 3] == pytest.approx([0.326, 0.0], abs=0.002)
    assert last.travelled_m == pytest.approx(0.326, abs=0.003)
    most = max(each.heading_raw for each in sips)
    assert yaw_rad(last.T_odom_base) == pytest.approx(sips[-1].heading_raw * 0.001534)
    assert last.turned_rad == pytest.approx((2 * most - sips[-1].heading_raw) * 0.001534, abs=0.02)
    assert {each.fault for each in reports} == {"", "both wheels stall"} and reports[-1].odometry_lost == 0
    assert max(each.speed_mps for each in reports) == pytest.approx(0.25, abs=0.01)
    assert reports[0].battery_v == 13.0 and len(reports[0].sonar_m) == 16
    # Where they say how fast they turn, so do we.
    turning = [(each.turn_radps, s.turn_ddegps) for each, s in zip(reports, sips, strict=True)]
    assert all(ours == pytest.approx(math.radians(0.1 * (theirs or 0)), abs=0.01) for ours, theirs in turning)
