"""The corridor as truth: closed bodies, a clear path, and names that are known."""

import numpy as np
import pytest

from sim.scene.scene import World
from sim.worlds.world import WORLDS, make_world
from stereogrid.errors import InvalidInputError

CLEARANCE_M = 0.4
"""Half of the robot's width and a margin."""


@pytest.fixture(scope="module", params=[0, 1, 2])
def corridor(request: pytest.FixtureRequest) -> World:
    return make_world("corridor", request.param)


def test_every_body_is_closed_and_turned_outward(corridor: World) -> None:
    for solid in corridor.solids:
        mesh = solid.mesh()
        assert mesh.is_watertight and mesh.volume > 0, solid.name


def test_the_mesh_is_all_bodies_and_watertight(corridor: World) -> None:
    mesh = corridor.mesh()
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(sum(solid.mesh().volume for solid in corridor.solids))


def test_the_path_starts_at_the_origin_heading_x_and_is_long_with_a_corner(corridor: World) -> None:
    path = corridor.waypoints_m
    assert path[0].tolist() == [0, 0] and path[1][1] == 0 and path[1][0] > 0
    assert corridor.path_length_m >= 30
    assert len(path) == 3


def test_nothing_stands_on_the_path(corridor: World) -> None:
    steps = [np.linspace(a, b, 200) for a, b in zip(corridor.waypoints_m, corridor.waypoints_m[1:], strict=False)]
    path = np.concatenate(steps)
    for solid in corridor.solids:
        low, high = solid.vertices_m.min(axis=0), solid.vertices_m.max(axis=0)
        if high[2] > 0 and low[2] < 1:
            gap = np.maximum(np.maximum(low[:2] - path, path - high[:2]), 0)
            assert np.linalg.norm(gap, axis=1).min() > CLEARANCE_M, solid.name


def test_the_same_seed_gives_the_same_world_and_another_seed_another() -> None:
    first, again, other = (make_world("corridor", seed) for seed in (5, 5, 6))
    assert np.array_equal(first.vertices_m, again.vertices_m)
    assert all(np.array_equal(t.image, again.textures[name].image) for name, t in first.textures.items())
    assert not np.array_equal(first.textures["floor"].image, other.textures["floor"].image)
    assert first.vertices_m.shape != other.vertices_m.shape or not np.array_equal(first.vertices_m, other.vertices_m)


def test_an_unknown_world_is_named_with_the_choices() -> None:
    with pytest.raises(InvalidInputError, match=r"no world named 'maze'; choose from: .*corridor"):
        make_world("maze", 0)
    assert "corridor" in WORLDS
