"""Under a sky: what rays miss, where shadows fall, that hills have no facets, that what moves is where it should be."""

import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from hashlib import sha256
from pathlib import Path

import cv2
import numpy as np
import pytest

pytest.importorskip("embreex")

from cast import cast_rays
from open_air import SKY, SUN, open_air

from sim.rendering.render import Renderer
from sim.rendering.shapes import Actor
from sim.rig import MINORU, StereoRig, mount
from sim.scene.movers import Mover
from sim.scene.scene import Sky, World
from sim.scene.solids import Paint, box
from sim.scene.terrain import Terrain
from sim.scene.textures import Texture
from stereogrid.errors import InvalidInputError
from stereogrid.geometry import FloatArray, from_yaw, inverse, transform

RIG = StereoRig()
PLAIN = {"plain": Texture(np.full((64, 64), 128, np.uint8)), "dark": Texture(np.full((64, 64), 20, np.uint8))}
PATH = np.array([[0.0, 0.0], [5.0, 0.0]])
FLAT = Terrain(np.zeros((41, 41)), (-10.0, -10.0), 0.5, "plain")


def down_from(height_m: float, x: float = 2.0, y: float = 0.0) -> FloatArray:
    """A camera that looks straight down, with the picture's top towards +x."""
    T = np.eye(4)
    T[:3, :3] = np.array([[0.0, -1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    T[:3, 3] = x, y, height_m
    return T


def plain_world(*solids, terrain: Terrain = FLAT, **more) -> World:
    more = {"sky": Sky(sun_direction=tuple(SUN), sun_power=1.3), **more}
    return World("plain", 0, (terrain.solid(), *solids), PLAIN, (), PATH, terrain=terrain, **more)


@pytest.fixture(scope="module")
def world() -> World:
    return open_air()


@pytest.fixture(scope="module")
def renderer(world: World) -> Renderer:
    return Renderer(world)


@pytest.fixture(scope="module")
def still(world: World) -> Renderer:
    """The same world without what moves."""
    return Renderer(replace(world, movers=()))


@pytest.mark.parametrize("place", [(0.0, 0.0, 0.0), (0.5, 3.0, -1.0), (-2.5, 4.0, 2.0), (1.4, -3.0, -3.0)])
def test_pixels_see_what_rays_meet_on_hills_and_in_leaves(
    world: World, still: Renderer, place: tuple[float, float, float]
) -> None:
    yaw, x, y = place
    T_world_cam = from_yaw(yaw, [x, y, 0.3]) @ mount(pitch_rad=-0.05)
    expected, expected_m = cast_rays(world, T_world_cam)
    view = still.view(MINORU, T_world_cam, supersampling=1)
    assert len(np.unique(expected)) > 100
    assert (view.faces == expected).mean() >= 0.9999
    same = (view.faces == expected) & (expected >= 0)
    assert np.abs(view.depth_m / expected_m - 1)[same].max() <= 1e-6


def test_the_sky_is_bright_and_has_no_depth(renderer: Renderer) -> None:
    view = renderer.view(MINORU, from_yaw(0.4, [-3.0, -3.0, 1.2]) @ RIG.T_base_cam)
    sky = view.faces < 0
    assert 0.05 < sky.mean() < 0.9
    assert np.isnan(view.depth_m[sky]).all() and np.isfinite(view.depth_m[~sky]).all()
    assert view.gray[cv2.erode(sky.astype(np.uint8), np.ones((3, 3))) > 0].min() > 120


def test_clouds_are_in_the_sky_and_do_not_come_closer(renderer: Renderer) -> None:
    first, second = (renderer.view(MINORU, from_yaw(2.0, [0, y, 5.0]) @ mount(pitch_rad=-0.6)) for y in (0.0, 3.0))
    assert (first.faces < 0).all()
    assert first.gray.std() > 2
    np.testing.assert_array_equal(first.gray, second.gray)


@pytest.mark.parametrize("height_m", [0.5, 1.5])
def test_a_shadow_ends_where_the_sun_says(height_m: float) -> None:
    # A plate lies level at height_m; its shadow is itself, shifted along the sun's rays.
    plate = box("plate", (2.0, -0.5, height_m), (3.0, 0.5, height_m + 0.001), Paint("plain"))
    view = Renderer(plain_world(plate)).view(MINORU, down_from(9.0), supersampling=1)
    shift = -height_m * SUN[:2] / SUN[2]
    inner = np.array([[2.04, -0.46], [2.96, -0.46], [2.96, 0.46], [2.04, 0.46]]) + shift
    outer = inner + 0.08 * np.sign(inner - inner.mean(axis=0))
    T_cam_world = inverse(down_from(9.0))

    def filled(corners: FloatArray) -> np.ndarray:
        at = MINORU.project(transform(T_cam_world, np.column_stack([corners, np.zeros(4)])))[:, :2]
        return cv2.fillConvexPoly(np.zeros(view.gray.shape, np.uint8), at.round().astype(np.int32), 1) > 0

    ground = cv2.erode((view.faces < len(FLAT.solid().faces)).astype(np.uint8), np.ones((3, 3))) > 0
    shade, sunny = view.gray[filled(inner) & ground], view.gray[~filled(outer) & ground]
    assert len(shade) > 500 and len(sunny) > 500
    assert shade.max() < 0.75 * sunny.min()


def test_sun_and_shade_both_stay_within_eight_bits(renderer: Renderer) -> None:
    gray = renderer.view(MINORU, from_yaw(0.0, [0, 0, 0]) @ RIG.T_base_cam).gray
    assert (gray == 255).mean() < 0.01
    assert (gray < 10).mean() < 0.01


def test_a_slope_is_as_bright_everywhere() -> None:
    heights = 0.15 * np.add.outer(np.arange(41), 0.5 * np.arange(41)) * 0.5
    slope = Terrain(heights, (-10.0, -10.0), 0.5, "plain")
    gray = Renderer(plain_world(terrain=slope)).view(MINORU, down_from(9.0)).gray
    assert gray.min() > 60
    assert np.ptp(gray.astype(int)) <= 2


def test_a_round_hill_shows_no_facets() -> None:
    x = np.arange(-10.0, 10.1, 0.5)
    hill = Terrain(-0.08 * (x[None, :] ** 2 + x[:, None] ** 2), (-10.0, -10.0), 0.5, "plain")
    gray = Renderer(plain_world(terrain=hill)).view(MINORU, down_from(9.0)).gray.astype(np.float64)
    # From triangle to triangle flat shading would step by several levels; here neighbours differ by one at most.
    assert np.ptp(gray) > 15
    assert max(np.abs(np.diff(gray, axis=k)).max() for k in (0, 1)) <= 2


def test_ground_is_textured_from_above() -> None:
    texture = {"plain": Texture(np.kron([[40, 200], [200, 40]], np.ones((128, 128))).astype(np.uint8), (2.0, 2.0))}
    heights = 0.1 * np.add.outer(np.arange(41), np.arange(41)) * 0.5
    slope = Terrain(heights, (-10.0, -10.0), 0.5, "plain")
    world = replace(plain_world(terrain=slope), textures=texture, sky=None)
    T = down_from(14.0, 0.0)
    gray = cv2.GaussianBlur(Renderer(world).view(MINORU, T, supersampling=3).gray, (0, 0), 1.5)
    corners = np.array([(x, y, slope.height_m([x, y])) for x in range(-2, 3) for y in range(-3, 4)], np.float64)
    at = MINORU.project(transform(inverse(T), corners))[:, :2].astype(np.float32)
    found = cv2.cornerSubPix(gray, at.reshape(-1, 1, 2).copy(), (6, 6), (-1, -1), (3, 50, 1e-4)).reshape(-1, 2)
    assert np.linalg.norm(found - at, axis=1).max() <= 0.1


def test_what_moves_is_where_its_path_says_and_nowhere_else(renderer: Renderer, still: Renderer, world: World) -> None:
    T_world_cam = from_yaw(0.0, [0.0, 0.0, 0.0]) @ RIG.T_base_cam
    for time_s in (0.5, 2.5):
        view, without = renderer.view(MINORU, T_world_cam, time_s=time_s), still.view(MINORU, T_world_cam)
        walker = renderer.object_names.index("walker")
        there = renderer.objects(view.faces) == walker
        T_cam_mover = inverse(T_world_cam) @ world.T_world_mover(world.movers[0], time_s)
        middle = transform(T_cam_mover, [[-0.15, 0.0, 0.55]])
        x, y = MINORU.project(middle)[0, :2].round().astype(int)
        assert there[y, x] and abs(view.depth_m[y, x] - middle[0, 2]) < 0.25
        body = transform(T_cam_mover, world.movers[0].solids[0].vertices_m)
        low, high = (getattr(MINORU.project(body)[:, :2], k)(axis=0) for k in ("min", "max"))
        rows, columns = np.nonzero(there)
        assert columns.min() >= low[0] - 1 and columns.max() <= high[0] + 1
        assert rows.min() >= low[1] - 1 and rows.max() <= high[1] + 1
        np.testing.assert_array_equal(view.depth_m[~there], without.depth_m[~there])


def test_what_moves_throws_its_shadow_where_the_sun_says() -> None:
    post = box("post", (-0.1, -0.1, 0.0), (0.1, 0.1, 1.0), Paint("plain"))
    still = Renderer(plain_world(box("post", (1.9, -0.1, 0.0), (2.1, 0.1, 1.0), Paint("plain"))))
    moving = Renderer(plain_world(movers=(Mover("post", (post,), np.array([[2.0, 0.0], [3.0, 0.0]]), 0.0),)))
    first, second = (r.view(MINORU, down_from(9.0), supersampling=1) for r in (still, moving))
    assert (first.faces[240, 320] >= 0) and (first.depth_m == second.depth_m).mean() > 0.999
    shade = [(view.gray < 110).astype(np.uint8) for view in (first, second)]
    both, either = (shade[0] & shade[1]).sum(), (shade[0] | shade[1]).sum()
    assert shade[0].sum() > 300
    assert both / either > 0.85


def test_a_contact_shadow_follows_what_moves_indoors() -> None:
    carton = box("carton", (-0.2, -0.2, 0.0), (0.2, 0.2, 0.4), Paint("plain"))
    mover = Mover("carton", (carton,), np.array([[2.0, 0.0], [4.0, 0.0]]), 1.0)
    renderer = Renderer(plain_world(sky=None, movers=(mover,)))
    near, gone = (renderer.view(MINORU, down_from(4.0), time_s=t).gray for t in (0.0, 2.0))
    # 25 and 60 cm beside its middle.
    close, beside = (240, 320 - round(0.25 / 4.0 * 834)), (240, 320 - round(0.6 / 4.0 * 834))
    assert near[close] < gone[close] - 5
    assert gone[close] - near[close] > 2 * (int(gone[beside]) - int(near[beside])) >= 0


def test_an_actor_is_drawn_where_it_is_put_or_left_out(world: World, renderer: Renderer) -> None:
    alone = renderer
    robot = Actor("robot", (box("hull", (-0.2, -0.2, 0.0), (0.2, 0.2, 0.3), Paint("red")),), {"red": PLAIN["dark"]})
    renderer = Renderer(world, actors=(robot,))
    T = from_yaw(0.0, [0.0, 0.0, 0.0]) @ RIG.T_base_cam
    with_it, without = (
        renderer.view(MINORU, T, actors_at={"robot": from_yaw(0.3, [2.5, 0, 0])}),
        renderer.view(MINORU, T),
    )
    there = renderer.objects(with_it.faces) == renderer.object_names.index("robot")
    assert 0.01 < there.mean() < 0.2
    np.testing.assert_array_equal(without.gray, alone.view(MINORU, T).gray)
    normals = renderer.normals(with_it.faces, actors_at={"robot": from_yaw(0.3, [2.5, 0, 0])})[there]
    turned = from_yaw(0.3)[:3, :3].T
    # Of a box they are its axes, turned with it.
    assert np.abs(np.sort(np.abs(normals @ turned.T), axis=1) - [0, 0, 1]).max() < 1e-6
    with pytest.raises(InvalidInputError, match="no actor named 'dog'; choose from: robot"):
        renderer.view(MINORU, T, actors_at={"dog": np.eye(4)})


def test_objects_and_normals_are_those_of_the_solids(renderer: Renderer, world: World) -> None:
    view = renderer.view(MINORU, from_yaw(0.0, [0, 0, 0]) @ RIG.T_base_cam)
    objects, normals = renderer.objects(view.faces), renderer.normals(view.faces)
    assert {"ground", "house", "crate", "pane"} <= {renderer.object_names[k] for k in np.unique(objects[objects >= 0])}
    house = objects == renderer.object_names.index("house")
    np.testing.assert_allclose(normals[house], np.tile([-1, 0, 0], (house.sum(), 1)), atol=1e-6)
    assert (np.isnan(normals).any(axis=2) == (view.faces < 0)).all()
    assert (normals[objects == renderer.object_names.index("ground")][:, 2] > 0.9).all()


PICTURE = """
import sys; sys.path.insert(0, {helpers!r})
from hashlib import sha256
from open_air import open_air
from sim.rendering.render import Renderer
from sim.rig import MINORU, StereoRig
view = Renderer(open_air()).view(MINORU, StereoRig().T_base_cam, time_s=1.0)
print(sha256(view.gray.tobytes() + view.depth_m.tobytes() + view.faces.tobytes()).hexdigest())
"""


def test_the_same_bytes_in_every_process_and_thread(renderer: Renderer) -> None:
    def picture(_: int) -> str:
        view = renderer.view(MINORU, RIG.T_base_cam, time_s=1.0)
        return sha256(view.gray.tobytes() + view.depth_m.tobytes() + view.faces.tobytes()).hexdigest()

    with ThreadPoolExecutor(3) as pool:
        hashes = {picture(0), *pool.map(picture, range(3))}
    script = PICTURE.format(helpers=str(Path(open_air.__code__.co_filename).parent))
    other = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert hashes == {other.stdout.strip()}


def test_supersampling_is_a_choice(renderer: Renderer) -> None:
    T = from_yaw(0.4, [-3.0, -3.0, 1.2]) @ RIG.T_base_cam
    views = {n: renderer.view(MINORU, T, supersampling=n) for n in (1, "edges", 2, 3)}
    for view in views.values():
        np.testing.assert_array_equal(view.faces, views[1].faces)
        np.testing.assert_array_equal(view.depth_m, views[1].depth_m)
    off = {n: np.abs(view.gray.astype(int) - views[3].gray).mean() for n, view in views.items()}
    assert off[2] < off["edges"] < off[1]
    with pytest.raises(InvalidInputError, match="'edges' or 1 to 8, not 0"):
        renderer.view(MINORU, T, supersampling=0)


def test_a_sky_without_sun_throws_no_shadows() -> None:
    plate = box("plate", (2.0, -0.5, 1.5), (3.0, 0.5, 1.501), Paint("plain"))
    world = plain_world(plate, sky=replace(SKY, clouds="", sun_power=0.0))
    view = Renderer(world).view(MINORU, down_from(9.0))
    ground = cv2.erode((view.faces < len(FLAT.solid().faces)).astype(np.uint8), np.ones((5, 5))) > 0
    assert np.abs(np.diff(view.gray.astype(int), axis=1))[ground[:, 1:] & ground[:, :-1]].max() <= 12
