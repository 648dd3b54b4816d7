"""How high above the ground is a cell? The ground is the lowest surface of the true mesh that faces upwards."""

from typing import TYPE_CHECKING

import numpy as np

from ..errors import MissingExtraError
from ..geometry import FloatArray
from .labels import CellLabels

if TYPE_CHECKING:
    import trimesh

STEEPEST = 0.5
"""Sine of elevation of the normals of ground: up to 60 degrees steep; what is steeper is a side of something."""


def ground_height_m(mesh: "trimesh.Trimesh", labels: CellLabels) -> FloatArray:
    """Height (nx, ny) in world of the ground at the middle of each column of cells [m], NaN where there is none.

    Raises MissingExtraError without embreex.
    """
    try:
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene
    except ImportError as error:
        raise MissingExtraError("heights above ground need embreex: pip install stereogrid[score]") from error
    nx, ny, _ = labels.label.shape
    rising = np.asarray(mesh.face_normals)[:, 2] > STEEPEST
    if not rising.any():
        return np.full((nx, ny), np.nan)
    # Embree computes in float32: keep its numbers small wherever the world lies.
    centre_m = np.asarray(mesh.bounds).mean(axis=0)
    scene = EmbreeScene(robust=True)
    triangles = (np.asarray(mesh.triangles)[rising] - centre_m).astype(np.float32)
    _kept = TriangleMesh(scene, triangles)  # embree keeps no copy of its own
    below_m = float(triangles[..., 2].min()) - 1.0
    x_m, y_m = (
        (labels.origin_index[k] + np.arange(n) + 0.5) * labels.cell_m - centre_m[k] for k, n in ((0, nx), (1, ny))
    )
    columns = np.stack([*np.meshgrid(x_m, y_m, indexing="ij"), np.full((nx, ny), below_m)], axis=-1)
    origins = columns.reshape(-1, 3).astype(np.float32)
    up = np.tile(np.array([0, 0, 1], dtype=np.float32), (len(origins), 1))
    # Only what faces upwards is in the scene: from below, the first hit is the lowest of it.
    rise_m = scene.run(origins, up, query="DISTANCE").astype(np.float64)
    hit = scene.run(origins, up, query="INTERSECT") >= 0
    ground_m: FloatArray = np.where(hit, rise_m + below_m + centre_m[2], np.nan).reshape(nx, ny)
    return ground_m
