"""The real worlds of the fusion experiment, on made ones: a wall seen by two cameras, a wall seen by a depth camera."""

import math
from contextlib import contextmanager

import cv2
import numpy as np
import pytest

from experiments.fusion import FusionConfig, compare_real
from experiments.fusion_arms import CLAMPS, OF_INDEPENDENT, OF_MATCHERS, Arm
from experiments.fusion_room import RoomConfig, compare_in_room, noisy, read_depths
from experiments.fusion_street import StreetConfig, compare_on_street
from stereogrid.camera import StereoCamera
from stereogrid.errors import RecordingError, StereogridError
from stereogrid.geometry import R_BASE_OPTICAL, from_rotation, from_yaw
from stereogrid.grid import OccupancyGrid
from stereogrid.observation import Disparity, Observation, Odometry
from stereogrid.scoring.held_out import HELD_OUT_NAMES

WALL_M = 2.0
SHIFT_PX = 9


@contextmanager
def silent(what, total):
    yield lambda: None


def values(compared, arm, name):
    return compared.values(arm, f"held_out_{name}")


class Street:
    """A textured wall WALL_M ahead of a camera that stands still."""

    camera = StereoCamera(focal_px=120, cx_px=79.5, cy_px=49.5, baseline_m=0.15, width_px=160, height_px=100)
    T_base_cam = from_rotation(R_BASE_OPTICAL)

    def __init__(self, n):
        self.n = n

    def __len__(self):
        return self.n

    def __iter__(self):
        rng = np.random.default_rng(0)
        wall = cv2.GaussianBlur(rng.integers(0, 256, (100, 160 + SHIFT_PX), dtype=np.uint8), (0, 0), 1.0)
        left, right = (np.ascontiguousarray(wall[:, start : start + 160]) for start in (0, SHIFT_PX))
        for k in range(self.n):
            yield Observation(float(k), left, right, Odometry(np.eye(4)), self.T_base_cam)


STREET = StreetConfig(num_disparities=32, cell_m=0.1, max_range_m=4.0, rays=50)


def test_every_other_pair_of_the_street_scores_the_map_of_the_rest():
    found = compare_on_street(Street(5), STREET, silent)
    assert [each.name for each in found] == ["Street, bm", "Street, sgbm"]
    for each in found:
        assert list(each.scores) == list(OF_MATCHERS) and each.n_units == 2 and each.reference in each.scores
        assert set(each.shown) == set(HELD_OUT_NAMES)
        assert min(values(each, "measured", "auc")) > 0.99
        assert min(values(each, "measured", "occupied_recall")) > 0.9


def test_a_street_of_one_pair_is_refused():
    with pytest.raises(RecordingError, match="single pair"):
        compare_on_street(Street(1), STREET, silent)


def write_room(folder, n=4, depth_mm=1000 * WALL_M):
    """Depths of a wall that a turning camera stands before; some of them missing."""
    folder.mkdir(parents=True)
    camera = RoomConfig().camera
    for k in range(n):
        T = from_yaw(0.02 * k) @ from_rotation(R_BASE_OPTICAL)
        toward = camera.ray_directions @ T[:3, :3].T
        depth = depth_mm / toward[..., 0]
        depth[:20] = 0
        cv2.imwrite(str(folder / f"frame-{k:06d}.depth.png"), depth.astype(np.uint16))
        np.savetxt(folder / f"frame-{k:06d}.pose.txt", T, fmt="%.3f")  # rounded as real ones are
    return folder


@pytest.fixture(scope="module")
def room(tmp_path_factory):
    folder = tmp_path_factory.mktemp("room")
    write_room(folder / "frames")
    write_room(folder / "heldout_depth", n=2)
    return folder


def test_the_room_is_mapped_with_noise_and_scored_by_other_frames(room):
    config = RoomConfig(cell_m=0.1, every=1, n_seeds=2, rays=50)
    found = compare_in_room(room, config, silent)
    assert list(found.scores) == list(OF_INDEPENDENT) and found.n_units == 2 and found.reference == "1 px"
    for arm in ("1 px", "one look"):
        assert min(values(found, arm, "auc")) > 0.98
        assert len(set(values(found, arm, "log_likelihood"))) == 2  # seeds differ


def test_depths_are_read_in_metres_with_rigid_poses(room):
    frames = list(read_depths(room / "frames"))
    assert len(frames) == 4
    assert np.isnan(frames[0].depth_m[:20]).all() and frames[0].depth_m[20:] == pytest.approx(WALL_M, abs=1e-3)
    rotation = frames[3].T_world_cam[:3, :3]
    assert rotation @ rotation.T == pytest.approx(np.eye(3), abs=1e-12)


def test_noise_of_the_virtual_rig_is_as_it_says(room):
    config, frame = RoomConfig(sigma_px=0.25), next(read_depths(room / "frames"))
    disparity = noisy(config, frame, np.random.default_rng(0)).disparity
    error_px = disparity.disparity_px - config.camera.disparity_px(frame.depth_m)
    assert np.nanstd(error_px) == pytest.approx(0.25, rel=0.02)
    assert disparity.correlation_px == 1 and disparity.sigma_px.max() == pytest.approx(0.25)


@pytest.mark.parametrize(
    "pose", ["", "1 2 3", "nan " * 16, "1 0 0 0 0 1 0 0 0 0 2 0 0 0 0 1", "-1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1"]
)
@pytest.mark.filterwarnings("ignore:loadtxt")
def test_a_pose_that_is_none_is_named(tmp_path, pose):
    write_room(tmp_path / "frames", n=1)
    path = tmp_path / "frames" / "frame-000000.pose.txt"
    path.write_text(pose)
    with pytest.raises(RecordingError, match=r"frame-000000\.pose\.txt"):
        list(read_depths(tmp_path / "frames"))


def test_a_depth_image_that_is_none_is_named(tmp_path):
    write_room(tmp_path / "frames", n=1)
    path = tmp_path / "frames" / "frame-000000.depth.png"
    path.write_bytes(b"nothing")
    with pytest.raises(RecordingError, match=r"frame-000000\.depth\.png"):
        list(read_depths(tmp_path / "frames"))


def test_an_empty_room_is_refused_and_a_missing_one_is_said_to_be_missing(tmp_path):
    compared, skipped = compare_real(None, FusionConfig(), silent)
    assert compared == [] and len(skipped) == 2 and "kitti_straight" in skipped[0] and "rgbd_7scenes" in skipped[1]
    (tmp_path / "sequences" / "rgbd_7scenes").mkdir(parents=True)
    with pytest.raises(RecordingError, match="heldout_depth"):
        compare_real(tmp_path, FusionConfig(), silent)


def test_an_arm_changes_the_correlation_length_and_nothing_else():
    disparity = Disparity(np.full((3, 4), 5.0), 0.25, correlation_px=20.0)
    assert Arm().seen(disparity) is disparity
    for length in (1.0, math.inf):
        seen = Arm(length).seen(disparity)
        assert seen.correlation_px == length
        assert (seen.disparity_px == disparity.disparity_px).all() and (seen.sigma_px == disparity.sigma_px).all()


@pytest.mark.parametrize("clamp", CLAMPS.values(), ids=CLAMPS)
def test_every_clamp_is_one_that_the_grid_takes(clamp):
    low, high = OccupancyGrid(0.1, clamp=clamp).clamp or (-math.inf, math.inf)
    assert low < 0 < high


@pytest.mark.parametrize(
    ("wrong", "named"),
    [
        ({"camera_faults": "foggy"}, "foggy.*mild"),
        ({"n_seeds": 0}, "n_seeds"),
        ({"frame_seeds": -1}, "frame_seeds"),
        ({"matchers": ()}, "matchers"),
        ({"matchers": ("sgmb",)}, "sgmb"),
        ({"matchers": ("bm",), "clamps_of": "gc"}, "no matcher on the drive named 'gc'"),
    ],
)
def test_a_wrong_parameter_is_named_before_anything_is_done(wrong, named):
    with pytest.raises(StereogridError, match=named):
        FusionConfig(**wrong)


@pytest.mark.parametrize(
    ("kind", "wrong"),
    [
        (StreetConfig, {"matchers": ()}),
        (StreetConfig, {"matchers": ("sgmb",)}),
        (StreetConfig, {"most_pairs": 1}),
        (StreetConfig, {"rays": 0}),
        (RoomConfig, {"every": 0}),
        (RoomConfig, {"sigma_px": 0.0}),
    ],
)
def test_a_wrong_parameter_of_a_real_world_is_refused(kind, wrong):
    with pytest.raises(StereogridError):
        kind(**wrong)
