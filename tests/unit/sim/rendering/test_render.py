"""The renderer is a pinhole camera: where things are in the picture, how far, and that left and right agree."""

import cv2
import numpy as np
import pytest

pytest.importorskip("embreex")

from boards import FRONT_M, HALF_M, SQUARES, board_world, tilted
from cast import cast_rays

from sim.rendering.render import Renderer
from sim.rig import MINORU, StereoRig
from sim.scene.scene import World
from sim.worlds.world import make_world
from stereogrid.geometry import from_yaw, inverse, transform


@pytest.mark.parametrize(("distance_m", "yaw"), [(2.2, 0.0), (2.5, 0.4), (4.0, -0.5)])
def test_corners_of_a_board_appear_where_the_pinhole_camera_puts_them(distance_m: float, yaw: float) -> None:
    rig, T_world_board = StereoRig(), tilted(distance_m, yaw)
    gray = Renderer(board_world(T_world_board)).view(MINORU, rig.T_base_cam).gray
    inner = np.linspace(-HALF_M, HALF_M, SQUARES + 1)[1:-1]
    corners = np.array([(FRONT_M, y, z) for y in inner for z in inner])
    expected = MINORU.project(transform(inverse(rig.T_base_cam) @ T_world_board, corners))[:, :2]
    inside = ((expected > 20) & (expected < np.array(gray.shape[::-1]) - 20)).all(axis=1)
    expected = expected[inside].astype(np.float32)
    # The corner finder wants soft edges; a symmetric blur moves no corner.
    gray = cv2.GaussianBlur(gray, (0, 0), 1.5)
    found = cv2.cornerSubPix(gray, expected.reshape(-1, 1, 2).copy(), (6, 6), (-1, -1), (3, 50, 1e-4)).reshape(-1, 2)
    errors = found - expected
    assert len(expected) >= 25
    assert np.linalg.norm(errors, axis=1).max() <= 0.1
    assert np.abs(errors.mean(axis=0)).max() <= 0.02


@pytest.mark.parametrize("yaw", [0.0, 0.5])
def test_depth_of_a_plane_is_exact(yaw: float) -> None:
    rig, T_world_board = StereoRig(), tilted(2.2, yaw)
    depth_m = Renderer(board_world(T_world_board)).view(MINORU, rig.T_base_cam).depth_m
    T_cam_board = inverse(rig.T_base_cam) @ T_world_board
    normal, point = T_cam_board[:3, 0], transform(T_cam_board, [FRONT_M, 0.0, 0.0])
    expected = (normal @ point) / (MINORU.ray_directions @ normal)
    # Well inside the board, where its thin sides cannot be seen.
    at = transform(inverse(T_cam_board), MINORU.ray_directions * expected[..., None])
    inside = (np.abs(at[..., 1:]) < HALF_M - 0.01).all(axis=-1)
    assert inside.mean() > 0.2
    assert np.abs(depth_m[inside] / expected[inside] - 1).max() <= 1e-6


@pytest.mark.parametrize(
    "place", [(0.0, 2.0, 0.0), (0.2, 8.0, 0.1), (1.0, 17.3, 0.3), (1.7, 17.4, 6.0), (2.4, 10.0, 0.6)]
)
def test_pixels_see_the_faces_that_rays_meet(
    corridor: World, renderer: Renderer, place: tuple[float, float, float]
) -> None:
    yaw, x, y = place
    T_world_cam = from_yaw(yaw, [x, y, 0.0]) @ StereoRig().T_base_cam
    expected, expected_m = cast_rays(corridor, T_world_cam)
    faces, depth_m = renderer.faces(MINORU, T_world_cam), renderer.view(MINORU, T_world_cam).depth_m
    assert (faces == expected).mean() >= 0.9999
    # A pixel on the very border of a face may see past it; any other must not.
    inside = cv2.dilate(faces.astype(np.float32), np.ones((3, 3))) == cv2.erode(
        faces.astype(np.float32), np.ones((3, 3))
    )
    assert inside.mean() > 0.8
    assert np.abs(depth_m / expected_m - 1)[inside].max() <= 1e-6


def test_depth_is_missing_where_nothing_is_hit() -> None:
    view = Renderer(board_world(tilted(4.0, 0.0))).view(MINORU, StereoRig().T_base_cam)
    assert np.isnan(view.depth_m[0, 0])
    assert view.gray[0, 0] == 0


def test_left_warped_by_true_depth_is_the_right_picture(renderer: Renderer) -> None:
    left, right = StereoRig().look(renderer, from_yaw(0.2, [8.0, 0.1, 0.0]))
    warped, seen = warp_right_to_left(left.depth_m, right)
    residual = np.abs(warped - left.gray)[seen]
    assert np.median(residual) <= 1.5
    assert np.quantile(residual, 0.9) <= 5


def test_there_is_no_vertical_disparity(renderer: Renderer) -> None:
    left, right = StereoRig().look(renderer, from_yaw(0.2, [8.0, 0.1, 0.0]))
    warped, seen = warp_right_to_left(left.depth_m, right)
    a, b = left.gray.astype(np.float64), warped.astype(np.float64)
    # One Gauss-Newton step for a common shift in y: the residual against the picture's slope.
    slope = np.gradient((a + b) / 2, axis=0)
    used = seen & (np.abs(a - b) < 20)
    assert abs((slope * (b - a))[used].sum() / (slope**2)[used].sum()) <= 0.01


def test_a_hair_of_motion_changes_the_picture_a_hair(renderer: Renderer) -> None:
    rig = StereoRig()
    here = renderer.view(MINORU, from_yaw(0.0, [5.0, 0.0, 0.0]) @ rig.T_base_cam).gray.astype(int)
    there = renderer.view(MINORU, from_yaw(0.0002, [5.0, 0.0, 0.0]) @ rig.T_base_cam).gray.astype(int)
    assert np.abs(here - there).mean() < 1.5


def test_the_same_world_gives_the_same_picture(renderer: Renderer) -> None:
    again = Renderer(make_world("corridor", 0))
    first, second = (r.view(MINORU, StereoRig().T_base_cam) for r in (renderer, again))
    assert first.gray.tobytes() == second.gray.tobytes()
    assert first.depth_m.tobytes() == second.depth_m.tobytes()


def test_block_matching_finds_the_true_disparity(renderer: Renderer) -> None:
    left, right = StereoRig().look(renderer, from_yaw(0.0, [2.0, 0.0, 0.0]))
    pad = [cv2.copyMakeBorder(image, 0, 0, 96, 0, cv2.BORDER_REPLICATE) for image in (left.gray, right)]
    found = cv2.StereoBM.create(96, 9).compute(*pad)[:, 96:] / 16.0
    off = np.abs(found - MINORU.disparity_px(left.depth_m))[found > 0]
    assert (found > 0).mean() > 0.6
    assert (off > 1).mean() < 0.03


def warp_right_to_left(depth_m: np.ndarray, right: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The right image seen from the left by true depth, and where it must agree: seen by both, away from edges."""
    x, y = np.meshgrid(np.arange(MINORU.width_px, dtype=np.float32), np.arange(MINORU.height_px, dtype=np.float32))
    d = MINORU.disparity_px(depth_m).astype(np.float32)
    warped = cv2.remap(right.astype(np.float32), x - d, y, cv2.INTER_CUBIC)
    spread = cv2.dilate(d, np.ones((3, 41))) - cv2.erode(d, np.ones((3, 41)))
    return warped, (x - d > 2) & (spread < 4)
