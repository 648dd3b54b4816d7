"""The robot: its odometry errs as a P3-AT's does, and a drive is the same every time."""

import hashlib
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("pybullet")
pytest.importorskip("embreex")

from plain_worlds import block
from plain_worlds import world as plain_world

from sim.__main__ import app
from sim.faults import PRESETS, FaultyCameras
from sim.record import record_drive
from sim.rig import StereoRig
from sim.robot.follower import PathFollower
from sim.robot.odometry import EFFECTIVE_TRACK_M, WheelOdometry
from sim.robot.pioneer import TICK_S, Pioneer, SimulationError
from sim.robot.wheel_faults import FaultyWheels, WheelFaults
from sim.scene.scene import World
from sim.scene.solids import Paint, box
from sim.scene.textures import Texture
from sim.source import Drive
from sim.worlds.world import WORLDS
from stereogrid.camera import StereoCamera
from stereogrid.cli import run as run_command
from stereogrid.errors import InvalidInputError, StereogridError
from stereogrid.geometry import yaw_rad
from stereogrid.observation import Observation, Recording, Source
from stereogrid.recording.mcap import McapRecording

TRACK_M = 0.398
SMALL = StereoRig(StereoCamera(208.5, 79.5, 59.5, 0.06, 160, 120))


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The first 1.6 m through the corridor, rendered by three threads."""
    shares: list[float] = []
    path = tmp_path_factory.mktemp("drive") / "drive.mcap"
    record_drive(path, rig=SMALL, max_distance_m=1.6, workers=3, progress=shares.append)
    assert shares == sorted(shares) and shares[0] >= 0 and 0.8 < shares[-1] <= 1
    return path


def run(speed_mps: float, turn_radps: float, duration_s: float) -> tuple[float, float, WheelOdometry]:
    """True path length [m], true turn [rad], and the odometry of a drive that starts gently."""
    with Pioneer() as robot:
        length_m, turned, last = 0.0, 0.0, robot.T_world_base
        for tick in range(int(duration_s / TICK_S)):
            share = min(1.0, tick * TICK_S)
            robot.drive(share * speed_mps, share * turn_radps)
            now = robot.T_world_base
            length_m += float(np.linalg.norm(now[:2, 3] - last[:2, 3]))
            turned += float(np.angle(np.exp(1j * (yaw_rad(now) - yaw_rad(last)))))
            last = now
    return length_m, turned, robot.odometry


def test_odometry_of_a_straight_drive_is_right_to_a_thousandth() -> None:
    length_m, turned, odometry = run(0.4, 0.0, 10.0)
    assert length_m / odometry.travelled_m == pytest.approx(1.0, abs=1e-3)
    assert abs(turned) < 0.01


@pytest.mark.parametrize(
    ("speed_mps", "turn_radps"), [(0.0, 0.3), (0.0, 0.8), (0.0, -0.8), (0.325, 0.255), (0.4, 0.4), (0.4, 0.2)]
)
def test_wheels_turn_as_if_they_stood_half_as_far_apart_again(speed_mps: float, turn_radps: float) -> None:
    _, turned, odometry = run(speed_mps, turn_radps, 8.0)
    geometric_turn = odometry.turned_rad * EFFECTIVE_TRACK_M / TRACK_M
    assert 1.4 <= geometric_turn / abs(turned) <= 1.6


def test_wheel_odometry_follows_an_arc_exactly() -> None:
    odometry = WheelOdometry()
    for _ in range(10):
        odometry.update(1.0, 2.0)
    turned = 10 * 0.11 / 0.588
    radius = 10 * 1.5 * 0.11 / turned
    expected = [radius * np.sin(turned), radius * (1 - np.cos(turned)), 0.0]
    assert odometry.T_odom_base[:3, 3] == pytest.approx(expected)
    assert odometry.turned_rad == pytest.approx(turned)


def test_the_robot_drives_the_whole_path_and_sees_all_of_it(corridor: World) -> None:
    drive = Drive(corridor, SMALL)
    moments = list(drive.moments())
    places = np.array([m.T_world_base[:2, 3] for m in moments])
    assert np.linalg.norm(places[-1] - corridor.waypoints_m[-1]) < 0.3
    gaps = np.linalg.norm(np.diff(places, axis=0), axis=1)
    turns = np.abs(np.diff(np.unwrap([yaw_rad(m.T_world_base) for m in moments])))
    assert gaps.max() < 0.21 and turns.max() < 0.15
    assert 150 <= len(moments) <= 1.2 * corridor.path_length_m / drive.every_m
    off = np.minimum(np.abs(places[:, 1]), np.abs(places[:, 0] - corridor.waypoints_m[-1][0]))
    assert off.max() < 0.3


def test_a_drive_is_a_source_whose_claims_start_at_the_truth(corridor: World) -> None:
    drive = Drive(corridor, SMALL, max_distance_m=0.5)
    assert isinstance(drive, Source) and not isinstance(drive, Recording)
    first = next(iter(drive))
    assert first.truth is not None and first.truth.depth_m is not None
    assert first.truth.T_world_cam == pytest.approx(first.T_world_cam, abs=3e-3)
    assert np.isfinite(first.truth.depth_m).mean() > 0.999


def test_a_wall_across_the_path_stops_the_drive_with_a_message() -> None:
    texture = Texture(np.full((2, 2), 128, np.uint8))
    wall = box("wall", (1.0, -1.0, 0.0), (1.2, 1.0, 1.0), Paint("plain"))
    world = World("blocked", 0, (wall,), {"plain": texture}, (), np.array([[0.0, 0.0], [3.0, 0.0]]))
    with pytest.raises(SimulationError, match="stuck at x = 0"):
        list(Drive(world, SMALL).moments())


def test_a_drive_into_a_wall_leaves_a_finished_recording_of_what_was_driven(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(WORLDS, "blocked", lambda seed: plain_world(block((1.0, -1.0, 0.0), (1.2, 1.0, 1.0))))
    path = tmp_path / "drive.mcap"
    options = ["--width", "64", "--height", "48"]
    assert run_command(app, ["record", "blocked", "--out", str(path), *options]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert "stuck at x = 0.7" in line and f"{path} keeps the drive up to there" in line
    recording = McapRecording(path)
    ticks = recording.ticks()
    assert recording.is_complete and ticks is not None
    places = [each.truth.T_world_cam[0, 3] - recording.T_base_cam[0, 3] for each in recording if each.truth]
    # A pair every 20 cm up to the wall, and ticks up to the moment that it was given up.
    assert places == pytest.approx([0.0, 0.2, 0.4, 0.6], abs=0.02)
    assert ticks.stamp_s[-1] > 6.0 and ticks.T_world_base[-1, 0, 3] == pytest.approx(0.746, abs=0.01)


def test_faulty_wheels_without_faults_give_back_the_recorded_odometry(recorded: Path) -> None:
    recording = McapRecording(recorded)
    faulty = FaultyWheels(recording, WheelFaults(), seed=0)
    assert faulty.poses == pytest.approx(recording.poses, abs=1e-9)
    for before, after in zip(recording, faulty, strict=True):
        assert after.T_world_cam.tolist() == faulty.poses[list(recording.stamps_s).index(after.stamp_s)].tolist()
        assert after.odometry.T_odom_base == pytest.approx(before.odometry.T_odom_base, abs=1e-9)
        assert after.odometry.travelled_m == pytest.approx(before.odometry.travelled_m, abs=1e-9)


def test_a_speed_beyond_the_robots_is_refused() -> None:
    with pytest.raises(InvalidInputError, match="speed_mps"):
        PathFollower(np.array([[0.0, 0.0], [1.0, 0.0]]), speed_mps=0.9)


def test_a_drive_is_the_same_bytes_every_time_and_with_any_number_of_threads(recorded: Path, tmp_path: Path) -> None:
    again = record_drive(tmp_path / "again.mcap", rig=SMALL, max_distance_m=1.6, workers=1)
    assert again.read_bytes() == recorded.read_bytes()


def test_a_recording_gives_back_the_drive(corridor: World, recorded: Path) -> None:
    recording = McapRecording(recorded)
    assert digest(recording) == digest(Drive(corridor, SMALL, max_distance_m=1.6))
    ticks = recording.ticks()
    assert ticks is not None and ticks.stamp_s[0] == 0.0
    assert np.diff(ticks.stamp_s) == pytest.approx(TICK_S, abs=2e-9)
    for observation in recording:
        assert observation.truth is not None
        T_world_cam = ticks.T_world_base_at(observation.stamp_s) @ recording.T_base_cam
        assert T_world_cam == pytest.approx(observation.truth.T_world_cam, abs=1e-9)
    # A late camera sees what comes after the last observation.
    assert ticks.stamp_s[-1] > observation.stamp_s + 2 * TICK_S
    assert recording.metadata["world"] == "corridor" and recording.truth_mesh_ply() is not None
    assert len(FaultyCameras(recording, PRESETS["mild"], seed=0)) == len(recording)


def test_a_drive_overwrites_no_file(recorded: Path) -> None:
    before = recorded.read_bytes()
    with pytest.raises(StereogridError, match="exists already"):
        record_drive(recorded, rig=SMALL, max_distance_m=1.6)
    assert recorded.read_bytes() == before


@pytest.mark.parametrize(
    "wrong", [{"world": "maze"}, {"every_m": 0.0}, {"every_m": np.nan}, {"max_distance_m": -1.0}, {"seed": -1}]
)
def test_bad_arguments_leave_no_file(wrong: dict[str, object], tmp_path: Path) -> None:
    with pytest.raises(StereogridError):
        record_drive(tmp_path / "drive.mcap", **wrong)  # type: ignore[arg-type]
    assert not list(tmp_path.iterdir())


def digest(observations: Iterable[Observation]) -> str:
    """A hash of all that a drive says. Stamps are taken to the nanosecond that a file keeps."""
    sha = hashlib.sha256()
    for o in observations:
        assert o.truth is not None and o.truth.depth_m is not None
        poses = np.round([o.odometry.T_odom_base, o.truth.T_world_cam], 9) + 0.0
        for part in (o.left, o.right, o.truth.depth_m, poses):
            sha.update(np.ascontiguousarray(part).tobytes())
        sha.update(f"{round(o.stamp_s * 1e9)}".encode())
    return sha.hexdigest()


def test_a_drive_that_is_interrupted_keeps_its_pairs_and_one_without_a_pair_leaves_no_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def stop(share: float) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        record_drive(tmp_path / "some.mcap", rig=SMALL, max_distance_m=0.8, progress=stop)
    assert len(McapRecording(tmp_path / "some.mcap")) == 1
    monkeypatch.setattr(Drive, "moments", lambda self: stop(0.0))
    with pytest.raises(KeyboardInterrupt):
        record_drive(tmp_path / "none.mcap", rig=SMALL, max_distance_m=0.8)
    assert [path.name for path in tmp_path.iterdir()] == ["some.mcap"]


@pytest.mark.parametrize("waypoints", [[[0.0, 0.0], [0.0, 0.0]], [[0.0, 0.0], [np.nan, 1.0]]])
def test_a_way_that_nobody_can_drive_is_refused(waypoints: list[list[float]]) -> None:
    with pytest.raises(InvalidInputError, match="waypoints_m must be finite"):
        World("nowhere", 0, (), {}, (), np.array(waypoints))
