"""Plain folders of pictures: every way to name and stamp them, and one line for all that is missing or wrong."""

import shutil
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from euroc_folders import write_euroc
from plain_folders import (
    CAMERA,
    CAMERA_TOML,
    MOUNT,
    MOUNT_TOML,
    RIG,
    STAMPS_S,
    T_WORLD_BASE,
    N,
    image,
    write_folder,
    write_rectified,
)

from stereogrid.cli import app, run
from stereogrid.errors import StereogridError
from stereogrid.geometry import R_BASE_OPTICAL, from_rotation
from stereogrid.recording import FolderRecording, Given, open_recording
from stereogrid.trajectory import save_tum

COUNTS = range(N)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return write_folder(tmp_path / "drive")


def named(left: str, right: str, values: list[object]) -> tuple[list[str], list[str]]:
    return [left.format(value) for value in values], [right.format(value) for value in values]


def nanoseconds() -> list[object]:
    return [round(stamp_s * 1e9) for stamp_s in 1.4e9 + STAMPS_S]


def test_raw_pictures_are_rectified_and_placed_by_the_rigs_mount(folder: Path) -> None:
    recording = open_recording(folder)
    assert isinstance(recording, FolderRecording) and len(recording) == N and recording.left_out == {}
    rectification = RIG.rectification()
    assert recording.camera == rectification.camera
    np.testing.assert_allclose(recording.T_base_cam, MOUNT, atol=1e-9)
    for number, each in enumerate(recording):
        expected = rectification.rectify(image(number), image(100 + number))
        np.testing.assert_array_equal([each.left, each.right], expected)
        np.testing.assert_allclose(each.odometry.T_odom_base, T_WORLD_BASE[number], atol=1e-9)
        np.testing.assert_allclose(each.T_world_cam, T_WORLD_BASE[number] @ MOUNT, atol=1e-9)
    assert recording.stamps_s.tolist() == STAMPS_S.tolist()


LAYOUTS = {
    "left and right": named("left/{:03d}.png", "right/{:03d}.png", list(COUNTS)),
    "cam0 and cam1": named("cam0/{}.png", "cam1/{}.png", list(COUNTS)),
    "image_left and image_right": named("image_left/f{}.png", "image_right/f{}.png", list(COUNTS)),
    "names within a side's folder": named("left/left-{}.png", "right/right-{}.png", list(COUNTS)),
    "one folder": named("left_{:02d}.png", "right_{:02d}.png", list(COUNTS)),
    "the side behind": named("{}_Left.png", "{}_Right.png", list(COUNTS)),
    "counts that grow a digit": named("left/{}.png", "right/{}.png", list(range(6, 6 + N))),
    "pictures of two makers": named("left/{}.jpg", "right/{}.png", list(COUNTS)),
}


@pytest.mark.parametrize("names", LAYOUTS.values(), ids=LAYOUTS)
def test_rectified_pictures_are_found_by_their_names(tmp_path: Path, names: tuple[list[str], list[str]]) -> None:
    recording = open_recording(write_rectified(tmp_path, names))
    assert recording.camera == CAMERA, "its size is the pictures'"
    assert len(recording) == N and recording.left_out == {}
    for number, each in enumerate(recording):
        np.testing.assert_array_equal(each.right, image(100 + number))
        np.testing.assert_allclose(each.T_world_cam, T_WORLD_BASE[number] @ MOUNT, atol=1e-9)


@pytest.mark.parametrize(
    ("pattern", "per_s"), [("{}", 10**9), ("{}", 10**6), ("{}", 10**3), ("rectified_{}", 10**9), ("{:.6f}", 1)]
)
def test_stamps_are_read_from_names(tmp_path: Path, pattern: str, per_s: int) -> None:
    values = [stamp_ns * per_s / 10**9 if per_s == 1 else stamp_ns * per_s // 10**9 for stamp_ns in nanoseconds()]  # type: ignore[operator]
    write_rectified(tmp_path, named(f"left/{pattern}.png", f"right/{pattern}.png", list(values)))
    save_tum(tmp_path / "trajectory.txt", 1.4e9 + STAMPS_S - 0.05, T_WORLD_BASE @ MOUNT)
    recording = open_recording(tmp_path)
    np.testing.assert_allclose(recording.stamps_s, 1.4e9 + STAMPS_S[:-1], rtol=0, atol=1e-6)
    assert recording.left_out == {"pairs where the odometry does not reach": 1}
    # Half-way between two reports of an even drive.
    middle = (T_WORLD_BASE[0] @ MOUNT)[:3, 3] / 2 + (T_WORLD_BASE[1] @ MOUNT)[:3, 3] / 2
    np.testing.assert_allclose(recording.poses[0, :3, 3], middle, atol=1e-3)


def test_cameras_that_were_not_triggered_together_are_paired_by_their_names_stamps(tmp_path: Path) -> None:
    stamps_ns = nanoseconds()
    names = [f"left/{stamp_ns}.png" for stamp_ns in stamps_ns], [f"right/{int(s) + 3_000_000}.png" for s in stamps_ns]  # type: ignore[call-overload]
    write_rectified(tmp_path, names)
    save_tum(tmp_path / "trajectory.txt", 1.4e9 + STAMPS_S, np.tile(T_WORLD_BASE[0] @ MOUNT, (N, 1, 1)))
    recording = open_recording(tmp_path)
    assert len(recording) == N - 1, "the last pair's middle is after the last pose"
    np.testing.assert_allclose(recording.skew_s, 0.003)  # type: ignore[attr-defined]


@pytest.mark.parametrize("unit", [1, 10**9])
def test_times_come_before_names_and_poses_are_interpolated_at_them(folder: Path, unit: int) -> None:
    moments = [f"{round((1.4e9 + s) * unit)}" if unit > 1 else f"{s:.3f}" for s in STAMPS_S]
    (folder / "times.txt").write_text("\n".join(["# s", *moments]))
    start_s = 1.4e9 if unit > 1 else 0.0
    save_tum(folder / "trajectory.txt", start_s + np.array([999.8, 1000.2, 1000.6]), T_WORLD_BASE[:3] @ MOUNT)
    recording = open_recording(folder)
    np.testing.assert_allclose(recording.stamps_s, start_s + STAMPS_S, rtol=0, atol=1e-6)
    np.testing.assert_allclose(recording.poses[2], T_WORLD_BASE[1] @ MOUNT, atol=1e-5)


def test_a_trajectory_of_the_base_is_told_by_its_name_or_said(folder: Path, tmp_path: Path) -> None:
    expected = open_recording(folder).poses
    (folder / "trajectory.txt").unlink()
    save_tum(folder / "trajectory_base.txt", STAMPS_S, T_WORLD_BASE)
    np.testing.assert_allclose(open_recording(folder).poses, expected, atol=1e-9)
    shutil.move(folder / "trajectory_base.txt", tmp_path / "path.tum")
    recording = FolderRecording(folder, trajectory=tmp_path / "path.tum", of="base")
    np.testing.assert_allclose(recording.poses, expected, atol=1e-9)


def test_camera_toml_may_tell_the_mount(tmp_path: Path) -> None:
    write_rectified(tmp_path, LAYOUTS["left and right"])
    np.testing.assert_array_equal(open_recording(tmp_path).T_base_cam, from_rotation(R_BASE_OPTICAL))
    (tmp_path / "camera.toml").write_text(CAMERA_TOML + MOUNT_TOML)
    recording = open_recording(tmp_path)
    np.testing.assert_allclose(recording.T_base_cam, MOUNT, atol=1e-12)
    np.testing.assert_allclose(recording.poses, T_WORLD_BASE @ MOUNT, atol=1e-9)


def test_another_recordings_pairs_and_trajectory_make_the_same_recording(tmp_path: Path) -> None:
    source = open_recording(write_euroc(tmp_path / "euroc", 3))
    drive, camera = tmp_path / "drive", source.camera
    drive.mkdir()
    for number, each in enumerate(source):
        cv2.imwrite(str(drive / f"left_{number}.png"), each.left)
        cv2.imwrite(str(drive / f"right_{number}.png"), each.right)
    numbers = {name: getattr(camera, name) for name in ("focal_px", "cx_px", "cy_px", "baseline_m")}
    (drive / "camera.toml").write_text("".join(f"{name} = {value!r}\n" for name, value in numbers.items()))
    assert run(app, ["trajectory", str(tmp_path / "euroc"), str(drive / "trajectory.tum")]) == 0
    recording = open_recording(drive)
    assert recording.camera == camera
    for ours, theirs in zip(recording, source, strict=True):
        assert ours.stamp_s == pytest.approx(theirs.stamp_s, abs=1e-6)
        np.testing.assert_array_equal([ours.left, ours.right], [theirs.left, theirs.right])
        np.testing.assert_allclose(ours.T_world_cam, theirs.T_world_cam, atol=1e-9)


def test_a_calibration_of_opencvs_is_read(folder: Path) -> None:
    expected = open_recording(folder).camera
    (folder / "rig.toml").unlink()
    storage = cv2.FileStorage(str(folder / "stereo.yml"), cv2.FILE_STORAGE_WRITE)
    for side in (0, 1):
        storage.write(f"M{side + 1}", RIG.K[side])
        storage.write(f"D{side + 1}", RIG.distortion[side].reshape(1, -1))
    storage.write("R", np.ascontiguousarray(RIG.T_right_left[:3, :3]))
    storage.write("T", np.ascontiguousarray(RIG.T_right_left[:3, 3:]))
    storage.write("image_width", 32)
    storage.write("image_height", 24)
    storage.release()
    assert open_recording(folder).camera == expected


def test_pictures_without_a_partner_are_left_out_and_counted(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "right/002.png").unlink()
    (folder / "left/004.png").unlink()
    recording = open_recording(folder)
    assert recording.left_out == {"pictures without one of the other camera": 2}
    np.testing.assert_allclose(recording.poses, (T_WORLD_BASE @ MOUNT)[[0, 1, 3, 5]], atol=1e-9)
    assert run(app, ["info", str(folder)]) == 0
    told = capsys.readouterr().out.splitlines()
    assert told[0].startswith("folder: 4 observations in 0.500 s (6.00 Hz), path ")
    assert told[1].startswith("camera: 32 x 24 px, focal length ")
    assert told[2] == "mount: left camera in base at (0.100, 0.030, 0.400) m, looking 0.0 degrees down"
    assert told[3].startswith("truth: none")
    assert told[4] == "left out: 2 pictures without one of the other camera"


@pytest.mark.parametrize("times", [False, True])
def test_a_rig_that_stood_still_is_mapped_without_a_trajectory(
    folder: Path, capsys: pytest.CaptureFixture[str], times: bool
) -> None:
    (folder / "trajectory.txt").unlink()
    if times:
        (folder / "times.txt").write_text("\n".join(f"{s:.3f}" for s in STAMPS_S))
    recording = open_recording(folder, given=Given(standing=True))
    np.testing.assert_allclose(recording.stamps_s, STAMPS_S if times else 0.1 * np.arange(N), atol=1e-9)
    np.testing.assert_allclose(recording.poses, [MOUNT] * N, atol=1e-9)
    assert run(app, ["info", str(folder), "--poses", "standing"]) == 0
    assert "folder: 6 observations in 0.500 s (10.00 Hz), path 0.00 m" in capsys.readouterr().out


def test_a_world_whose_z_is_not_up_is_doubted(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """As of a SLAM program whose world is its first camera: z ahead, y down."""
    assert not list(open_recording(folder).notes())
    save_tum(folder / "trajectory.txt", STAMPS_S, np.tile(np.eye(4), (N, 1, 1)))
    (note,) = open_recording(folder).notes()
    assert note.startswith("doubtful: the camera's up is 90 degrees off the z of its trajectory")


def test_a_trajectory_from_the_first_camera_on_is_turned_upright_where_its_name_says_so(folder: Path) -> None:
    T_first_cam = np.linalg.inv(T_WORLD_BASE[0] @ MOUNT) @ T_WORLD_BASE @ MOUNT
    (folder / "trajectory.txt").unlink()
    save_tum(folder / "trajectory_optical.txt", STAMPS_S, T_first_cam)
    recording = open_recording(folder)
    np.testing.assert_allclose(recording.poses[0], from_rotation(R_BASE_OPTICAL), atol=1e-9)
    moved_m = (T_WORLD_BASE @ MOUNT)[:, :3, 3] - MOUNT[:3, 3]
    np.testing.assert_allclose(recording.poses[:, :3, 3], moved_m, atol=1e-9)
    assert not list(recording.notes())


COUNTERS = {
    "dates": [f"2024013112300{i}" for i in COUNTS],
    "numbers beyond all stamps": [f"{10**24 + i}" for i in COUNTS],
    "no numbers": list("abcdef"),
}


@pytest.mark.parametrize("names", COUNTERS.values(), ids=COUNTERS)
def test_numbers_that_are_no_stamps_of_today_are_counters(tmp_path: Path, names: list[str]) -> None:
    write_rectified(tmp_path, named("left/{}.png", "right/{}.png", list(names)))
    assert open_recording(tmp_path).stamps_s.tolist() == STAMPS_S.tolist()


def drop(name: str) -> Callable[[Path], object]:
    return lambda folder: (folder / name).unlink()


def write(name: str, content: str) -> Callable[[Path], object]:
    return lambda folder: (folder / name).write_text(content)


def several(*spoil: Callable[[Path], object]) -> Callable[[Path], object]:
    return lambda folder: [each(folder) for each in spoil]


def empty(name: str) -> Callable[[Path], object]:
    return lambda folder: [path.unlink() for path in (folder / name).iterdir()]


def rectified(camera: str) -> Callable[[Path], object]:
    return several(drop("rig.toml"), write("camera.toml", camera))


def picture(shape: tuple[int, int]) -> Callable[[Path], object]:
    return lambda folder: cv2.imwrite(str(folder / "left/000.png"), np.zeros(shape, np.uint8))


WRONG: dict[str, tuple[Callable[[Path], object], str]] = {
    "no calibration": (drop("rig.toml"), r"no calibration: add rig\.toml .*OpenCV.*camera\.toml with focal_px"),
    "two calibrations": (
        write("camera.toml", CAMERA_TOML),
        r"more than one calibration: camera\.toml, rig\.toml; keep one",
    ),
    "an unfinished camera": (rectified("focal_px = 40.0\n"), r"camera\.toml: missing key 'cx_px'"),
    "an unknown key": (rectified(CAMERA_TOML + "fokal = 1\n"), r"camera\.toml: unknown key 'fokal'"),
    "a baseline of zero": (rectified(CAMERA_TOML.replace("0.06", "0.0")), r"camera\.toml: baseline_m must be positive"),
    "a calibration that is none": (write("rig.toml", 'format = "x"'), r"rig\.toml: is no calibration"),
    "OpenCV's of nonsense": (
        several(drop("rig.toml"), write("stereo.yml", "hello")),
        r"stereo\.yml: (is no file of OpenCV's|lacks)",
    ),
    "no trajectory": (
        drop("trajectory.txt"),
        r"no trajectory: add trajectory\.txt, a row .*trajectory_base\.txt.*\(--poses standing\)",
    ),
    "two trajectories": (write("poses.txt", ""), r"more than one trajectory: trajectory\.txt, poses\.txt; keep one"),
    "a trajectory with a nan": (write("trajectory.txt", "1 2 nan 0 0 0 0 1"), r"trajectory\.txt:1: contains NaN"),
    "a trajectory of KITTI's": (
        write("trajectory.txt", "1 0 0 0 0 1 0 0 0 0 1 0"),
        r"trajectory\.txt:1: 12 numbers, expected 8 \(stamp x y z",
    ),
    "too few poses for counted pictures": (
        write("trajectory.txt", "1 0 0 0 0 0 0 1\n2 0 0 0 0 0 0 1\n"),
        r"trajectory\.txt: 2 rows for 6 pictures of a camera, 000 to 005, .*or add times\.txt",
    ),
    "a base without a mount": (
        several(rectified(CAMERA_TOML), lambda f: (f / "trajectory.txt").rename(f / "trajectory_base.txt")),
        r"trajectory_base\.txt: is of the base.*add \[mount\] with x_m, y_m, z_m and pitch_deg to rig\.toml or camera",
    ),
    "too few times": (write("times.txt", "1\n2\n"), r"times\.txt: 2 rows for 6 pictures"),
    "times that go back": (write("times.txt", "1\n2\n3\n2.5\n5\n6\n"), r"times\.txt:4: the stamp 2\.5 is not later"),
    "times of words": (write("times.txt", "1\n2\nthree\n"), r"times\.txt:3: 'three' is no stamp"),
    "a time of thousands of digits": (write("times.txt", "1" * 5000), r"times\.txt:1: '1{40}' is no stamp"),
    "a time beyond all numbers": (write("times.txt", "1e9999999999"), r"times\.txt:1: '1e9999999999' is no stamp"),
    "times of two columns": (write("times.txt", "1 2\n"), r"times\.txt:1: 2 words, expected one stamp a row"),
    "times of another day": (
        write("times.txt", "1\n2\n3\n4\n5\n6\n"),
        r"trajectory\.txt tells of no moment at which a pair was taken",
    ),
    "no right folder": (lambda f: (f / "right").rename(f / "other"), "no folder right beside left: add the pictures"),
    "no left folder": (lambda f: (f / "left").rename(f / "other"), "no folder left beside right"),
    "no right pictures": (empty("right"), r"right: no pictures; expected \.png"),
    "right pictures of other moments": (
        lambda f: [path.rename(path.with_name(f"9{path.name}")) for path in sorted((f / "right").iterdir())],
        r"trajectory\.txt: 6 rows for 12 pictures of a camera",
    ),
    "two pictures of one moment": (
        lambda f: shutil.copy(f / "left/001.png", f / "left/001.PNG"),
        r"left: 001\.PNG and 001\.png are of one moment by their names: keep one",
    ),
    "another size": (picture((24, 33)), r"left/000\.png: the image is 33 x 24 px, the calibration is for 32 x 24 px"),
    "a later one of another size": (
        lambda f: (
            shutil.copy(f / "left/000.png", f / "left/003.png") and cv2.imwrite(str(f / "left/003.png"), image(0)[:9])
        ),
        r"left/003\.png: the image is 32 x 9 px",
    ),
    "a giant, with a camera that does not say its size": (
        several(
            rectified(CAMERA_TOML),
            lambda f: (f / "left/000.png").write_bytes(
                (f / "left/000.png").read_bytes()[:16] + 2 * (60000).to_bytes(4, "big") + bytes(100)
            ),
        ),
        r"left/000\.png: claims to be 60000 x 60000 px",
    ),
    "cut short": (
        lambda f: (f / "left/000.png").write_bytes((f / "left/000.png").read_bytes()[:300]),
        r"left/000\.png: not a readable image: the PNG is cut short",
    ),
    "a JPEG that is none": (
        lambda f: (f / "right/000.png").write_bytes(b"\xff\xd8\xff\xe0 nothing"),
        r"right/000\.png: a JPEG image without a size",
    ),
}


@pytest.mark.parametrize(("spoil", "message"), WRONG.values(), ids=WRONG)
def test_what_is_missing_or_wrong_is_named_in_one_line(
    folder: Path, spoil: Callable[[Path], object], message: str, capfd: pytest.CaptureFixture[str]
) -> None:
    spoil(folder)
    with pytest.raises(StereogridError, match=message) as caught:
        list(open_recording(folder))
    assert str(folder) in str(caught.value) and "\n" not in str(caught.value)
    assert capfd.readouterr().err == ""


def test_two_pictures_of_one_moment_in_one_folder_are_refused(tmp_path: Path) -> None:
    write_rectified(tmp_path, LAYOUTS["one folder"])
    first = sorted(tmp_path.glob("*left*"))[0]
    shutil.copy(first, first.with_suffix(".jpg"))
    with pytest.raises(StereogridError, match=r"\.jpg and .*\.png are of one moment"):
        open_recording(tmp_path)


def test_only_left_pictures_in_one_folder_are_not_enough(tmp_path: Path) -> None:
    write_rectified(tmp_path, (LAYOUTS["one folder"][0], []))
    with pytest.raises(StereogridError, match=r"no pictures of the right camera; expected right_\*\.png"):
        open_recording(tmp_path)


def test_a_folder_of_other_pictures_is_no_recording(tmp_path: Path) -> None:
    """A name that only contains the letters is no side's."""
    for name in ("bright_01.png", "copyright.png", "leftover.png"):
        cv2.imwrite(str(tmp_path / name), image(0))
    with pytest.raises(StereogridError, match=r"no known kind of recording; choose from .*folder: a folder with left"):
        open_recording(tmp_path)


def test_a_trajectory_of_something_else_is_refused(folder: Path) -> None:
    with pytest.raises(StereogridError, match="no kind of trajectory named 'imu'; choose from: base, camera, optical"):
        FolderRecording(folder, of="imu")
