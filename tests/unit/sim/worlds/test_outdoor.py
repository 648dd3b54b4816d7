"""The green as truth: closed bodies, stones without steps, textures that tile; see test_outdoor_seeds.py."""

from itertools import pairwise

import numpy as np
import pytest

from sim.scene.scene import World
from sim.worlds import textures_plants
from sim.worlds.outdoor import CORNERS_M, PAVED_M, furnished, outdoor

CLEARANCE_M = 0.6
TILED = ("grass", "pavers", "slabs", "setts", "asphalt", "brick", "ashlar", "foliage", "clouds", "granite")


@pytest.fixture(scope="module")
def world() -> World:
    return outdoor(0)


def test_every_body_is_closed_and_turned_outward(world: World) -> None:
    for solid in world.solids:
        mesh = solid.mesh()
        assert mesh.is_watertight and mesh.volume > 0, solid.name
    assert world.mesh().is_watertight


def test_stones_lie_on_the_ground_without_steps(world: World) -> None:
    assert world.terrain is not None
    stones = [solid for solid in world.solids if solid.name.startswith("path")]
    rng = np.random.default_rng(0)
    for stone in stones:
        corners = stone.vertices_m[4:]
        inside = rng.dirichlet(np.ones(3), 50) @ corners[[0, 1, 2]]
        proud = inside[:, 2] - world.terrain.height_m(inside[:, :2])
        assert proud.min() > 0.003 and proud.max() < 0.027, stone.name
    for one, other in pairwise(stones):
        ends, starts = one.vertices_m[[5, 6]], other.vertices_m[[4, 7]]
        if np.abs(ends[:, :2] - starts[:, :2]).max() < 0.01:
            assert np.abs(ends - starts)[:, 2].max() < 1e-3


def test_the_path_starts_at_the_origin_heading_x_on_the_ground(world: World) -> None:
    path = world.waypoints_m
    assert path[0].tolist() == [0, 0] and path[1][1] == 0 and path[1][0] > 0
    assert world.ground_height_m([0.0, 0.0]) == pytest.approx(0.0, abs=1e-12)
    assert 58 < world.path_length_m < 66
    assert path[-1] == pytest.approx(CORNERS_M[-1])


def test_the_path_passes_near_everything_that_a_green_has(world: World) -> None:
    site = furnished(0)[0]
    for word in ("trunk", "bush", "lamp post", "bench", "car 0", "house parapet", "fence", "hedge", "low wall"):
        points = np.concatenate([s.vertices_m[:, :2] for s in world.solids if word in s.name])
        assert CLEARANCE_M < site.route.nearest(points)[0].min() < 4.0, word
    paved = sum(min(last, site.route.length_m) - max(first, 0.0) for first, last, _ in PAVED_M)
    assert site.route.length_m - paved > 8, "a part of the way goes over grass"


def test_the_same_seed_gives_the_same_world_and_another_seed_another(world: World) -> None:
    again, (other, solids) = outdoor(0), furnished(1)
    assert np.array_equal(world.vertices_m, again.vertices_m)
    assert all(np.array_equal(t.image, again.textures[name].image) for name, t in world.textures.items())
    assert world.sky == again.sky
    assert world.terrain is not None and not np.array_equal(world.terrain.heights_m, other.terrain.heights_m)
    assert {s.name: len(s.faces) for s in solids} != {s.name: len(s.faces) for s in world.solids}


@pytest.mark.parametrize("name", TILED)
def test_a_texture_goes_on_over_its_edges(name: str, world: World) -> None:
    image = world.textures[name].image.astype(float)
    for lines in (image, image.T):
        inside = np.abs(np.diff(lines, axis=0)).mean(axis=1)
        # A joint of the stones may lie on the edge: no step over it is much larger than the largest within.
        assert np.abs(lines[0] - lines[-1]).mean() <= 1.25 * inside.max()


def test_textures_of_the_path_show_millimetres_and_some_walls_show_almost_nothing(world: World) -> None:
    for name in ("grass", *(texture for _, _, texture in PAVED_M)):
        texture = world.textures[name]
        assert texture.size_m[0] / texture.image.shape[1] <= 0.003, name
    assert world.textures["render coat"].image.std() < 6 < 15 < world.textures["grass"].image.std()
    assert 0 < world.textures["car paint 0"].gloss < world.textures["window 0"].gloss <= 0.1


def test_a_leaf_painter_is_as_bright_as_it_is_told() -> None:
    dark, pale = (textures_plants.leaf_of(b)(np.random.default_rng(0)).image.mean() for b in (0.3, 0.5))
    assert pale - dark == pytest.approx(0.2 * 255, abs=2)
