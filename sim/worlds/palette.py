"""The painters that rooms share, by the names that walls, fittings and furniture use."""

from collections.abc import Mapping

import numpy as np

from ..scene import textures as paint
from ..scene.textures import Painter, Texture
from . import textures_indoor as indoor
from .textures_indoor import GLASS, VARNISH, glossy

BUILDING: dict[str, Painter] = {
    "wall": paint.wall,
    "ceiling": paint.ceiling,
    "lamp": paint.lamp,
    "glass": indoor.glass,
    "frame": glossy(paint.paint(0.62, 0.015), VARNISH),
    "metal": glossy(paint.metal, 0.1),
    "ribbed": glossy(indoor.ribbed, VARNISH),
    "white varnish": glossy(paint.paint(0.85, 0.015), VARNISH),
    "grey varnish": glossy(paint.paint(0.5, 0.025), VARNISH),
    "dark varnish": glossy(paint.paint(0.26, 0.03), VARNISH),
    "red varnish": glossy(paint.paint(0.36, 0.02), VARNISH),
    **{f"wood {k}": glossy(paint.wood, VARNISH) for k in range(3)},
    **{f"sign {k}": paint.sign for k in range(3)},
}
FURNITURE: dict[str, Painter] = {
    "laminate": glossy(paint.paint(0.70, 0.012), VARNISH),
    "drawer": indoor.drawer,
    "steel": paint.paint(0.58, 0.006),
    "paper": paint.paint(0.8, 0.03),
    "leaf": paint.leaf,
    "keyboard": indoor.keyboard,
    "whiteboard": indoor.whiteboard,
    "screen off": glossy(paint.paint(0.07, 0.004), GLASS),
    "notice board": paint.notice_board,
    **{f"screen {k}": indoor.screen for k in range(3)},
    **{f"stuff {k}": indoor.stuff for k in range(3)},
    **{f"books {k}": indoor.books for k in range(4)},
    **{f"binders {k}": indoor.binders for k in range(2)},
    **{f"carton {k}": paint.cardboard for k in range(2)},
    **{f"poster {k}": paint.poster for k in range(4)},
    "seat cloth 0": indoor.cloth(0.24),
    "seat cloth 1": indoor.cloth(0.40),
    "sofa cloth 0": indoor.cloth(0.45),
    "sofa cloth 1": indoor.cloth(0.34),
}


def painted(painters: Mapping[str, Painter], seed: int) -> dict[str, Texture]:
    """Every texture, each from a random stream of its own."""
    streams = np.random.default_rng([seed, 1]).spawn(len(painters))
    return {name: painter(r) for (name, painter), r in zip(painters.items(), streams, strict=True)}
