"""The corridor of seed 0, built once for all tests that only look at it."""

from typing import TYPE_CHECKING

import pytest

from sim.scene.scene import World
from sim.worlds.world import make_world

if TYPE_CHECKING:
    from sim.rendering.render import Renderer


@pytest.fixture(scope="session")
def corridor() -> World:
    return make_world("corridor", 0)


@pytest.fixture(scope="session")
def renderer(corridor: World) -> "Renderer":
    from sim.rendering.render import Renderer

    return Renderer(corridor)
