"""The renderers by name."""

from collections.abc import Callable
from typing import Protocol

from stereogrid.camera import StereoCamera
from stereogrid.errors import unknown_name
from stereogrid.geometry import FloatArray

from ..scene.scene import World
from .render import Renderer, View

RASTER = "raster"
"""The renderer whose pictures count."""


class Photographer(Protocol):
    """Whatever shows a world to a pinhole camera."""

    def view(self, camera: StereoCamera, T_world_cam: FloatArray, *, time_s: float = 0.0) -> View:
        """See render.Renderer.view."""
        ...


class RowPhotographer(Photographer, Protocol):
    """One that has rolling shutters too."""

    def view_rows(self, camera: StereoCamera, T_world_cam: FloatArray, *, time_s: float = 0.0) -> View:
        """See render.Renderer.view_rows."""
        ...


def _bullet(world: World) -> Photographer:
    from .render_bullet import BulletRenderer

    return BulletRenderer(world)


RENDERERS: dict[str, Callable[[World], Photographer]] = {RASTER: Renderer, "bullet": _bullet}


def make_renderer(name: str, world: World) -> Photographer:
    """The renderer of that name for a world: "raster", or "bullet" for a quick look, never for scores.

    Raises InvalidInputError for an unknown name.
    """
    if name not in RENDERERS:
        raise unknown_name("renderer", name, RENDERERS)
    return RENDERERS[name](world)
