"""The bodies that a renderer draws, as flat arrays: the static world first, then its movers, then actors."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain, pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from stereogrid.errors import InvalidInputError
from stereogrid.geometry import Array

from ..scene.scene import World
from ..scene.solids import Face, Solid
from ..scene.textures import Texture

FLAT = 1e-14
"""A face of less area than this [m^2] has no normal."""
UPRIGHT = 0.05
"""The least z of a normal that belongs to the top of a surface seen from above."""


@dataclass(frozen=True)
class Actor:
    """A rigid body that is drawn where its user says, as a robot in a picture of it is.

    solids: in its own frame; their textures are the world's, or among `textures`, whose names it must not share.
    """

    name: str
    solids: tuple[Solid, ...]
    textures: Mapping[str, Texture] = field(default_factory=dict)


class Shapes(NamedTuple):
    """The F faces of all bodies, each in its body's frame [m].

    vertices (V, 3). corners (C,): indices into them, face after face; starts (F + 1,): where each face's begin.
    normals (F, 3), offsets (F,): its plane normal . p = offset, outwards. axes (F, 2, 3): of its texture.
    """

    vertices: Array
    corners: Array
    starts: Array
    normals: Array
    offsets: Array
    axes: Array


@dataclass(frozen=True)
class Bodies:
    """B rigid bodies: shapes, and where each body's faces (B + 1,) and solids (B + 1,) begin.

    faces: in the order of the shapes. solid_of_face (F,); names of the solids. surface (F,): for faces that share
    a light sheet as the top of a solid that is seen from above, its number, else -1.
    """

    shapes: Shapes
    faces: tuple[Face, ...]
    names: tuple[str, ...]
    face_starts: NDArray[np.int64]
    solid_of_face: NDArray[np.int32]
    surface: NDArray[np.int64]

    @property
    def body_of_face(self) -> NDArray[np.int64]:
        """(F,) the number of the body that a face belongs to."""
        return np.repeat(np.arange(len(self.face_starts) - 1), np.diff(self.face_starts))

    def triangles(self, faces: NDArray[np.bool_]) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
        """Triangles (T, 3), indices into the vertices, of the chosen (F,) faces, and the face (T,) of each."""
        starts, owner = self.shapes.starts, np.flatnonzero(faces).astype(np.int32)
        owner = np.repeat(owner, np.diff(starts)[owner] - 2)
        after = np.arange(len(owner)) - np.searchsorted(owner, owner)
        first = starts[owner]
        index = np.stack([first, first + after + 1, first + after + 2], axis=1)
        return self.shapes.corners[index].astype(np.int32), owner


def gather(world: World, actors: Sequence[Actor]) -> Bodies:
    """The world and all that moves in it; raises InvalidInputError for a face that is not one."""
    groups = [world.solids, *(mover.solids for mover in world.movers), *(actor.solids for actor in actors)]
    solids = tuple(chain.from_iterable(groups))
    faces = tuple(face for solid in solids for face in solid.faces)
    sizes = np.array([len(solid.faces) for solid in solids])
    solid_of_face = np.repeat(np.arange(len(solids), dtype=np.int32), sizes)
    shapes = _shapes(solids, faces, solid_of_face)
    ends = np.cumsum([sum(len(solid.faces) for solid in group) for group in groups])
    return Bodies(
        shapes,
        faces,
        tuple(solid.name for solid in solids),
        np.array([0, *ends]),
        solid_of_face,
        _surfaces(solids, shapes, solid_of_face),
    )


def _shapes(solids: Sequence[Solid], faces: Sequence[Face], solid_of_face: NDArray[np.int32]) -> Shapes:
    vertices = np.concatenate([solid.vertices_m for solid in solids]).astype(np.float64)
    shift = np.cumsum([0, *(len(solid.vertices_m) for solid in solids)])[solid_of_face]
    counts = np.array([len(face.corners) for face in faces])
    corners = np.array(list(chain.from_iterable(face.corners for face in faces))) + np.repeat(shift, counts)
    starts = np.concatenate([[0], np.cumsum(counts)])
    axes = np.array([(*face.s_axis, *face.t_axis) for face in faces]).reshape(-1, 2, 3)
    first = vertices[corners[starts[:-1]]]
    # Newell's normal, about the first corner, so that far from the origin nothing cancels.
    around = vertices[corners] - np.repeat(first, counts, axis=0)
    after = np.arange(1, len(corners) + 1)
    after[starts[1:] - 1] = starts[:-1]
    normals = np.add.reduceat(np.cross(around, around[after]), starts[:-1])
    area = np.linalg.norm(normals, axis=1)
    if (area < FLAT).any():
        name = solids[solid_of_face[int(np.argmin(area))]].name
        raise InvalidInputError(f"a face of the solid {name!r} has no area")
    normals /= area[:, None]
    return Shapes(vertices, corners, starts, normals, (first * normals).sum(axis=1), axes)


def _surfaces(solids: Sequence[Solid], shapes: Shapes, solid_of_face: NDArray[np.int32]) -> NDArray[np.int64]:
    """(F,): the solid, for the top faces of those that are seen from above; their texture axes must agree."""
    surface = np.full(len(solid_of_face), -1)
    ends = np.searchsorted(solid_of_face, np.arange(len(solids) + 1))
    for k, (first, past) in enumerate(pairwise(ends)):
        if solids[k].seen_from_above:
            top = first + np.flatnonzero(shapes.normals[first:past, 2] > UPRIGHT)
            alike = (shapes.axes[top] == shapes.axes[top[:1]]).all(axis=(1, 2))
            surface[top[alike]] = k
    return surface
