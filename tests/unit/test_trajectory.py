"""Trajectories in the formats of others: what evo reads is what was meant, and wrong lines are named."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from stereogrid.camera import StereoCamera
from stereogrid.cli import app, run
from stereogrid.errors import InvalidInputError, RecordingError
from stereogrid.geometry import R_BASE_OPTICAL, from_rotation, from_yaw, inverse
from stereogrid.observation import Observation, Odometry, Truth
from stereogrid.recording import McapWriter, convert, open_recording
from stereogrid.trajectory import read_kitti, read_tum, save_kitti, save_tum

START_S = 1_403_715_273.262142976
N = 5


@pytest.fixture(scope="module")
def evo() -> Any:
    return pytest.importorskip("evo.tools.file_interface", reason="needs evo: pip install stereogrid[oracle]")


@pytest.fixture(scope="module")
def path_of_poses() -> tuple[np.ndarray, np.ndarray]:
    """Stamps (N,) and poses (N, 4, 4) anywhere, far from the origin."""
    rng = np.random.default_rng(0)
    R = Rotation.from_rotvec(rng.normal(0, 1.5, (N, 3))).as_matrix()
    poses = np.stack(
        [from_rotation(*each) for each in zip(R, rng.normal([400_000, 5e6, 100], 10, (N, 3)), strict=True)]
    )
    return START_S + np.cumsum(rng.uniform(0.01, 2, N)), poses


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Turns and climbs; the truth is a little beside it, and unknown of the second observation."""
    camera = StereoCamera(focal_px=40, cx_px=15.5, cy_px=11.5, baseline_m=0.06, width_px=32, height_px=24)
    T_base_cam = from_rotation(R_BASE_OPTICAL, [0.1, 0.03, 0.4])
    picture = np.zeros(camera.shape, np.uint8)
    path = tmp_path_factory.mktemp("drive") / "drive.mcap"
    with McapWriter(path, camera, T_base_cam) as writer:
        for k in range(N):
            T_odom_base = from_yaw(0.3 * k, [0.5 * k, 0, 0.01 * k])
            T_world_cam = T_odom_base @ T_base_cam
            truth = None if k == 1 else Truth(from_yaw(0.02, [0, 0.1, 0]) @ T_world_cam)
            writer.write(Observation(START_S + k, picture, picture, Odometry(T_odom_base), T_world_cam, truth))
    return path


def test_a_tum_trajectory_reads_back_as_it_was_written(tmp_path: Path, path_of_poses: tuple) -> None:
    stamps_s, poses = path_of_poses
    save_tum(tmp_path / "a.tum", stamps_s, poses)
    read = read_tum(tmp_path / "a.tum")
    assert [stamp_ns / 10**9 for stamp_ns in read.stamps_ns.tolist()] == stamps_s.tolist()
    np.testing.assert_allclose(read.poses, poses, atol=1e-5)
    np.testing.assert_allclose(read.poses[:, :3, :3], poses[:, :3, :3], atol=1e-10)


def test_a_kitti_trajectory_is_seen_from_its_first_camera(tmp_path: Path, path_of_poses: tuple) -> None:
    _, poses = path_of_poses
    save_kitti(tmp_path / "a.kitti", poses)
    np.testing.assert_allclose(read_kitti(tmp_path / "a.kitti"), inverse(poses[0]) @ poses, atol=1e-8)


def test_evo_reads_both_as_they_were_meant(tmp_path: Path, path_of_poses: tuple, evo: Any) -> None:
    stamps_s, poses = path_of_poses
    save_tum(tmp_path / "a.tum", stamps_s, poses)
    save_kitti(tmp_path / "a.kitti", poses)
    tum = evo.read_tum_trajectory_file(tmp_path / "a.tum")
    assert tum.timestamps.tolist() == stamps_s.tolist()
    np.testing.assert_allclose(tum.poses_se3, poses, atol=1e-5)
    kitti = evo.read_kitti_poses_file(tmp_path / "a.kitti")
    np.testing.assert_allclose(kitti.poses_se3, inverse(poses[0]) @ poses, atol=1e-8)
    assert tum.check()[0] and kitti.check()[0]
    assert tum.path_length == pytest.approx(kitti.path_length)


def test_we_read_what_evo_writes(tmp_path: Path, path_of_poses: tuple, evo: Any) -> None:
    stamps_s, poses = path_of_poses
    save_tum(tmp_path / "a.tum", stamps_s, poses)
    save_kitti(tmp_path / "a.kitti", poses)
    evo.write_tum_trajectory_file(tmp_path / "theirs.tum", evo.read_tum_trajectory_file(tmp_path / "a.tum"))
    evo.write_kitti_poses_file(tmp_path / "theirs.kitti", evo.read_kitti_poses_file(tmp_path / "a.kitti"))
    theirs = read_tum(tmp_path / "theirs.tum")
    np.testing.assert_allclose(theirs.stamps_ns / 1e9, stamps_s, atol=1e-6, rtol=0)
    np.testing.assert_allclose(theirs.poses, poses, atol=1e-5)
    np.testing.assert_allclose(read_kitti(tmp_path / "theirs.kitti"), inverse(poses[0]) @ poses, atol=1e-5)


def test_stamps_are_read_to_the_nanosecond(tmp_path: Path) -> None:
    (tmp_path / "a.tum").write_text(
        "# a comment\n\n1403715273.262142976 1 2 3 0 0 0 1\n1403715273.262142977 1 2 3 0 0 0 1\n"
    )
    assert read_tum(tmp_path / "a.tum").stamps_ns.tolist() == [1403715273262142976, 1403715273262142977]


GOOD = "1.0 1 2 3 0 0 0 1"
TUM_LINES = {
    "nan": ("2.0 1 nan 3 0 0 0 1", r"a\.txt:2: contains NaN or infinity"),
    "an infinite place": ("2.0 1 inf 3 0 0 0 1", r"a\.txt:2: contains NaN or infinity"),
    "no unit quaternion": ("2.0 1 2 3 0 0 0.1 1.1", r"a\.txt:2: the quaternion has the norm 1\.105, expected 1"),
    "a quaternion of zeros": ("2.0 1 2 3 0 0 0 0", r"a\.txt:2: the quaternion has the norm 0, expected 1"),
    "a stamp that goes back": ("0.5 1 2 3 0 0 0 1", r"a\.txt:2: the stamp 0\.5 is not later than 1\.0 before it"),
    "a stamp twice": (GOOD, r"a\.txt:2: the stamp 1\.0 is not later than 1\.0"),
    "a stamp beyond all time": ("1e300 1 2 3 0 0 0 1", r"a\.txt:2: '1e300' is no stamp"),
    "seven numbers": ("2.0 1 2 3 0 0 1", r"a\.txt:2: 7 numbers, expected 8 \(stamp x y z qx qy qz qw\)"),
    "KITTI's twelve": ("1 0 0 0 0 1 0 0 0 0 1 0", r"a\.txt:2: 12 numbers, expected 8"),
    "commas": ("2.0,1,2,3,0,0,0,1", r"a\.txt:2: 1 numbers, expected 8"),
    "a word": ("2.0 1 2 3 0 0 0 one", r"a\.txt:2: .*'one'"),
}


@pytest.mark.parametrize(("line", "message"), TUM_LINES.values(), ids=TUM_LINES)
def test_a_wrong_line_of_a_tum_file_is_named(tmp_path: Path, line: str, message: str) -> None:
    (tmp_path / "a.txt").write_text(f"{GOOD}\n{line}\n")
    with pytest.raises(RecordingError, match=message):
        read_tum(tmp_path / "a.txt")


KITTI_LINES = {
    "nan": ("1 0 0 nan 0 1 0 0 0 0 1 0", r"a\.txt:2: .*NaN"),
    "not rigid": ("1.1 0 0 0 0 1 0 0 0 0 1 0", r"a\.txt:2: .*not rigid"),
    "TUM's eight": (GOOD, r"a\.txt:2: 8 numbers, expected 12 \(a 3x4 matrix, row by row\)"),
}


@pytest.mark.parametrize(("line", "message"), KITTI_LINES.values(), ids=KITTI_LINES)
def test_a_wrong_line_of_a_kitti_file_is_named(tmp_path: Path, line: str, message: str) -> None:
    (tmp_path / "a.txt").write_text(f"1 0 0 0 0 1 0 0 0 0 1 0\n{line}\n")
    with pytest.raises(RecordingError, match=message):
        read_kitti(tmp_path / "a.txt")


@pytest.mark.parametrize("read", [read_tum, read_kitti])
def test_a_file_without_poses_or_text_is_refused(tmp_path: Path, read: Callable[[Path], object]) -> None:
    for content, message in ((b"# nothing\n", "no poses"), (b"\xff\xfe\x00", "cannot be read as text")):
        (tmp_path / "a.txt").write_bytes(content)
        with pytest.raises(RecordingError, match=rf"a\.txt: {message}"):
            read(tmp_path / "a.txt")
    with pytest.raises(RecordingError, match=r"b\.txt: no such file"):
        read(tmp_path / "b.txt")


def test_what_is_no_trajectory_is_not_written(tmp_path: Path) -> None:
    poses = np.tile(np.eye(4), (2, 1, 1))
    unknown = poses.copy()
    unknown[1, 0, 3] = np.nan
    for save in (
        lambda p: save_tum(tmp_path / "a", np.arange(float(len(p))), p),
        lambda p: save_kitti(tmp_path / "a", p),
    ):
        for wrong in (unknown, poses[:0]):
            with pytest.raises(InvalidInputError, match="a trajectory has poses, all finite"):
                save(wrong)
    with pytest.raises(InvalidInputError, match="must increase"):
        save_tum(tmp_path / "a", np.zeros(2), poses)
    assert list(tmp_path.iterdir()) == []


def test_the_command_writes_camera_or_base_as_claimed_or_true(
    drive: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    recording = open_recording(drive)
    told = []
    for options in ([], ["--of", "base"], ["--poses", "truth"], ["--start", "1", "--end", "3.5", "--stride", "2"]):
        assert run(app, ["trajectory", str(drive), str(tmp_path / "a.tum"), *options]) == 0
        told.append(read_tum(tmp_path / "a.tum"))
    true = recording.true_poses()
    assert true is not None
    np.testing.assert_allclose(told[0].poses, recording.poses, atol=1e-9)
    np.testing.assert_allclose(told[1].poses, [each.odometry.T_odom_base for each in recording], atol=1e-9)
    np.testing.assert_allclose(told[2].poses, true[[0, 2, 3, 4]], atol=1e-9)
    np.testing.assert_allclose(told[2].stamps_ns / 1e9, recording.stamps_s[[0, 2, 3, 4]], rtol=0, atol=1e-6)
    np.testing.assert_allclose(told[3].poses, recording.poses[[1, 3]], atol=1e-9)
    shown = capsys.readouterr().out.splitlines()
    assert shown[1].endswith("a.tum: 5 poses of the base (tum)")
    assert shown[2].endswith("a.tum: 4 poses of the camera (tum); 1 without a true pose left out")


def test_in_kittis_format_the_command_starts_at_the_identity_with_z_ahead(drive: Path, tmp_path: Path) -> None:
    assert run(app, ["trajectory", str(drive), str(tmp_path / "a.txt"), "--format", "kitti"]) == 0
    poses = read_kitti(tmp_path / "a.txt")
    np.testing.assert_allclose(poses[0], np.eye(4), atol=1e-12)
    # The base drives .5 m ahead, 1 cm up and turns to the left: z ahead, y down, x to the right. The camera is .1 m
    # ahead of where it turns, .03 m to the left.
    ahead_m = 0.5 + 0.1 * np.cos(0.3) - 0.03 * np.sin(0.3) - 0.1
    right_m = -(0.1 * np.sin(0.3) + 0.03 * np.cos(0.3) - 0.03)
    np.testing.assert_allclose(poses[1, :3, 3], [right_m, -0.01, ahead_m], atol=1e-9)


REFUSED = {
    "an unknown suffix": (["DRIVE", "a.csv"], r"a\.csv: no trajectory has the suffix '\.csv'; choose from: \.tum, "),
    "an unknown format": (["DRIVE", "a.tum", "--format", "euroc"], "'euroc'; choose from: kitti, tum"),
    "an unknown thing": (
        ["DRIVE", "a.tum", "--of", "imu"],
        "no kind of trajectory named 'imu'; choose from: base, camera",
    ),
    "unknown poses": (
        ["DRIVE", "a.tum", "--poses", "gps"],
        "no --poses named 'gps'; choose from: odometry, standing, truth",
    ),
    "a base for KITTI": (
        ["DRIVE", "a.kitti", "--of", "base"],
        "is of the camera; write that of the base with --format",
    ),
    "the recording itself": (["DRIVE", "DRIVE", "--format", "tum"], r"drive\.mcap: is the recording"),
    "no folder": (["DRIVE", "nowhere/a.tum"], "nowhere: no such folder"),
    "no recording": (["b.mcap", "a.tum"], r"b\.mcap: no such file"),
    "a part without observations": (["DRIVE", "a.tum", "--start", "9"], "no observation from 9"),
}


@pytest.mark.parametrize(("arguments", "message"), REFUSED.values(), ids=REFUSED)
def test_bad_input_to_the_command_gets_one_line(
    drive: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    arguments: list[str],
    message: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    before = drive.read_bytes()
    assert run(app, ["trajectory", *(str(drive) if word == "DRIVE" else word for word in arguments)]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert re.search(message, line), line
    assert list(tmp_path.iterdir()) == [] and drive.read_bytes() == before


@pytest.mark.parametrize(
    ("given", "out"),
    [
        ("sequences/07", "sequences/07/poses.txt"),
        ("sequences/07", "sequences/07/new.tum"),
        ("sequences/../sequences/07", "sequences/07/image_0/../times.txt"),
        ("linked", "sequences/07/times.txt"),
        ("sequences/08", "poses/08.txt"),
    ],
)
def test_nothing_in_a_recording_or_of_it_is_written_over(
    drive: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    given: str,
    out: str,
) -> None:
    """Poses may lie in the folder of pictures, or where the benchmark has them."""
    monkeypatch.chdir(tmp_path)
    Path("sequences").mkdir()
    Path("poses").mkdir()
    Path("linked").symlink_to("sequences/07")
    for name in ("07", "08"):
        convert(open_recording(drive), f"sequences/{name}", "kitti")
    Path("sequences/08/poses.txt").rename("poses/08.txt")
    before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    assert run(app, ["trajectory", given, out]) == 1
    assert re.match(f"error: {re.escape(out)}: (lies in|is) the recording", capsys.readouterr().err)
    assert {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()} == before
    assert run(app, ["trajectory", given, "poses/09.txt"]) == 0


def test_a_recording_without_truth_says_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    camera = StereoCamera(focal_px=40, cx_px=15.5, cy_px=11.5, baseline_m=0.06, width_px=32, height_px=24)
    picture = np.zeros(camera.shape, np.uint8)
    with McapWriter(tmp_path / "a.mcap", camera, np.eye(4)) as writer:
        writer.write(Observation(1.0, picture, picture, Odometry(np.eye(4)), np.eye(4)))
    assert run(app, ["trajectory", str(tmp_path / "a.mcap"), str(tmp_path / "a.tum"), "--poses", "truth"]) == 1
    assert "carries no true poses; --poses odometry" in capsys.readouterr().err
