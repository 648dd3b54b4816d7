"""RGB-D folders as recordings of a virtual rig; one line, or a count, for everything that can be wrong with one."""

import os
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
import pytest
from rgbd_folders import (
    BOX,
    BOX_M,
    UNKNOWN,
    WALL_M,
    colour,
    depth_m,
    depth_numbers,
    world_poses,
    write_frames,
    write_tum,
)

from stereogrid.config import MappingConfig, MatcherConfig
from stereogrid.errors import InvalidInputError, RecordingError
from stereogrid.geometry import inverse, rotation_angle_rad
from stereogrid.mapping_run import build_map
from stereogrid.recording import RgbdRecording, Selection, open_recording
from stereogrid.recording.images import grey


@pytest.fixture(scope="module")
def tum(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_tum(tmp_path_factory.mktemp("tum") / "desk")


@pytest.fixture(scope="module")
def frames(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_frames(tmp_path_factory.mktemp("room") / "seq-01")


@pytest.mark.parametrize("layout", ["tum", "frames"])
def test_disparities_are_the_measured_depths(layout: str, request: pytest.FixtureRequest) -> None:
    recording = open_recording(request.getfixturevalue(layout))
    assert isinstance(recording, RgbdRecording) and recording.has_disparity
    assert (recording.camera.focal_px, recording.camera.baseline_m, recording.camera.shape) == (80, 0.06, (72, 96))
    for k, each in enumerate(recording):
        assert each.disparity is not None and each.truth is not None and each.truth.depth_m is not None
        np.testing.assert_allclose(each.truth.depth_m, depth_m(), atol=6e-4)
        np.testing.assert_allclose(each.disparity.disparity_px, 80 * 0.06 / depth_m(), rtol=1e-3)
        np.testing.assert_array_equal(each.disparity.valid, ~np.isnan(depth_m()))
        assert not each.disparity.valid[UNKNOWN].any()
        np.testing.assert_array_equal(each.left, grey(colour(k)))
        # 4.8 px at 1 m, 2.4 px at 2 m: between two pixels.
        box = each.left[BOX].astype(float)
        np.testing.assert_allclose(each.right[24:48, 32:55], 0.2 * box[:, :-1] + 0.8 * box[:, 1:], atol=0.51)


def test_a_tum_pose_is_that_of_the_depth_images_own_stamp(tum: Path) -> None:
    recording = RgbdRecording(tum)
    assert recording.stamps_s == pytest.approx(1305031102.179304 + np.arange(5) / 30, abs=1e-6)
    poses = world_poses(10)
    for stamp_s, T in zip(recording.stamps_s, recording.poses, strict=True):
        place = (stamp_s - 1305031102.10) / 0.05
        k, share = int(place), place % 1
        np.testing.assert_allclose(T[:3, 3], (1 - share) * poses[k, :3, 3] + share * poses[k + 1, :3, 3], atol=2e-5)
        turn_rad = rotation_angle_rad(inverse(poses[k]) @ poses[k + 1])
        assert rotation_angle_rad(inverse(poses[k]) @ T) == pytest.approx(share * turn_rad, abs=1e-4)


def test_frames_keep_their_shape_and_their_world_is_made_upright(frames: Path) -> None:
    recording, true = RgbdRecording(frames), world_poses(6)
    steps, true_steps = ([inverse(a) @ b for a, b in pairwise(poses)] for poses in (recording.poses, true))
    np.testing.assert_allclose(steps, true_steps, atol=1e-5)
    # Up in the true world, as it is seen in ours: a hand wobbles by a degree or two.
    up = recording.poses[0, :3, :3] @ true[0, :3, :3].T @ [0, 0, 1]
    assert np.degrees(np.arccos(up[2])) < 2.5
    forward = recording.poses[0, :3, 2]
    assert forward[0] > 0.8 and forward[1] == pytest.approx(0, abs=1e-9)
    assert recording.stamps_s.tolist() == pytest.approx([k / 3 for k in range(6)])


def test_a_camera_that_does_not_turn_has_its_upward_axis_up(tmp_path: Path) -> None:
    folder = write_frames(tmp_path, n=3)
    for path in folder.glob("*.pose.txt"):
        np.savetxt(path, world_poses(1)[0])
    up = RgbdRecording(folder).poses[0, :3, 1]
    np.testing.assert_allclose(up, [0, 0, -1], atol=1e-9)


@pytest.mark.parametrize(("layout", "meant"), [("tum", "rgb"), ("tum", "depth"), ("tum", ".."), ("frames", "..")])
def test_a_folder_is_found_from_what_is_in_it_and_around_it(
    layout: str, meant: str, request: pytest.FixtureRequest
) -> None:
    folder: Path = request.getfixturevalue(layout)
    recording = open_recording(folder / meant)
    assert isinstance(recording, RgbdRecording)
    np.testing.assert_array_equal(recording.poses, RgbdRecording(folder).poses)


def test_of_several_sequences_one_must_be_chosen_unless_one_is_called_frames(tmp_path: Path) -> None:
    for name in ("seq-01", "seq-02"):
        write_frames(tmp_path / name, n=1)
    with pytest.raises(RecordingError, match=r"several RGB-D recordings; choose from: seq-01, seq-02"):
        open_recording(tmp_path)
    (tmp_path / "seq-01").rename(tmp_path / "frames")
    assert len(open_recording(tmp_path)) == 1


def test_a_camera_file_may_stand_above_the_frames(tmp_path: Path) -> None:
    folder = write_frames(tmp_path / "frames", n=1)
    (folder / "camera-intrinsics.txt").rename(tmp_path / "camera-intrinsics.txt")
    assert RgbdRecording(folder).camera.focal_px == 80


def test_tums_own_cameras_are_known_by_the_folders_name(tmp_path: Path) -> None:
    folder = write_tum(tmp_path / "rgbd_dataset_freiburg3_office", n=2, lens=None)
    recording = RgbdRecording(folder)
    assert recording.camera.focal_px == pytest.approx((535.4 + 539.2) / 2)
    assert recording.metadata["intrinsics"] == "TUM's freiburg3"
    with pytest.raises(RecordingError, match=r"put a file camera-intrinsics\.txt there, or above it, with .*'fx 0 cx'"):
        RgbdRecording(folder.rename(tmp_path / "office"))


def test_a_bent_lens_is_straightened_colours_between_pixels_and_depths_not(tmp_path: Path) -> None:
    folder = write_tum(tmp_path, n=1, lens="80 84 47.5 35.5 0.1 0 0 0")
    recording = RgbdRecording(folder)
    (each,) = recording
    assert recording.camera.focal_px == 82 and any("straightened" in note for note in recording.notes())
    assert each.truth is not None and each.truth.depth_m is not None
    depths = each.truth.depth_m[~np.isnan(each.truth.depth_m)]
    np.testing.assert_allclose(depths, np.where(depths < 1.5, BOX_M, WALL_M), atol=1e-3)
    # The box's left edge, 11.5 px left of the centre, where the lens and fx = 80 put it.
    straight = cv2.undistortPoints(
        np.array([[[35.5, 35.5]]]),
        np.array([[80.0, 0, 47.5], [0, 84, 35.5], [0, 0, 1]]),
        np.array([0.1, 0, 0, 0]),
    )
    edge = int(np.argmax(each.truth.depth_m[36] < 1.5))
    assert edge == pytest.approx(82 * straight[0, 0, 0] + 47.5, abs=1)


def test_without_colours_nearness_is_shown(tmp_path: Path) -> None:
    recording = RgbdRecording(write_frames(tmp_path, n=2, colours=False))
    each = next(iter(recording))
    assert each.left[BOX].min() == 127 and each.left[70, 0] == 63 and each.left[UNKNOWN].max() == 0
    assert "no colour images: left pictures show how near things are" in list(recording.notes())


def test_noise_is_added_to_what_is_read_and_not_to_the_truth(frames: Path) -> None:
    recording = RgbdRecording(frames, noise_px=0.25, seed=3)
    first, second = list(recording)[:2]
    assert first.disparity is not None and second.disparity is not None and first.truth is not None
    errors = [each.disparity.disparity_px - 4.8 / depth_m() for each in (first, second)]  # type: ignore[union-attr]
    assert [np.nanstd(error) for error in errors] == pytest.approx([0.25, 0.25], rel=0.05)
    assert abs(np.corrcoef(*(error[~np.isnan(error)] for error in errors))[0, 1]) < 0.05
    np.testing.assert_allclose(first.truth.depth_m, depth_m(), atol=6e-4)
    again = next(recording.read([0])).disparity
    assert again is not None
    np.testing.assert_array_equal(again.disparity_px, first.disparity.disparity_px)


@pytest.mark.parametrize("wrong", [{"noise_px": -1.0}, {"seed": -1}, {"noise_px": np.nan}, {"baseline_m": 0.0}])
def test_a_rig_that_cannot_be_is_refused(frames: Path, wrong: dict[str, float]) -> None:
    with pytest.raises(InvalidInputError):
        RgbdRecording(frames, **wrong)  # type: ignore[arg-type]


def test_its_own_disparities_make_a_map_and_so_do_those_of_a_matcher(frames: Path) -> None:
    part = Selection(open_recording(frames), end_s=0.0)
    assert part.has_disparity
    at_m = part.poses[0] @ [0.0, 0, BOX_M, 1]
    for name, least in (("recorded", 0.8), ("sgbm", 0.5)):
        config = MappingConfig.for_camera(part.camera)
        mapped = build_map(part, MappingConfig(MatcherConfig(name, 16), config.model, grid=config.grid))
        assert mapped.grid.probability([at_m[:3]])[0] > least


def edit(name: str, change: Callable[[list[str]], list[str]]) -> Callable[[Path], object]:
    def apply(folder: Path) -> None:
        lines = (folder / name).read_text().splitlines()
        (folder / name).write_text("\n".join(change(lines)))

    return apply


def first(folder: Path, pattern: str) -> Path:
    return sorted(folder.glob(pattern))[1]


def claim_size(path: Path) -> None:
    encoded = bytearray(path.read_bytes())
    encoded[16:24] = (60000).to_bytes(4, "big") * 2
    path.write_bytes(encoded)


def lose(folder: Path) -> None:
    np.savetxt(first(folder, "*.pose.txt"), np.full((4, 4), -np.inf))


COUNTED: dict[str, tuple[Callable[[Path], Path], Callable[[Path], object], int, dict[str, int]]] = {
    "tum, a depth image is missing": (
        write_tum,
        lambda f: first(f, "depth/*.png").unlink(),
        4,
        {"pictures of depth.txt that are not there": 1, "colour images without a depth image": 1},
    ),
    "tum, a list is shorter": (
        write_tum,
        edit("rgb.txt", lambda lines: lines[:-1]),
        4,
        {"depth images without a colour image": 1},
    ),
    "tum, the trajectory ends early": (
        write_tum,
        edit("groundtruth.txt", lambda lines: lines[:6]),
        3,
        {"pairs where the ground truth does not reach": 2},
    ),
    "tum, a stamp is there twice": (
        write_tum,
        edit("rgb.txt", lambda lines: [*lines, lines[-1]]),
        5,
        {"pictures of rgb.txt with the stamp of an earlier one": 1},
    ),
    "frames, no colour": (
        write_frames,
        lambda f: first(f, "*.color.png").unlink(),
        5,
        {"depth images without a colour image": 1},
    ),
    "frames, no depth": (
        write_frames,
        lambda f: first(f, "*.depth.png").unlink(),
        5,
        {"colour images without a depth image": 1},
    ),
    "frames, no pose": (
        write_frames,
        lambda f: first(f, "*.pose.txt").unlink(),
        5,
        {"depth images without a pose": 1},
    ),
    "frames, lost": (write_frames, lose, 5, {"depth images whose pose is not finite: the camera was lost": 1}),
}


@pytest.mark.parametrize(("write", "spoil", "length", "counted"), COUNTED.values(), ids=COUNTED)
def test_what_has_no_partner_is_counted(
    tmp_path: Path,
    write: Callable[[Path], Path],
    spoil: Callable[[Path], object],
    length: int,
    counted: dict[str, int],
) -> None:
    folder = write(tmp_path)
    spoil(folder)
    recording = open_recording(folder)
    assert (len(recording), dict(recording.left_out)) == (length, counted)
    assert len(list(recording)) == length


WRONG: dict[str, tuple[Callable[[Path], Path], Callable[[Path], object], str]] = {
    "tum, NaN": (
        write_tum,
        edit("groundtruth.txt", lambda lines: [*lines[:3], lines[3].rsplit(" ", 1)[0] + " nan", *lines[4:]]),
        r"groundtruth\.txt:4: .*NaN",
    ),
    "tum, no trajectory": (write_tum, lambda f: (f / "groundtruth.txt").unlink(), r"groundtruth\.txt: no such file"),
    "tum, no unit quaternion": (
        write_tum,
        edit("groundtruth.txt", lambda lines: [*lines[:3], "1305031102.15 0 0 0 0 0 0 2", *lines[4:]]),
        r"groundtruth\.txt:4: the quaternion has the norm 2",
    ),
    "tum, another time": (
        write_tum,
        edit("groundtruth.txt", lambda lines: [x.replace("1305", "1405") for x in lines]),
        r"groundtruth\.txt: tells of no moment",
    ),
    "tum, no list of depths": (write_tum, lambda f: (f / "depth.txt").unlink(), r"depth\.txt: no such file"),
    "tum, a row of one word": (
        write_tum,
        edit("rgb.txt", lambda lines: [*lines, "1305031199.5"]),
        r"rgb\.txt:8: 1 words, expected two",
    ),
    "tum, a stamp that is none": (
        write_tum,
        edit("rgb.txt", lambda lines: [*lines, "noon rgb/noon.png"]),
        r"rgb\.txt:8: 'noon' is no stamp",
    ),
    "tum, out of the folder": (
        write_tum,
        edit("depth.txt", lambda lines: [*lines, "1305031199.5 ../../etc/depth.png"]),
        r"depth\.txt:7: \.\./\.\./etc/depth\.png is outside of the recording",
    ),
    "tum, names without end": (
        write_tum,
        edit("rgb.txt", lambda lines: [f"{line.split()[0]} {5000 * 'x'}.png" for line in lines if line[0] != "#"]),
        r"rgb\.txt: none of its pictures is there",
    ),
    "tum, no pictures": (
        write_tum,
        lambda f: (f / "rgb").rename(f / "away"),
        r"rgb\.txt: none of its pictures is there",
    ),
    "tum, no camera": (write_tum, lambda f: (f / "calibration.txt").unlink(), r"put a file camera-intrinsics\.txt"),
    "a camera of words": (
        write_tum,
        lambda f: (f / "calibration.txt").write_text("fx 80"),
        r"calibration\.txt:1: .*'fx'",
    ),
    "a camera of three numbers": (
        write_tum,
        lambda f: (f / "calibration.txt").write_text("80 47.5 35.5"),
        r"calibration\.txt: expected three rows",
    ),
    "a camera without focal length": (
        write_frames,
        lambda f: np.savetxt(f / "camera-intrinsics.txt", np.diag([0.0, 80, 1])),
        r"camera-intrinsics\.txt: .* is no matrix",
    ),
    "a distortion of three": (
        write_tum,
        lambda f: (f / "calibration.txt").write_text("80 80 47.5 35.5 .1 .2 .3"),
        r"calibration\.txt: \[0\.1, 0\.2, 0\.3\] is no distortion",
    ),
    "frames, not rigid": (
        write_frames,
        lambda f: np.savetxt(first(f, "*.pose.txt"), np.diag([1.1, 1, 1, 1])),
        r"frame-000010\.pose\.txt: the pose is no rotation",
    ),
    "frames, a pose of 12": (
        write_frames,
        lambda f: np.savetxt(first(f, "*.pose.txt"), np.eye(4)[:3]),
        r"frame-000010\.pose\.txt: 12 numbers, expected the 16",
    ),
    "frames, no pose at all": (
        write_frames,
        lambda f: [path.unlink() for path in f.glob("*.pose.txt")],
        r"no frame has a depth image and a pose: 6 depth images without a pose",
    ),
    "depth of 8 bits": (
        write_frames,
        lambda f: cv2.imwrite(str(first(f, "*.depth.png")), np.zeros((72, 96), np.uint8)),
        r"frame-000010\.depth\.png: not a depth image of one channel of 16 bits, but 1 channel of 8 bits",
    ),
    "depth in colours": (
        write_frames,
        lambda f: cv2.imwrite(str(first(f, "*.depth.png")), np.zeros((72, 96, 3), np.uint16)),
        r"3 channels of 16 bits",
    ),
    "depth as JPEG": (
        write_frames,
        lambda f: first(f, "*.depth.png").write_bytes(cv2.imencode(".jpg", np.zeros((72, 96), np.uint8))[1].tobytes()),
        r"frame-000010\.depth\.png: not a PNG image",
    ),
    "depth cut short": (
        write_tum,
        lambda f: first(f, "depth/*.png").write_bytes(first(f, "depth/*.png").read_bytes()[:90]),
        r"\.png: .*cut short",
    ),
    "depth of a size of its own": (
        write_frames,
        lambda f: cv2.imwrite(str(first(f, "*.depth.png")), np.zeros((7, 9), np.uint16)),
        r"frame-000010\.depth\.png: the image is 9 x 7 px",
    ),
    "colours of another size": (
        write_frames,
        lambda f: [cv2.imwrite(str(path), np.zeros((144, 192), np.uint8)) for path in f.glob("*.color.png")],
        r"frame-000000\.color\.png: .* they must be registered, pixel by pixel",
    ),
    "a size that is claimed": (
        write_frames,
        lambda f: claim_size(f / "frame-000000.depth.png"),
        r"frame-000000\.depth\.png: claims to be 60000 x 60000 px",
    ),
    "a size that is claimed later": (
        write_tum,
        lambda f: claim_size(first(f, "rgb/*.png")),
        r"the image is 60000 x 60000 px",
    ),
}


@pytest.mark.parametrize(("write", "spoil", "message"), WRONG.values(), ids=WRONG)
def test_what_is_wrong_is_named_in_one_line(
    tmp_path: Path, write: Callable[[Path], Path], spoil: Callable[[Path], object], message: str
) -> None:
    folder = write(tmp_path)
    spoil(folder)
    with pytest.raises(RecordingError, match=message) as caught:
        list(open_recording(folder))
    assert "\n" not in str(caught.value)


def test_depth_numbers_of_the_helper_have_both_kinds_of_unknown() -> None:
    assert depth_numbers(1000)[UNKNOWN].max() == 0 and depth_numbers(1000, 65535)[UNKNOWN].min() == 65535


def test_the_real_room_stands_upright() -> None:
    data = os.environ.get("STEREOGRID_DATA")
    if not data:
        pytest.skip("needs the data set sequences/rgbd_7scenes: set STEREOGRID_DATA to shared/data")
    recording = open_recording(Path(data) / "sequences" / "rgbd_7scenes")
    assert len(recording) == 100 and recording.camera.focal_px == 585
    # Surfaces that are nearly level are level on average, to 4 degrees, though the file's world is 27 degrees off.
    normals = np.concatenate([_normals(recording, number) for number in range(0, 100, 10)])
    level = normals[abs(normals[:, 2]) > np.cos(np.radians(12))]
    mean = (level * np.sign(level[:, 2:])).mean(axis=0)
    assert len(level) > 0.08 * len(normals)
    assert np.degrees(np.arccos(mean[2] / np.linalg.norm(mean))) < 4


def _normals(recording: RgbdRecording, number: int) -> np.ndarray:
    (each,) = recording.read([number])
    assert each.truth is not None and each.truth.depth_m is not None
    points = (recording.camera.ray_directions * each.truth.depth_m[..., None])[::8, ::8]
    normals = np.cross(points[:-1, 1:] - points[:-1, :-1], points[1:, :-1] - points[:-1, :-1]).reshape(-1, 3)
    normals = normals[np.isfinite(normals).all(axis=1)]
    return normals / np.linalg.norm(normals, axis=1, keepdims=True) @ each.T_world_cam[:3, :3].T
