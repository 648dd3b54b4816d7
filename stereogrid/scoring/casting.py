"""Rays cast by embree at the true mesh."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import MissingExtraError
from ..geometry import FloatArray, as_floats

if TYPE_CHECKING:
    import trimesh

FAR_M = 1e30
"""Nothing is hit so far away."""


class RayCaster:
    """A mesh to cast rays at: built once, used for many. Raises MissingExtraError without embreex."""

    def __init__(self, mesh: "trimesh.Trimesh") -> None:
        try:
            from embreex.mesh_construction import TriangleMesh
            from embreex.rtcore_scene import EmbreeScene
        except ImportError as error:
            raise MissingExtraError(
                "casting rays at the true mesh needs embreex: pip install stereogrid[score]"
            ) from error
        # Embree computes in float32: keep its numbers small wherever the world lies.
        self._centre_m: FloatArray = np.asarray(mesh.bounds).mean(axis=0)
        triangles = np.asarray(mesh.triangles) - self._centre_m
        self._scene = EmbreeScene(robust=True)
        # Embree keeps no copy of its own: this must live as long as the scene.
        self._triangles = TriangleMesh(self._scene, triangles.astype(np.float32))

    def lengths(self, origins_m: ArrayLike, directions: ArrayLike) -> NDArray[np.float32]:
        """How far (N,) each ray goes, in lengths of its direction; beyond FAR_M where it meets nothing.

        origins_m: (3,) for all or (N, 3) in world [m]; directions (N, 3).
        """
        found: NDArray[np.float32] = self._scene.run(*self._rays(origins_m, directions), query="DISTANCE")
        return found

    def hits(self, origins_m: ArrayLike, directions: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """The same lengths (N,), and the unit normal (N, 3) of what each ray meets, NaN where it meets nothing."""
        found = self._scene.run(*self._rays(origins_m, directions), output=True)
        normal = as_floats(found["Ng"])
        length = np.linalg.norm(normal, axis=1, keepdims=True)
        return as_floats(found["tfar"]), normal / np.where(length > 0, length, np.nan)

    def _rays(self, origins_m: ArrayLike, directions: ArrayLike) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Origins and directions (N, 3) as embree takes them."""
        toward = np.ascontiguousarray(directions, dtype=np.float32)
        origins = np.broadcast_to((as_floats(origins_m) - self._centre_m).astype(np.float32), toward.shape)
        return np.ascontiguousarray(origins), toward
