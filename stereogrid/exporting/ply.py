"""PLY, binary: the occupied cells as points with their probability, or as a mesh of cubes."""

from pathlib import Path

from ..files import written_beside
from ..grid import OccupancyGrid
from .cubes import cube_mesh
from .points import point_cloud

FIELDS = [("red", "u1"), ("green", "u1"), ("blue", "u1"), ("probability", "<f4")]
TYPES = {"<f4": "float", "u1": "uchar"}


def write_ply(grid: OccupancyGrid, path: Path, *, threshold: float = 0.5, cubes: bool = False) -> None:
    """Write the cells with p > threshold [m]: centres, coloured by height, or the outer faces of cubes."""
    if cubes:
        content: bytes = cube_mesh(grid, threshold).export(file_type="ply")
    else:
        points = point_cloud(grid, threshold, FIELDS)
        properties = [("x", "<f4"), ("y", "<f4"), ("z", "<f4"), *FIELDS]
        lines = [f"property {TYPES[kind]} {name}" for name, kind in properties]
        header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(points)}", *lines, "end_header", ""]
        content = "\n".join(header).encode() + points.tobytes()
    with written_beside(path) as temporary:
        temporary.write_bytes(content)
