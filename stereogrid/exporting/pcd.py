"""PCD 0.7, the point clouds of the Point Cloud Library: https://pcl.readthedocs.io, "The PCD file format"."""

import io
from pathlib import Path

import numpy as np

from ..files import written_beside
from ..grid import OccupancyGrid
from .points import point_cloud

HEADER = """# .PCD v0.7 - Point Cloud Data file format
VERSION 0.7
FIELDS x y z probability
SIZE 4 4 4 4
TYPE F F F F
COUNT 1 1 1 1
WIDTH {n}
HEIGHT 1
VIEWPOINT 0 0 0 1 0 0 0
POINTS {n}
DATA {kind}
"""


def write_pcd(grid: OccupancyGrid, path: Path, *, threshold: float = 0.5, ascii: bool = False) -> None:
    """Write the centres [m] and probabilities of the cells with p > threshold, binary or as text."""
    points = point_cloud(grid, threshold, [("probability", "<f4")])
    content = io.BytesIO()
    content.write(HEADER.format(n=len(points), kind="ascii" if ascii else "binary").encode())
    if ascii:
        np.savetxt(content, points, fmt="%.9g")
    else:
        content.write(points.tobytes())
    with written_beside(path) as temporary:
        temporary.write_bytes(content.getvalue())
