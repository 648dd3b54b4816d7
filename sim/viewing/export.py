"""A world's true mesh as a file for other programs. What moves is not in it."""

from pathlib import Path

import numpy as np
import trimesh
from numpy.typing import NDArray

from stereogrid.errors import InvalidInputError
from stereogrid.exporting.glb import T_GLTF_WORLD
from stereogrid.files import check_writable, written_beside

from ..scene.scene import World

SUFFIXES = (".glb", ".ply")


def check_mesh_file(path: Path) -> None:
    """Raise InvalidInputError now when there is no such format, or path cannot be written."""
    if path.suffix not in SUFFIXES:
        raise InvalidInputError(f"{path}: no mesh has the suffix {path.suffix!r}; choose from: {', '.join(SUFFIXES)}")
    check_writable(path)


def export_world(world: World, out: str | Path) -> Path:
    """Write the mesh of a world, each solid in the mean gray of its textures, beside and then renamed; its path.

    The suffix chooses the format: .ply is in world [m], z up; .glb too, turned in its scene, for glTF's y is up.
    Raises InvalidInputError for another suffix or a path that cannot be written.
    """
    path = Path(out)
    check_mesh_file(path)
    mesh = trimesh.Trimesh(world.vertices_m, world.triangles, vertex_colors=_grays(world), process=False)
    if path.suffix == ".glb":
        scene = trimesh.Scene()
        scene.add_geometry(mesh, node_name=world.name, geom_name=world.name, transform=T_GLTF_WORLD)
        content: bytes = scene.export(file_type="glb")
    else:
        content = mesh.export(file_type="ply")
    with written_beside(path) as temporary:
        temporary.write_bytes(content)
    return path


def _grays(world: World) -> NDArray[np.uint8]:
    """A colour (V, 4) for each vertex: the mean gray of the textures of its solid's faces."""
    mean = {name: float(texture.image.mean()) for name, texture in world.textures.items()}
    per_solid = [np.mean([mean[face.texture] for face in solid.faces]) for solid in world.solids]
    gray = np.repeat(np.rint(per_solid), [len(solid.vertices_m) for solid in world.solids])
    return np.column_stack([gray, gray, gray, np.full(len(gray), 255)]).astype(np.uint8)
