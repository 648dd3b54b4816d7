"""A world: textured solids, light, and the path that the robot drives through them."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import trimesh
from numpy.typing import ArrayLike

from stereogrid.errors import InvalidInputError
from stereogrid.geometry import FloatArray

from .movers import Mover
from .route import Route
from .solids import Solid, fan
from .terrain import Terrain
from .textures import Texture


@dataclass(frozen=True)
class Lamp:
    """A rectangular ceiling lamp that shines downwards: center_m (3,), size_m (x, y) [m]; power: its brightness."""

    center_m: tuple[float, float, float]
    size_m: tuple[float, float]
    power: float = 1.0


@dataclass(frozen=True)
class Sky:
    """What is above: brightness (0 to 1, square root as textures are) at the horizon and at the zenith.

    clouds: a texture's name, blended over it by its brightness and stretched towards the horizon; "" for none.
    sun_direction (3,): unit vector towards the sun; sun_power: its light on a surface that faces it, 0 for an
    overcast sky, where `World.ambient` alone lights the world.
    """

    horizon: float = 0.85
    zenith: float = 0.6
    clouds: str = ""
    sun_direction: tuple[float, float, float] = (0.0, 0.0, 1.0)
    sun_power: float = 0.0


@dataclass(frozen=True)
class World:
    """Static truth, and what moves in it. The robot starts at x = y = 0, heading +x, on the ground; z is up.

    waypoints_m (N, 2): the path, first point (0, 0). ambient: light that comes from everywhere. sky: None indoors.
    terrain: uneven ground, or None for the floor z = 0. surface: what the robot drives on, see ground.SURFACES.
    movers: people and things that walk on given paths; they are in no mesh of the static world.
    """

    name: str
    seed: int
    solids: tuple[Solid, ...]
    textures: dict[str, Texture]
    lamps: tuple[Lamp, ...]
    waypoints_m: FloatArray
    ambient: float = 0.35
    sky: Sky | None = None
    terrain: Terrain | None = None
    surface: str = "vinyl"
    movers: tuple[Mover, ...] = ()

    def __post_init__(self) -> None:
        if self.waypoints_m.ndim != 2 or self.waypoints_m.shape[1] != 2 or len(self.waypoints_m) < 2:
            raise InvalidInputError(f"waypoints_m must be (N >= 2, 2), not {self.waypoints_m.shape}")
        legs_m = np.linalg.norm(np.diff(self.waypoints_m, axis=0), axis=1)
        if not np.isfinite(self.waypoints_m).all() or not legs_m.all():
            raise InvalidInputError("waypoints_m must be finite, and no two in a row the same")
        for face in (f for solid in self.solids for f in solid.faces):
            if face.texture not in self.textures:
                raise InvalidInputError(f"the world {self.name!r} has no texture named {face.texture!r}")

    def ground_height_m(self, xy_m: ArrayLike) -> FloatArray:
        """Height (...) of the terrain at points (..., 2) [m]; 0 where there is none."""
        flat: FloatArray = np.zeros(np.shape(xy_m)[:-1])
        return flat if self.terrain is None else self.terrain.height_m(xy_m)

    def T_world_mover(self, mover: Mover, time_s: float) -> FloatArray:
        """Pose (4, 4) of a mover at a time since the start, upright on the ground."""
        T = mover.T_world_mover(time_s)
        T[2, 3] += float(self.ground_height_m(T[:2, 3]))
        return T

    def mesh(self) -> trimesh.Trimesh:
        """All static bodies as one mesh of closed, outward parts: the truth that maps are scored against [m]."""
        return trimesh.Trimesh(self.vertices_m, self.triangles, process=False)

    @cached_property
    def vertices_m(self) -> FloatArray:
        """(V, 3) [m], solid after solid."""
        return np.concatenate([solid.vertices_m for solid in self.solids])

    @cached_property
    def triangles(self) -> FloatArray:
        """(T, 3) indices into vertices_m, face after face."""
        return np.concatenate([fan(corners) for corners in self.face_corners]).astype(np.int32)

    @cached_property
    def face_corners(self) -> tuple[tuple[int, ...], ...]:
        """The corners of each face of each solid, as indices into vertices_m."""
        starts = np.cumsum([0, *(len(solid.vertices_m) for solid in self.solids)])
        return tuple(
            tuple(int(start) + c for c in face.corners)
            for start, solid in zip(starts, self.solids, strict=False)
            for face in solid.faces
        )

    @cached_property
    def route(self) -> Route:
        """The path, asked for by station."""
        return Route(self.waypoints_m)

    @property
    def path_length_m(self) -> float:
        """Length of the polyline through the waypoints [m]."""
        return self.route.length_m
