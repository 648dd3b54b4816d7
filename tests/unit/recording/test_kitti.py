"""A KITTI-odometry folder: its conventions, and one line for everything that can be wrong with it."""

import os
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from stereogrid.errors import RecordingError
from stereogrid.geometry import R_BASE_OPTICAL
from stereogrid.recording.kitti import KittiRecording


def test_forward_is_x_and_down_is_minus_z(kitti_folder: Path) -> None:
    recording = KittiRecording(kitti_folder)
    np.testing.assert_allclose(recording.poses[:, :3, 3], [[i, 0, -0.1 * i] for i in range(4)], atol=1e-12)
    np.testing.assert_allclose(recording.poses[0, :3, :3], R_BASE_OPTICAL, atol=1e-12)


def test_a_sequence_that_starts_elsewhere_is_moved_to_its_first_camera(
    kitti_folder: Path, synthetic: SimpleNamespace
) -> None:
    before = KittiRecording(kitti_folder).poses
    T_elsewhere = np.eye(4)
    T_elsewhere[:3, :3] = cv2.Rodrigues(np.array([0.1, 0.7, -0.2]))[0]
    T_elsewhere[:3, 3] = 5, -2, 30
    rows = np.loadtxt(kitti_folder / "poses.txt").reshape(-1, 3, 4)
    moved = [T_elsewhere @ np.vstack([T, [0, 0, 0, 1]]) for T in rows]
    (kitti_folder / "poses.txt").write_text("\n".join(synthetic.row(T[:3]) for T in moved))
    np.testing.assert_allclose(KittiRecording(kitti_folder).poses, before, atol=1e-9)


def test_without_times_the_pairs_are_a_tenth_of_a_second_apart(kitti_folder: Path) -> None:
    assert [each.stamp_s for each in KittiRecording(kitti_folder)] == [0, 0.1, 0.2, 0.3]


def test_times_are_read_where_they_are(kitti_folder: Path) -> None:
    (kitti_folder / "times.txt").write_text("0.0\n0.103\n0.207\n0.31\n")
    assert [each.stamp_s for each in KittiRecording(kitti_folder)] == [0, 0.103, 0.207, 0.31]


def test_the_benchmarks_own_place_of_poses_is_found(tmp_path: Path, synthetic: SimpleNamespace) -> None:
    folder = synthetic.write_kitti(tmp_path / "sequences" / "06")
    (tmp_path / "poses").mkdir()
    (folder / "poses.txt").rename(tmp_path / "poses" / "06.txt")
    assert len(KittiRecording(folder)) == 4
    (tmp_path / "poses" / "06.txt").rename(tmp_path / "mine.txt")
    assert len(KittiRecording(folder, tmp_path / "mine.txt")) == 4


def test_colour_images_become_grey(tmp_path: Path, synthetic: SimpleNamespace) -> None:
    folder = synthetic.write_kitti(tmp_path, names=("image_2", "image_3"))
    colour = np.random.default_rng(0).integers(0, 256, (24, 32, 3), dtype=np.uint8)
    cv2.imwrite(str(folder / "image_2" / "000000.png"), colour)
    first = next(iter(KittiRecording(folder)))
    np.testing.assert_array_equal(first.left, cv2.cvtColor(colour, cv2.COLOR_BGR2GRAY))


def test_the_left_colour_camera_is_put_where_its_projection_says(tmp_path: Path, synthetic: SimpleNamespace) -> None:
    folder = synthetic.write_kitti(tmp_path, n=2, names=("image_2", "image_3"))
    P = [np.array(P) for P in synthetic.camera.P]
    for shifted in P:
        shifted[0, 3] += 40 * 0.05
    (folder / "calib.txt").write_text(f"P2: {synthetic.row(P[0])}\nP3: {synthetic.row(P[1])}\n")
    # The robot turns half a turn on camera 0, so the camera 0.05 m to its left crosses to the other side.
    turned = np.diag([-1.0, 1, -1, 1])
    (folder / "poses.txt").write_text(f"{synthetic.row(np.eye(4)[:3])}\n{synthetic.row(turned[:3])}\n")
    recording = KittiRecording(folder)
    assert recording.camera.baseline_m == pytest.approx(0.06)
    np.testing.assert_allclose(recording.poses[1, :3, 3], [0, -0.1, 0], atol=1e-9)


def edit(name: str, change: Callable[[list[str]], list[str]]) -> Callable[[Path], None]:
    def apply(folder: Path) -> None:
        lines = (folder / name).read_text().splitlines()
        (folder / name).write_text("\n".join(change(lines)))

    return apply


def picture(name: str, image: np.ndarray) -> Callable[[Path], None]:
    return lambda folder: cv2.imwrite(str(folder / name), image) or None


def claim(name: str) -> Callable[[Path], None]:
    """A picture whose header tells of 3.6 GB."""

    def apply(folder: Path) -> None:
        content = (folder / name).read_bytes()
        (folder / name).write_bytes(content[:16] + 2 * (60000).to_bytes(4, "big") + content[24:])

    return apply


def replaced(line: int, column: int, word: str) -> Callable[[list[str]], list[str]]:
    def change(lines: list[str]) -> list[str]:
        words = lines[line].split()
        words[column] = word
        return [*lines[:line], " ".join(words), *lines[line + 1 :]]

    return change


def empty(folder: Path) -> None:
    for path in folder.glob("image_*/*"):
        path.unlink()


WRONG: dict[str, tuple[Callable[[Path], object], str]] = {
    "missing right image": (
        lambda f: (f / "image_1/000002.png").unlink(),
        r"image_1: 1 images are missing: 000002\.png",
    ),
    "missing left images": (
        lambda f: [path.unlink() for path in (f / "image_0").iterdir()],
        r"image_0: 4 images are missing: 000000\.png, 000001\.png, 000002\.png, \.\.\.",
    ),
    "no right folder": (lambda f: (f / "image_1").rename(f / "other"), "no folder image_1 beside image_0"),
    "no images": (empty, r"image_0: no images"),
    "no calib": (lambda f: (f / "calib.txt").unlink(), r"calib\.txt: no such file"),
    "calib of 11": (
        edit("calib.txt", lambda lines: [lines[0], lines[1].rsplit(" ", 1)[0]]),
        r"calib\.txt:2: 11 numbers, expected 12",
    ),
    "calib of 24 in a row": (
        edit("calib.txt", lambda lines: [lines[0][4:] + " " + lines[1][4:]]),
        r"calib\.txt:1: 24 numbers, expected 12",
    ),
    "calib of one row": (edit("calib.txt", lambda lines: lines[:1]), r"calib\.txt: no P1, only P0"),
    "calib of words": (edit("calib.txt", replaced(0, 3, "six")), r"calib\.txt:1: .*'six'"),
    "calib of nan": (edit("calib.txt", replaced(0, 3, "nan")), r"calib\.txt: the left projection matrix contains NaN"),
    "baseline of zero": (
        edit("calib.txt", lambda lines: [lines[0], "P1:" + lines[0][3:]]),
        r"calib\.txt: baseline_m must be positive",
    ),
    "binary calib": (lambda f: (f / "calib.txt").write_bytes(b"\xff\xfe\x00"), r"calib\.txt: cannot be read as text"),
    "too few poses": (
        edit("poses.txt", lambda lines: lines[:3]),
        r"poses\.txt: 3 poses for 4 images, expected one row an image",
    ),
    "no poses": (lambda f: (f / "poses.txt").unlink(), r"poses\.txt: no such file; poses are needed"),
    "nan in a pose": (edit("poses.txt", replaced(2, 3, "nan")), r"poses\.txt:3: .*NaN"),
    "a pose not rigid": (edit("poses.txt", replaced(1, 0, "1.1")), r"poses\.txt:2: .*not rigid"),
    "a pose of 16": (
        edit("poses.txt", lambda lines: [lines[0] + " 0 0 0 1", *lines[1:]]),
        r"poses\.txt:1: 16 numbers, expected 12",
    ),
    "times that stand still": (
        lambda f: (f / "times.txt").write_text("0\n1\n1\n2\n"),
        r"times\.txt:3: '1'; expected one time a row, increasing",
    ),
    "too few times": (lambda f: (f / "times.txt").write_text("0\n1\n"), r"times\.txt: 2 times for 4 images"),
    "a pair of two sizes": (
        picture("image_1/000001.png", np.zeros((24, 30), np.uint8)),
        r"image_1/000001\.png: the image is 30 x 24 px, .*image_0/000000\.png is 32 x 24 px",
    ),
    "a size that changes": (
        picture("image_0/000003.png", np.zeros((25, 32), np.uint8)),
        r"image_0/000003\.png: the image is 32 x 25 px, .*image_0/000000\.png is 32 x 24 px",
    ),
    "16 bits": (
        picture("image_0/000001.png", np.zeros((24, 32), np.uint16)),
        r"image_0/000001\.png: the image is 16-bit, expected 8-bit",
    ),
    "unreadable": (
        lambda f: (f / "image_1/000001.png").write_bytes(b"no image"),
        r"image_1/000001\.png: not a PNG image",
    ),
    "empty image": (lambda f: (f / "image_0/000000.png").write_bytes(b""), r"000000\.png: not a PNG image"),
    "a first image without end": (claim("image_0/000000.png"), r"000000\.png: claims to be 60000 x 60000 px"),
    "a later one without end": (
        claim("image_1/000002.png"),
        r"000002\.png: the image is 60000 x 60000 px, .* is 32 x 24",
    ),
}


@pytest.mark.parametrize(("spoil", "message"), WRONG.values(), ids=WRONG)
def test_what_is_wrong_is_named_in_one_line(kitti_folder: Path, spoil: Callable[[Path], object], message: str) -> None:
    spoil(kitti_folder)
    with pytest.raises(RecordingError, match=message) as caught:
        list(KittiRecording(kitti_folder))
    assert str(kitti_folder) in str(caught.value) and "\n" not in str(caught.value)


def test_the_real_street_goes_forward() -> None:
    data = os.environ.get("STEREOGRID_DATA")
    if not data:
        pytest.skip("needs the data set sequences/kitti_straight: set STEREOGRID_DATA to shared/data")
    recording = KittiRecording(Path(data) / "sequences" / "kitti_straight")
    assert len(recording) == 51
    assert recording.camera.focal_px == 707.0912
    assert recording.camera.baseline_m == pytest.approx(0.5372, abs=1e-4)
    assert recording.camera.shape == (370, 1226)
    steps_m = np.diff(recording.poses[:, :3, 3], axis=0)
    assert (steps_m[:, 0] > 1.15).all() and (abs(steps_m[:, 1:]) < 0.1).all()
    last = list(recording)[-1]
    assert last.odometry.travelled_m == pytest.approx(59.86, abs=0.01)
    assert last.T_world_cam[0, 3] == pytest.approx(59.84, abs=0.01)
