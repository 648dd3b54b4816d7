"""KITTI raw drives: poses by the dataset's conventions, pictures that agree with them, one line for what is wrong."""

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from kitti_drives import (
    DOTS_M,
    SHIFTS_M,
    START_NS,
    KittiDrive,
    T_rect_imu,
    T_world_imu,
    dot_at,
    row,
    stamp,
)

from stereogrid.errors import RecordingError
from stereogrid.geometry import inverse, transform
from stereogrid.recording import KittiRawRecording, KittiRecording, open_recording


@pytest.fixture(scope="module")
def sync(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return KittiDrive().write(tmp_path_factory.mktemp("sync"))


@pytest.fixture(scope="module")
def extract(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return KittiDrive(extract=True).write(tmp_path_factory.mktemp("extract"))


def true_pose(time_s: float, camera: int) -> np.ndarray:
    T_rect_cam = np.eye(4)
    T_rect_cam[:3, 3] = -np.array(SHIFTS_M[camera])
    return T_world_imu(time_s) @ inverse(T_rect_imu()) @ T_rect_cam


def test_poses_are_those_that_the_oxts_files_were_made_of(sync: Path) -> None:
    recording = KittiRawRecording(sync)
    expected = [true_pose(0.1 * k, 0) for k in range(5)]
    np.testing.assert_allclose(recording.poses, expected, atol=1e-6)
    np.testing.assert_allclose(recording.T_base_cam, inverse(T_rect_imu()), atol=1e-9)
    odometry = [each.odometry.T_odom_base for each in recording]
    np.testing.assert_allclose(odometry, [T_world_imu(0.1 * k) for k in range(5)], atol=1e-6)


def test_stamps_are_read_to_the_nanosecond(sync: Path) -> None:
    recording = KittiRawRecording(sync)
    expected_ns = [START_NS + 100_000_000 * k + 2_345_678 for k in range(5)]
    assert recording.pairs_ns[:, 0].tolist() == expected_ns
    assert recording.stamps_s.tolist() == [ns / 10**9 for ns in expected_ns]


@pytest.mark.parametrize("cameras", [(0, 1), (2, 3)], ids=["grey", "colour"])
@pytest.mark.parametrize("raw", [False, True], ids=["sync", "extract"])
def test_what_is_where_in_the_world_is_seen_there(tmp_path: Path, cameras: tuple[int, int], raw: bool) -> None:
    recording = KittiRawRecording(KittiDrive(raw, cameras, n=3).write(tmp_path))
    assert recording.camera.shape == (100, 160)
    assert recording.camera.baseline_m == pytest.approx(SHIFTS_M[cameras[0]][0] - SHIFTS_M[cameras[1]][0], abs=1e-6)
    for each in recording:
        seen = recording.camera.project(transform(inverse(each.T_world_cam), DOTS_M))
        for column, line, disparity_px in seen:
            for image, x in ((each.left, column), (each.right, column - disparity_px)):
                # Colour cameras differ by some millimetres in height and depth.
                np.testing.assert_allclose(dot_at(image, np.array([x, line])), [x, line], atol=0.15)


def test_an_extract_drives_poses_are_interpolated_at_its_pairs(extract: Path) -> None:
    recording = KittiRawRecording(extract)
    assert len(recording) == 5 and not recording.left_out
    after_s = [(stamp_ns - START_NS) / 1e9 for stamp_ns in recording._middle_ns().tolist()]
    np.testing.assert_allclose(recording.poses, [true_pose(time_s, 0) for time_s in after_s], atol=2e-5)
    np.testing.assert_allclose(recording.skew_s, 4e-4, atol=1e-12)


@pytest.mark.parametrize("meant", [".", "image_01", "image_00/data", ".."])
def test_a_drive_is_found_from_what_is_in_it_and_around_it(sync: Path, meant: str) -> None:
    recording = open_recording(sync / meant)
    assert isinstance(recording, KittiRawRecording) and len(recording) == 5
    assert recording.metadata["drive"] == "2011_09_26_drive_0001_sync"


def test_of_several_drives_one_must_be_chosen(tmp_path: Path) -> None:
    for extract in (False, True):
        KittiDrive(extract, n=1).write(tmp_path / str(extract))
    whole = tmp_path / "False" / "2011_09_26"
    (tmp_path / "True" / "2011_09_26" / "2011_09_26_drive_0001_extract").rename(whole / "other")
    with pytest.raises(
        RecordingError, match=r"several KITTI raw drives; choose from: 2011_09_26_drive_0001_sync, other"
    ):
        open_recording(whole)


def test_a_calibration_beside_the_drive_is_found(tmp_path: Path) -> None:
    drive = KittiDrive(n=2).write(tmp_path)
    unpacked = drive.parent / "2011_09_26_calib" / "2011_09_26"
    unpacked.mkdir(parents=True)
    for path in drive.parent.glob("calib_*.txt"):
        path.rename(unpacked / path.name)
    assert len(KittiRawRecording(drive)) == 2


def test_a_kitti_odometry_folder_stays_one(kitti_folder: Path) -> None:
    assert isinstance(open_recording(kitti_folder), KittiRecording)


def edit(name: str, change: Callable[[list[str]], list[str]]) -> Callable[[Path], object]:
    def apply(drive: Path) -> None:
        lines = (drive / name).read_text().splitlines()
        (drive / name).write_text("\n".join(change(lines)))

    return apply


COUNTED: dict[str, tuple[Callable[[Path], object], int, dict[str, int]]] = {
    "a right picture is missing": (
        lambda drive: (drive / "image_01/data/0000000002.png").unlink(),
        4,
        {"pictures without one of the other camera": 1},
    ),
    "the last OXTS file is missing": (
        lambda drive: (drive / "oxts/data/0000000004.txt").unlink(),
        4,
        {"pairs where the odometry does not reach": 1},
    ),
    "an OXTS file holds NaN": (
        edit("oxts/data/0000000000.txt", lambda lines: ["nan " + lines[0].split(" ", 1)[1]]),
        4,
        {"OXTS files without a pose": 1, "pairs where the odometry does not reach": 1},
    ),
    "an OXTS file is empty": (
        lambda drive: (drive / "oxts/data/0000000004.txt").write_text(""),
        4,
        {"OXTS files without a pose": 1, "pairs where the odometry does not reach": 1},
    ),
    "the last stamp is missing": (
        edit("image_00/timestamps.txt", lambda lines: lines[:-1]),
        4,
        {"pictures without a stamp": 2, "OXTS files without a stamp": 1},
    ),
    "a stamp in the middle is missing": (
        edit("image_00/timestamps.txt", lambda lines: [*lines[:2], "", *lines[3:]]),
        4,
        {"pictures without a stamp": 2, "OXTS files without a stamp": 1},
    ),
    "a stamp is there twice": (
        edit("image_00/timestamps.txt", lambda lines: [lines[0], lines[0], *lines[2:]]),
        4,
        {"pictures with an earlier one's stamp": 2, "OXTS files with an earlier one's stamp": 1},
    ),
}


@pytest.mark.parametrize(("spoil", "length", "counted"), COUNTED.values(), ids=COUNTED)
def test_what_has_no_partner_is_counted(
    tmp_path: Path, spoil: Callable[[Path], object], length: int, counted: dict[str, int]
) -> None:
    drive = KittiDrive().write(tmp_path)
    spoil(drive)
    recording = KittiRawRecording(drive)
    assert (len(recording), recording.left_out) == (length, counted)
    assert len(list(recording)) == length


def without(name: str) -> Callable[[list[str]], list[str]]:
    return lambda lines: [line for line in lines if not line.startswith(name)]


def claim_size(drive: Path) -> None:
    path = drive / "image_00/data/0000000001.png"
    encoded = bytearray(path.read_bytes())
    encoded[16:24] = (60000).to_bytes(4, "big") * 2
    path.write_bytes(encoded)


def cut(drive: Path) -> None:
    path = drive / "image_01/data/0000000001.png"
    path.write_bytes(path.read_bytes()[:200])


CAM = "../calib_cam_to_cam.txt"
WRONG: dict[str, tuple[Callable[[Path], object], str]] = {
    "no calibration": (lambda drive: (drive / CAM).unlink(), r"no calib_cam_to_cam\.txt .*2011_09_26_calib\.zip"),
    "no imu": (lambda drive: (drive / "../calib_imu_to_velo.txt").unlink(), r"no calib_imu_to_velo\.txt"),
    "no P_rect": (edit(CAM, without("P_rect_01")), r"calib_cam_to_cam\.txt: no P_rect_01"),
    "P_rect of eleven": (
        edit(CAM, lambda lines: [x.rsplit(" ", 1)[0] if x.startswith("P_rect_00") else x for x in lines]),
        r"P_rect_00 has 11 numbers, expected 12",
    ),
    "a word": (edit(CAM, lambda lines: [*lines, "K_09: one two"]), r"calib_cam_to_cam\.txt:27: .*'one'"),
    "not rigid": (
        edit("../calib_velo_to_cam.txt", lambda lines: ["R: " + row(np.eye(3) * 1.1), lines[2]]),
        r"calib_velo_to_cam\.txt: R is no rotation",
    ),
    "a size without end": (
        edit(CAM, lambda lines: ["S_rect_00: 6e4 6e4" if x.startswith("S_rect_00") else x for x in lines]),
        r"calib_cam_to_cam\.txt: pictures of \[60000",
    ),
    "no right camera": (
        lambda drive: (drive / "image_01").rename(drive / "away"),
        r"expected data of two cameras: image_00 and image_01 or image_02 and image_03",
    ),
    "no oxts": (lambda drive: (drive / "oxts").rename(drive / "away"), r"oxts/data: no such folder"),
    "oxts of words": (
        lambda drive: (drive / "oxts/data/0000000001.txt").write_text("here and there"),
        r"oxts/data/0000000001\.txt:1: .*'here'",
    ),
    "no stamps": (lambda drive: (drive / "image_00/timestamps.txt").unlink(), r"timestamps\.txt: no such file"),
    "a stamp that is none": (
        edit("image_00/timestamps.txt", lambda lines: [*lines[:2], "2011-13-26 13:02:25.1", *lines[3:]]),
        r"image_00/timestamps\.txt:3: '2011-13-26 13:02:25\.1' is no date and time",
    ),
    **{
        f"a stamp of the year {year}": (
            edit("image_00/timestamps.txt", lambda lines, year=year: [f"{year}{lines[0][4:]}", *lines[1:]]),  # type: ignore[misc]
            rf"image_00/timestamps\.txt:1: '{year}-.*' is no date and time of today",
        )
        for year in ("0001", "2300", "9999")
    },
    "no pictures": (
        lambda drive: [path.unlink() for path in (drive / "image_00/data").iterdir()],
        r"image_00/data: no files 0000000000\.png",
    ),
    "two of one number": (
        lambda drive: (drive / "image_00/data/2.png").write_bytes(b""),
        r"image_00/data: 0000000002\.png and 2\.png have one number: keep one",
    ),
    "a size of its own": (
        lambda drive: cv2.imwrite(str(drive / "image_01/data/0000000003.png"), np.zeros((10, 12), np.uint8)),
        r"image_01/data/0000000003\.png: the image is 12 x 10 px",
    ),
    "a size that is claimed": (claim_size, r"0000000001\.png: the image is 60000 x 60000 px"),
    "a picture cut short": (cut, r"image_01/data/0000000001\.png: .*cut short"),
}


@pytest.mark.parametrize(("spoil", "message"), WRONG.values(), ids=WRONG)
def test_what_is_wrong_is_named_in_one_line(tmp_path: Path, spoil: Callable[[Path], object], message: str) -> None:
    drive = KittiDrive(n=4).write(tmp_path)
    spoil(drive)
    with pytest.raises(RecordingError, match=message) as caught:
        list(open_recording(drive))
    assert "\n" not in str(caught.value)


def test_oxts_reports_of_an_extract_drive_may_come_in_disorder(tmp_path: Path) -> None:
    drive = KittiDrive(extract=True, n=3).write(tmp_path)
    before = KittiRawRecording(drive).poses
    clock, data = drive / "oxts/timestamps.txt", drive / "oxts/data"
    lines = clock.read_text().splitlines()
    lines[7], lines[8] = lines[8], lines[7]
    clock.write_text("\n".join([*lines, stamp(0)]))
    (data / "0000000007.txt").rename(data / "away")
    (data / "0000000008.txt").rename(data / "0000000007.txt")
    (data / "away").rename(data / "0000000008.txt")
    np.testing.assert_allclose(KittiRawRecording(drive).poses, before, atol=1e-9)
