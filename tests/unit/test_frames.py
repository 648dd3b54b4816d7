"""Synthetic frames: as many pixels and as noisy as they say, of the corridor that they say, every time the same."""

from dataclasses import replace

import numpy as np
import pytest

from experiments.frames import (
    BASELINE_M,
    MISSING,
    PERIOD_M,
    STEP_PX,
    Frames,
    FramesConfig,
    corridor_mesh,
    depth_images_m,
    make_frames,
)
from stereogrid.errors import InvalidInputError
from stereogrid.scoring.labels import FREE, OCCUPIED

SMALL = FramesConfig(width_px=160, n=6)


@pytest.fixture(scope="module")
def frames() -> Frames:
    return make_frames(FramesConfig(n=10, spacing_m=3.0))


def test_a_frame_has_64_000_valid_pixels(frames):
    valid = np.isfinite(frames.disparities_px).sum(axis=(1, 2))
    assert frames.disparities_px.shape == (10, 240, 320)
    assert valid.mean() == pytest.approx(64_000, abs=2000)


def test_the_camera_is_45_degrees_across_with_a_baseline_of_6_cm(frames):
    assert frames.camera.focal_px == pytest.approx(386.3, abs=0.1)
    assert frames.camera.baseline_m == BASELINE_M


def test_the_noise_has_its_sigma_is_rounded_and_depends_on_no_neighbour(frames):
    depth_m = np.array(list(depth_images_m(frames.mesh, frames.camera, frames.poses)))
    error_px = frames.disparities_px - frames.camera.disparity_px(depth_m)
    known = np.isfinite(error_px)
    assert np.nanstd(error_px) == pytest.approx(np.hypot(0.25, STEP_PX / np.sqrt(12)), rel=0.005)
    assert abs(np.nanmean(error_px)) < 0.002
    pairs = known[:, :, 1:] & known[:, :, :-1]
    assert abs(np.corrcoef(error_px[:, :, 1:][pairs], error_px[:, :, :-1][pairs])[0, 1]) < 0.01
    assert (frames.disparities_px[known] % STEP_PX == 0).all()


def test_missing_are_the_depths_beyond_the_range_and_a_few_at_random(frames):
    depth_m = np.array(list(depth_images_m(frames.mesh, frames.camera, frames.poses)))
    missing = np.isnan(frames.disparities_px)
    assert missing[depth_m > 8.0].all()
    assert missing[depth_m <= 8.0].mean() == pytest.approx(MISSING, abs=0.002)


def test_the_same_config_gives_the_same_bytes_and_another_seed_others():
    first, again, other = (make_frames(config) for config in (SMALL, SMALL, replace(SMALL, seed=1)))
    assert first.disparities_px.tobytes() == again.disparities_px.tobytes()
    assert first.mesh.vertices.tobytes() == again.mesh.vertices.tobytes()
    assert not np.array_equal(first.disparities_px, other.disparities_px, equal_nan=True)
    assert not np.array_equal(first.mesh.vertices, other.mesh.vertices)


def test_the_first_frames_of_a_longer_drive_are_those_of_a_shorter_one():
    short, long = make_frames(SMALL), make_frames(replace(SMALL, n=8))
    np.testing.assert_array_equal(long.disparities_px[:6], short.disparities_px)


def test_depths_are_those_of_the_mesh():
    # Beside the furniture and the poles: walls, floor and ceiling in closed form.
    mesh, camera, pose = corridor_mesh(SMALL), SMALL.camera, SMALL.poses[:1]
    depth_m = next(depth_images_m(mesh, camera, pose))
    rays = camera.ray_directions @ pose[0, :3, :3].T
    low, high = np.array([-2.0, -1.15, 0.0137]), np.array([18.8, 1.15, 2.3637])
    with np.errstate(divide="ignore"):
        to_shell = np.maximum((low - pose[0, :3, 3]) / rays, (high - pose[0, :3, 3]) / rays).min(axis=-1)
    assert (depth_m <= to_shell + 1e-4).all()
    assert 0.5 < np.isclose(depth_m, to_shell, atol=1e-4).mean() < 1


def test_the_corridor_repeats_itself_so_shifted_frames_are_those_of_a_longer_drive():
    config = FramesConfig(width_px=80, n=2, spacing_m=PERIOD_M)
    mesh, pose = corridor_mesh(config), SMALL.poses[3]
    shifted = pose.copy()
    shifted[0, 3] += PERIOD_M
    here, there = depth_images_m(mesh, config.camera, np.array([pose, shifted]))
    near = here < 16
    np.testing.assert_array_equal(there < 16, near)
    np.testing.assert_allclose(there[near], here[near], atol=1e-3)


@pytest.mark.parametrize("aligned", [False, True])
@pytest.mark.parametrize("seed", range(5))
def test_the_camera_never_stands_in_anything(aligned, seed):
    config = replace(SMALL, n=300, spacing_m=0.1, aligned=aligned, seed=seed)
    eyes_m = config.poses[:, None, :3, 3]
    low, high = np.array([part.bounds for part in corridor_mesh(config).split()]).transpose(1, 0, 2)
    assert not ((eyes_m > low - 0.1) & (eyes_m < high + 0.1)).all(axis=2).any()


def test_every_part_of_the_corridor_is_closed_and_an_aligned_one_lies_on_borders_of_cells():
    assert all(part.is_watertight for part in corridor_mesh(SMALL).split(only_watertight=False))
    lattice = corridor_mesh(replace(SMALL, aligned=True)).vertices[:, 1:] / 0.1
    poles = np.abs(lattice - np.round(lattice)).max(axis=1) > 1e-6
    assert poles.mean() < 0.3


def test_the_truth_labels_the_corridor():
    truth = make_frames(SMALL).truth(0.1)
    seen = truth.visible.mask
    assert seen[truth.labels.label == OCCUPIED].any()
    assert seen[truth.labels.label == FREE].any()
    assert 0.05 < (truth.labels.label[seen] == OCCUPIED).mean() < 0.4


def test_a_frame_carries_its_sigma(frames):
    disparity, pose = next(iter(frames))
    assert (disparity.sigma_px == np.float32(0.25)).all()
    np.testing.assert_array_equal(pose, frames.poses[0])


@pytest.mark.parametrize("wrong", [{"n": 0}, {"sigma_px": np.nan}, {"range_m": 17.0}, {"seed": -1}])
def test_nonsense_is_refused_by_name(wrong):
    with pytest.raises(InvalidInputError, match=next(iter(wrong))):
        FramesConfig(**wrong)
