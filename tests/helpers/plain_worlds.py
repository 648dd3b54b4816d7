"""Worlds of a few grey boxes, for tests of what the robot does in them."""

import numpy as np

from sim.scene.movers import Mover
from sim.scene.scene import World
from sim.scene.solids import Paint, Solid, Vector, box
from sim.scene.terrain import Terrain
from sim.scene.textures import Texture
from stereogrid.geometry import FloatArray

GREY = Paint("grey")


def block(low_m: Vector, high_m: Vector, T_world_box: FloatArray | None = None) -> Solid:
    """A grey box."""
    return box("block", low_m, high_m, GREY, T_world_box=T_world_box)


def world(*solids: Solid, terrain: Terrain | None = None, movers: tuple[Mover, ...] = ()) -> World:
    """Those solids, and a path of 3 m ahead."""
    far = block((90.0, 90.0, 0.0), (91.0, 91.0, 1.0))
    texture = Texture(np.full((2, 2), 128, np.uint8))
    path = np.array([[0.0, 0.0], [3.0, 0.0]])
    return World("plain", 0, (far, *solids), {"grey": texture}, (), path, terrain=terrain, movers=movers)
