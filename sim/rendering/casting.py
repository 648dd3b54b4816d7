"""Rays cast by embree at the faces of one body. Embree takes float32; what it finds is made exact by its plane."""

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from numpy.typing import NDArray

from stereogrid.geometry import FloatArray

from .shapes import Bodies

Floats = NDArray[np.float32]
Faces = NDArray[np.int32]

FAR_M = 1e30
"""Nothing is hit so far away."""


class Target:
    """The chosen (F,) faces of some bodies, to cast rays at in their frame: origins, directions (N, 3)."""

    def __init__(self, bodies: Bodies, chosen: NDArray[np.bool_]) -> None:
        triangles, faces = bodies.triangles(chosen)
        # The last is that of no triangle, -1.
        self._face_of_triangle = np.append(faces, np.int32(-1))
        self._scene: EmbreeScene | None = None
        if len(triangles):
            self._scene = EmbreeScene()
            # Embree keeps no copy of its own of these: they must outlive the scene.
            first, last = triangles.min(), triangles.max()
            self._vertices = bodies.shapes.vertices[first : last + 1].astype(np.float32)
            self._triangles = triangles - first
            TriangleMesh(self._scene, self._vertices, self._triangles)
            # The first ray builds the tree, which no two threads should do at once.
            self.distance_m(np.zeros((1, 3)), np.array([[0.0, 0.0, 1.0]]))

    def distance_m(self, origins: FloatArray, directions: FloatArray) -> FloatArray:
        """How far (N,) each ray goes, in lengths of its direction; beyond FAR_M when it meets nothing."""
        if self._scene is None:
            return np.full(len(origins), 2 * FAR_M)
        found = self._scene.run(_floats(origins), _floats(directions), query="DISTANCE")
        distance: FloatArray = found.astype(np.float64)
        return distance

    def blocked(self, origins: FloatArray, directions: FloatArray) -> NDArray[np.bool_]:
        """Whether (N,) something stands in each ray's way."""
        if self._scene is None or not len(origins):
            return np.zeros(len(origins), np.bool_)
        hit: NDArray[np.bool_] = self._scene.run(_floats(origins), _floats(directions), query="OCCLUDED") == 0
        return hit

    def first_faces(self, origins: FloatArray, directions: FloatArray) -> Faces:
        """The face (N,) int32 that each ray meets first, -1 for none."""
        if self._scene is None or not len(origins):
            return np.full(len(origins), -1, np.int32)
        triangles = self._scene.run(_floats(origins), _floats(directions), query="INTERSECT")
        faces: Faces = self._face_of_triangle[triangles]
        return faces


def _floats(rays: FloatArray) -> Floats:
    return np.ascontiguousarray(rays, np.float32)
