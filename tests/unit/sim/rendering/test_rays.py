"""Rays of any kind: they see what pictures show; mirrors and glass show what geometry says; rows may move."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

pytest.importorskip("embreex")

from boards import FRONT_M, HALF_M, SQUARES, board_world
from open_air import open_air

from sim.rendering.render import Renderer, View
from sim.rig import MINORU, StereoRig
from sim.scene.scene import Sky, World
from sim.scene.solids import Paint, Solid, box
from sim.scene.textures import Texture
from stereogrid.errors import InvalidInputError
from stereogrid.geometry import FloatArray, from_yaw, inverse, transform

EYE = StereoRig().T_base_cam
SMALL = replace(MINORU, focal_px=417.0, cx_px=159.5, cy_px=119.5, width_px=320, height_px=240)
LOOKS = {
    "mirror": Texture(np.zeros((64, 64), np.uint8), gloss=1.0),
    "varnish": Texture(np.full((64, 64), 100, np.uint8), gloss=0.04),
    "pane": Texture(np.zeros((64, 64), np.uint8), clear=True),
    "dust": Texture(np.full((64, 64), 100, np.uint8), clear=True),
    "bare": Texture(np.full((64, 64), 100, np.uint8)),
}


@pytest.fixture(scope="module")
def renderer() -> Renderer:
    return Renderer(open_air(80))


def with_things(world: World, *solids: Solid, **more) -> World:
    return replace(world, solids=(*world.solids, *solids), textures={**world.textures, **LOOKS}, **more)


def found_corners(gray: np.ndarray, expected: FloatArray) -> FloatArray:
    gray = cv2.GaussianBlur(gray, (0, 0), 1.5)
    start = expected.astype(np.float32).reshape(-1, 1, 2)
    return cv2.cornerSubPix(gray, start.copy(), (6, 6), (-1, -1), (3, 50, 1e-4)).reshape(-1, 2)


def inner_corners(T_world_board: FloatArray) -> FloatArray:
    inner = np.linspace(-HALF_M, HALF_M, SQUARES + 1)[1:-1]
    return transform(T_world_board, np.array([(FRONT_M, y, z) for y in inner for z in inner]))


def inside(expected: FloatArray, view: View) -> FloatArray:
    return expected[((expected > 20) & (expected < np.array(view.gray.shape[::-1]) - 20)).all(axis=1)]


def test_rays_of_a_pinhole_see_its_picture(renderer: Renderer) -> None:
    T = from_yaw(0.4, [-3.0, -3.0, 0.6]) @ EYE
    view = renderer.view(SMALL, T, supersampling=1, time_s=1.0)
    directions = (SMALL.ray_directions @ T[:3, :3].T).reshape(-1, 3)
    pixel = (T[:3, 0] / SMALL.focal_px, T[:3, 1] / SMALL.focal_px)
    hits = renderer.trace(np.tile(T[:3, 3], (len(directions), 1)), directions, pixel=pixel, time_s=1.0)
    faces = hits.faces.reshape(SMALL.shape)
    assert (faces == view.faces).mean() >= 0.9999
    same = faces == view.faces
    off = np.abs(hits.gray.reshape(SMALL.shape) - view.gray)[same]
    # Neighbours in a picture share a footprint, which shows by a level or so.
    assert off.mean() < 0.5 and (off > 8).mean() < 1e-3
    depth = hits.depth.reshape(SMALL.shape)
    np.testing.assert_array_equal(np.isnan(depth), faces < 0)
    hit = same & (faces >= 0)
    assert np.abs(depth / view.depth_m - 1)[hit].max() <= 1e-6


def test_depth_is_counted_in_lengths_of_the_direction(renderer: Renderer) -> None:
    origins, down = np.tile([0.3, 0.2, 2.0], (2, 1)), np.array([[0.0, 0.0, -1.0], [0.0, 0.0, -4.0]])
    depth = renderer.trace(origins, down).depth
    assert depth[0] == pytest.approx(4 * depth[1], rel=1e-12)


@pytest.mark.parametrize("supersampling", [1, "edges"])
def test_rows_with_one_pose_make_the_picture_of_that_pose(renderer: Renderer, supersampling: int | str) -> None:
    T = from_yaw(0.4, [-3.0, -3.0, 0.6]) @ EYE
    view = renderer.view(SMALL, T, supersampling=supersampling, time_s=1.0)
    rows = renderer.view_rows(SMALL, np.tile(T, (240, 1, 1)), supersampling=supersampling, time_s=1.0)
    same = rows.faces == view.faces
    assert same.mean() >= 0.9999
    off = np.abs(rows.gray.astype(int) - view.gray)[same]
    assert off.mean() < 0.5 and (off > 8).mean() < 0.01


def test_each_row_is_seen_from_its_own_pose(renderer: Renderer) -> None:
    poses = np.array([from_yaw(0.4 + 0.001 * y, [-3.0, -3.0, 0.6]) @ EYE for y in range(240)])
    rows = renderer.view_rows(SMALL, poses, supersampling=1)
    for y in (10, 120, 230):
        still = renderer.view(SMALL, poses[y], supersampling=1)
        assert (rows.faces[y] == still.faces[y]).mean() >= 0.99
        assert np.median(np.abs(rows.gray[y].astype(int) - still.gray[y])) <= 1
    with pytest.raises(InvalidInputError, match=r"\(240, 4, 4\)"):
        renderer.view_rows(SMALL, poses[:-1])


@pytest.mark.parametrize("yaw", [0.0, 0.25])
def test_a_mirror_shows_the_mirrored_board(yaw: float) -> None:
    # The board is behind the camera and faces the mirror ahead of it.
    T_world_board = from_yaw(np.pi, [-2.2, 0.15, 0.5])
    T_world_mirror = from_yaw(yaw / 2, [1.4, 0.0, 0.4])
    mirror = box("mirror", (0.0, -2.0, -2.0), (0.02, 2.0, 2.0), Paint("mirror"), T_world_box=T_world_mirror)
    renderer = Renderer(with_things(board_world(T_world_board), mirror))
    normal, point = T_world_mirror[:3, 0], T_world_mirror[:3, 3]
    corners = inner_corners(T_world_board)
    mirrored = corners - 2 * ((corners - point) @ normal)[:, None] * normal
    for T_world_cam in (EYE, StereoRig().right_of(EYE)):
        view = renderer.view(MINORU, T_world_cam)
        expected = inside(MINORU.project(transform(inverse(T_world_cam), mirrored))[:, :2], view)
        assert len(expected) >= 15
        assert np.linalg.norm(found_corners(view.gray, expected) - expected, axis=1).max() <= 0.2
        # The mirror itself is as far as it is.
        axis = normal @ T_world_cam[:3, 2]
        ahead = (point - T_world_cam[:3, 3]) @ normal / axis
        assert view.depth_m[240, 320] == pytest.approx(ahead, rel=2e-3)


def test_a_pane_is_an_obstacle_that_shows_what_is_behind() -> None:
    T_world_board = from_yaw(0.2, [2.6, 0.1, 0.45])
    world = board_world(T_world_board)
    pane = box("pane", (1.2, -1.0, -1.0), (1.21, 1.0, 1.5), Paint("pane"))
    bare, glazed = (Renderer(w).view(MINORU, EYE) for w in (world, with_things(world, pane)))
    facing = np.abs(MINORU.ray_directions[..., 0]) < 0.2
    assert np.abs(glazed.depth_m[facing] / 1.1 - 1).max() <= 1e-6
    # Head-on Fresnel takes next to nothing where gloss is 0.
    assert np.abs(glazed.gray.astype(int) - bare.gray)[facing].mean() < 1
    expected = inside(MINORU.project(transform(inverse(EYE), inner_corners(T_world_board)))[:, :2], bare)
    assert np.linalg.norm(found_corners(glazed.gray, expected) - expected, axis=1).max() <= 0.1


def test_dirt_on_a_pane_shines_and_hides() -> None:
    world = replace(board_world(from_yaw(0.0, [2.6, 0.0, 0.4])), sky=Sky())
    views = [
        Renderer(with_things(world, box("pane", (1.2, -1.0, -1.0), (1.21, 1.0, 1.5), Paint(look)))).view(MINORU, EYE)
        for look in ("pane", "dust")
    ]
    middle = (slice(200, 280), slice(280, 360))
    assert views[1].gray[middle].min() > views[0].gray[middle].min() + 20
    assert np.ptp(views[1].gray[middle].astype(int)) < 0.9 * np.ptp(views[0].gray[middle].astype(int))


def test_varnish_mirrors_the_sky_more_at_grazing_angles() -> None:
    slant = np.array([1.5, 0.3, 0.1])
    directions = np.column_stack([np.cos(slant), 0 * slant, -np.sin(slant)])

    def brightness(look: str) -> np.ndarray:
        board = box("board", (-1.0, -0.5, -0.1), (6.0, 0.5, 0.0), Paint(look))
        world = World("board", 0, (board,), LOOKS, (), np.array([[0.0, 0.0], [1.0, 0.0]]), sky=Sky())
        return Renderer(world).trace(np.tile([0.0, 0.0, 0.5], (3, 1)), directions).gray

    gain = brightness("varnish") - brightness("bare")
    assert 0 < gain[0] < gain[1] < gain[2]


def test_reflections_and_what_is_behind_glass_may_move() -> None:
    world = open_air(20)
    walker = world.movers[0]
    T_world_mirror = from_yaw(0.0, [7.0, 0.0, 0.0])
    mirror = box("big mirror", (0.0, -3.0, -0.5), (0.02, 3.0, 3.0), Paint("mirror"), T_world_box=T_world_mirror)
    renderer = Renderer(with_things(world, mirror))
    # At 2 s it stands at y = 0; seen from aside, its mirrored middle is at x = 10.
    T = from_yaw(0.25, [1.0, -1.5, 0.0]) @ EYE
    first, second = (renderer.view(MINORU, T, time_s=t) for t in (2.0, 1e-3))
    assert walker.T_world_mover(2.0)[1, 3] == pytest.approx(0.0)
    x, y = MINORU.project(transform(inverse(T), [[10.15, 0.0, 0.6]]))[0, :2].round().astype(int)
    window = (slice(y - 3, y + 4), slice(x - 3, x + 4))
    assert (renderer.objects(first.faces)[window] == renderer.object_names.index("big mirror")).all()
    assert np.abs(first.gray[window].astype(int) - second.gray[window]).mean() > 15


def test_rays_must_come_in_pairs(renderer: Renderer) -> None:
    with pytest.raises(InvalidInputError, match=r"\(N, 3\)"):
        renderer.trace(np.zeros((2, 3)), np.zeros((3, 3)))
