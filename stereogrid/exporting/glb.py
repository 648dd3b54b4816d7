"""GLB (binary glTF 2.0): the occupied cells as cubes, for any viewer of 3D models."""

from pathlib import Path

import numpy as np

from ..files import written_beside
from ..grid import OccupancyGrid
from .cubes import cube_mesh

T_GLTF_WORLD = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
"""glTF's y is up, our z is: the turn stands in the scene, so that the mesh itself is in world."""


def write_glb(grid: OccupancyGrid, path: Path, *, threshold: float = 0.5) -> None:
    """Write the outer faces of the cells with p > threshold [m], coloured by height."""
    import trimesh

    scene = trimesh.Scene()
    scene.add_geometry(cube_mesh(grid, threshold), node_name="map", geom_name="map", transform=T_GLTF_WORLD)
    content = scene.export(file_type="glb")
    with written_beside(path) as temporary:
        temporary.write_bytes(content)
