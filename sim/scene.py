"""A world: static textured solids, lamps, and the path that the robot drives through them."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import trimesh

from stereogrid.errors import InvalidInputError
from stereogrid.geometry import FloatArray

from .solids import Solid, fan
from .textures import Texture


@dataclass(frozen=True)
class Lamp:
    """A rectangular ceiling lamp that shines downwards: center_m (3,), size_m (x, y) [m]; power: its brightness."""

    center_m: tuple[float, float, float]
    size_m: tuple[float, float]
    power: float = 1.0


@dataclass(frozen=True)
class World:
    """Static truth. The robot starts at the origin, heading +x, on the floor z = 0; z is up.

    waypoints_m (N, 2): the path, first point (0, 0). ambient: light that comes from everywhere.
    """

    name: str
    seed: int
    solids: tuple[Solid, ...]
    textures: dict[str, Texture]
    lamps: tuple[Lamp, ...]
    waypoints_m: FloatArray
    ambient: float = 0.35

    def __post_init__(self) -> None:
        if self.waypoints_m.ndim != 2 or self.waypoints_m.shape[1] != 2 or len(self.waypoints_m) < 2:
            raise InvalidInputError(f"waypoints_m must be (N >= 2, 2), not {self.waypoints_m.shape}")
        for face in (f for solid in self.solids for f in solid.faces):
            if face.texture not in self.textures:
                raise InvalidInputError(f"the world {self.name!r} has no texture named {face.texture!r}")

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
    def face_of_triangle(self) -> FloatArray:
        """(T,) int32: the number of the face that a triangle belongs to."""
        counts = [len(corners) - 2 for corners in self.face_corners]
        return np.repeat(np.arange(len(counts), dtype=np.int32), counts)

    @property
    def path_length_m(self) -> float:
        """Length of the polyline through the waypoints [m]."""
        return float(np.linalg.norm(np.diff(self.waypoints_m, axis=0), axis=1).sum())
