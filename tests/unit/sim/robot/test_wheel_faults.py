"""Each cause of odometry error does what the geometry says, alone, and nothing else."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from sim.robot.odometry import EFFECTIVE_TRACK_M, WHEEL_RADIUS_M, WheelOdometry
from sim.robot.wheel_faults import WHEEL_FAULTS, FaultyWheels, WheelFaults, wheel_faults
from stereogrid.camera import StereoCamera
from stereogrid.errors import InvalidInputError, RecordingError
from stereogrid.geometry import FloatArray, yaw_rad
from stereogrid.observation import Observation, Odometry, Recording, Truth
from stereogrid.recording import Ticks, poses, stamps_s

TICK_S = 1 / 30
GREY = np.full((12, 16), 128, np.uint8)


class Wheels:
    """A recording of a robot whose wheels turned so far (K, 2) [rad]; a pair at every tenth tick."""

    camera = StereoCamera(20.0, 7.5, 5.5, 0.06, 16, 12)
    T_base_cam = np.eye(4)
    metadata = {"world": "none"}  # noqa: RUF012

    def __init__(self, wheels_rad: FloatArray) -> None:
        count = len(wheels_rad)
        self._ticks = Ticks(np.arange(count) * TICK_S, np.tile(np.eye(4), (count, 1, 1)), wheels_rad)

    def ticks(self) -> Ticks | None:
        return self._ticks

    def __len__(self) -> int:
        return len(range(0, len(self._ticks), 10))

    def __iter__(self) -> Iterator[Observation]:
        belief = WheelOdometry()
        for k, turned in enumerate(np.diff(self._ticks.wheels_rad, axis=0, prepend=self._ticks.wheels_rad[:1])):
            belief.update(*turned)
            if k % 10 == 0:
                # A file keeps whole nanoseconds.
                stamp_s = round(k * TICK_S, 9)
                reading = belief.reading()
                yield Observation(stamp_s, GREY, GREY, reading, reading.T_odom_base, Truth(np.eye(4)))


def straight(length_m: float, count: int = 601) -> Wheels:
    return Wheels(np.outer(np.linspace(0, length_m / WHEEL_RADIUS_M, count), [1.0, 1.0]))


def wiggly(count: int = 601) -> Wheels:
    rng = np.random.default_rng(3)
    return Wheels(np.cumsum(0.1 + 0.05 * rng.standard_normal((count, 2)), axis=0))


def last(recording: Wheels, faults: WheelFaults, seed: int = 0) -> Odometry:
    return list(FaultyWheels(recording, faults, seed))[-1].odometry


def believed(recording: Wheels, faults: WheelFaults, seed: int) -> FloatArray:
    """The last row of what is believed: x, y, heading, length of the way and of the turns."""
    row: FloatArray = faults.believed(recording._ticks.wheels_rad, np.random.default_rng(seed))[-1]
    return row


def test_without_faults_the_odometry_is_as_recorded() -> None:
    recording = wiggly()
    faulty = FaultyWheels(recording, WHEEL_FAULTS["none"], seed=1)
    assert isinstance(faulty, Recording) and len(faulty) == len(recording) == 61
    for before, after in zip(recording, faulty, strict=True):
        assert after.odometry.T_odom_base == pytest.approx(before.odometry.T_odom_base, abs=1e-9)
        assert after.odometry.travelled_m == pytest.approx(before.odometry.travelled_m, abs=1e-9)
        assert after.odometry.turned_rad == pytest.approx(before.odometry.turned_rad, abs=1e-9)


def test_images_truth_stamps_and_ticks_pass_untouched_and_the_claim_follows_the_odometry() -> None:
    recording = wiggly()
    faulty = FaultyWheels(recording, WHEEL_FAULTS["worn"], seed=1)
    assert faulty.ticks() is recording.ticks() and faulty.metadata == recording.metadata
    for before, after in zip(recording, faulty, strict=True):
        assert after.left is before.left and after.right is before.right and after.stamp_s == before.stamp_s
        assert after.truth is not None and after.truth.T_world_cam.tolist() == np.eye(4).tolist()
        assert after.T_world_cam.tolist() == after.odometry.T_odom_base.tolist()


@pytest.mark.parametrize("share", [-0.02, 0.01])
def test_wheels_believed_too_large_lengthen_a_straight_by_that_share(share: float) -> None:
    reading = last(straight(10.0), WheelFaults(left_radius=share, right_radius=share))
    assert reading.T_odom_base[:2, 3] == pytest.approx([10.0 * (1 + share), 0.0])
    assert reading.travelled_m == pytest.approx(10.0 * (1 + share))


@pytest.mark.parametrize("share", [-0.004, 0.01])
def test_unequal_wheels_bend_a_straight_into_the_arc_of_their_difference(share: float) -> None:
    T = last(straight(10.0), WheelFaults(right_radius=share)).T_odom_base
    turn = 10.0 * share / EFFECTIVE_TRACK_M
    radius_m = 10.0 * (1 + share / 2) / turn
    assert yaw_rad(T) == pytest.approx(turn)
    assert T[:2, 3] == pytest.approx([radius_m * np.sin(turn), radius_m * (1 - np.cos(turn))])


def test_a_track_believed_too_wide_shortens_the_turns_and_leaves_straights_alone() -> None:
    spin = Wheels(np.outer(np.linspace(0, 4.0, 101), [-1.0, 1.0]))
    turned = [last(spin, WheelFaults(track=t)).turned_rad for t in (0.0, 0.05)]
    assert turned[1] == pytest.approx(turned[0] / 1.05)
    assert last(straight(10.0), WheelFaults(track=0.05)).T_odom_base[0, 3] == pytest.approx(10.0)


@pytest.mark.parametrize("encoder_m", [0.001, 0.03])
def test_encoders_round_each_sides_way_by_half_a_tick_at_most(encoder_m: float) -> None:
    recording = straight(1.7, 501)
    for before, after in zip(recording, FaultyWheels(recording, WheelFaults(encoder_m=encoder_m), 0), strict=True):
        way_m = after.odometry.T_odom_base[0, 3]
        assert abs(way_m - before.odometry.T_odom_base[0, 3]) <= encoder_m / 2 + 1e-12
        assert way_m / encoder_m == pytest.approx(round(way_m / encoder_m), abs=1e-9)


def test_slip_only_ever_makes_the_wheels_run_further_and_by_its_size() -> None:
    ways_m = np.array([believed(straight(20.0, 1201), WheelFaults(slip=0.02), seed)[3] for seed in range(60)])
    assert (ways_m > 20.0).all()
    # The mean of |g| of a unit Gaussian g.
    assert ways_m.mean() / 20.0 - 1 == pytest.approx(0.02 * np.sqrt(2 / np.pi), rel=0.1)


def test_slip_that_lasts_longer_averages_out_less() -> None:
    def spread(length_m: float) -> float:
        faults = WheelFaults(slip=0.02, slip_length_m=length_m)
        return float(np.std([believed(straight(20.0, 601), faults, seed)[3] for seed in range(60)]))

    assert spread(5.0) > 2.5 * spread(0.2)


def test_the_heading_wanders_with_the_root_of_the_way() -> None:
    def spread(length_m: float) -> float:
        faults = WheelFaults(heading=0.01)
        return float(np.std([believed(straight(length_m, 201), faults, seed)[2] for seed in range(400)]))

    assert spread(4.0) == pytest.approx(0.02, rel=0.15)
    assert spread(16.0) == pytest.approx(0.04, rel=0.15)


def test_the_seed_decides_and_nothing_else() -> None:
    readings = [last(wiggly(), WHEEL_FAULTS["good"], seed).T_odom_base.tobytes() for seed in (1, 1, 2)]
    assert readings[0] == readings[1] != readings[2]


def test_one_cause_more_leaves_the_noise_of_the_others_as_it_was() -> None:
    heading = [believed(straight(5.0), WheelFaults(heading=0.01, slip=slip), 0)[2] for slip in (0.0, 1e-9)]
    assert heading[0] == pytest.approx(heading[1], abs=1e-6)


def test_a_picture_between_two_ticks_is_told_the_last_one() -> None:
    recording = straight(3.0, 31)
    late = [replace(each, stamp_s=each.stamp_s + 0.02) for each in recording]
    recording.__class__ = type("Late", (Wheels,), {"__iter__": lambda self: iter(late)})
    ways_m = [each.odometry.T_odom_base[0, 3] for each in FaultyWheels(recording, WheelFaults(), 0)]
    assert ways_m == pytest.approx([0.0, 1.0, 2.0, 3.0])


def test_the_poses_are_those_of_the_observations_and_need_no_pictures() -> None:
    recording = wiggly()
    claimed = [each.T_world_cam for each in FaultyWheels(recording, WHEEL_FAULTS["worn"], seed=1)]
    recording.stamps_s = stamps_s(recording)  # type: ignore[attr-defined]

    def no_pictures(self: Wheels) -> Iterator[Observation]:
        raise AssertionError("a picture was taken")

    recording.__class__ = type("Blind", (Wheels,), {"__iter__": no_pictures})
    assert np.array_equal(poses(FaultyWheels(recording, WHEEL_FAULTS["worn"], seed=1)), claimed)


def test_a_recording_without_ticks_is_refused_in_one_line() -> None:
    class Plain(Wheels):
        def ticks(self) -> Ticks | None:
            return None

    with pytest.raises(RecordingError, match="need the turns of the wheels") as refused:
        FaultyWheels(Plain(np.zeros((3, 2))), WheelFaults(), 0)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("name", "value"),
    [("slip", -0.1), ("track", 0.7), ("heading", np.nan), ("slip_length_m", 0.0), ("encoder_m", -1.0)],
)
def test_impossible_faults_are_refused_by_name(name: str, value: float) -> None:
    with pytest.raises(InvalidInputError, match=name):
        WheelFaults(**{name: value})


def test_an_unknown_preset_is_refused_with_the_choices() -> None:
    with pytest.raises(InvalidInputError, match="no wheel faults named 'flat'; choose from: good, none, worn"):
        wheel_faults("flat")
