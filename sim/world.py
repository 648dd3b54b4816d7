"""The worlds by name."""

from collections.abc import Callable

from stereogrid.errors import unknown_name

from .corridor import corridor
from .scene import World

WORLDS: dict[str, Callable[[int], World]] = {"corridor": corridor}


def make_world(name: str, seed: int = 0) -> World:
    """The world of that name; the same seed gives the same world. Raises InvalidInputError for an unknown name."""
    if name not in WORLDS:
        raise unknown_name("world", name, WORLDS)
    return WORLDS[name](seed)
