"""A flat map for ROS's map_server: an image (.pgm) of a band of heights and its description (.yaml)."""

import json
from pathlib import Path

import numpy as np

from ..errors import InvalidInputError
from ..files import check_writable, written_beside
from ..geometry import FloatArray
from ..grid import OccupancyGrid

OCCUPIED_FROM, FREE_TO = 0.65, 0.196
"""map_server's own thresholds; probabilities between them are unknown to it."""
BLACK, UNKNOWN, WHITE = 0, 205, 254
MOST_PIXELS = 2**28


def write_map_server(grid: OccupancyGrid, path: Path, *, low_m: float = 0.1, high_m: float = 1.5) -> None:
    """Write both files, whichever path names: the columns of cells with centres between heights low_m and high_m [m].

    A column is as occupied as the most occupied of its known cells. Row 0 of the image is the farthest along y.
    """
    image_path, yaml_path = path.with_suffix(".pgm"), path.with_suffix(".yaml")
    for each in (image_path, yaml_path):
        check_writable(each)
    origin_m, p = project(grid, low_m, high_m)
    image = np.select([p >= OCCUPIED_FROM, p <= FREE_TO], [BLACK, WHITE], UNKNOWN).astype(np.uint8)
    rows = np.ascontiguousarray(image.T[::-1])
    with written_beside(image_path) as temporary:
        temporary.write_bytes(f"P5\n{rows.shape[1]} {rows.shape[0]}\n255\n".encode() + rows.tobytes())
    with written_beside(yaml_path) as temporary:
        temporary.write_text(_description(image_path.name, grid.cell_m, origin_m), encoding="utf-8")


def _description(image: str, cell_m: float, origin_m: FloatArray) -> str:
    x, y = (_number(value) for value in origin_m)
    return (
        f"image: {json.dumps(image, ensure_ascii=False)}\n"
        "mode: trinary\n"
        f"resolution: {_number(cell_m)}\n"
        f"origin: [{x}, {y}, 0.0]\n"
        "negate: 0\n"
        f"occupied_thresh: {OCCUPIED_FROM}\n"
        f"free_thresh: {FREE_TO}\n"
    )


def _number(value: float) -> str:
    """value without an exponent: some readers of YAML take 1e-05 for a text."""
    return np.format_float_positional(value, trim="0")


def project(grid: OccupancyGrid, low_m: float, high_m: float) -> tuple[FloatArray, FloatArray]:
    """The lower left corner (2,) [m] and the largest p (X, Y) of the known cells with centres in a band of heights.

    NaN where none of them is known. Raises InvalidInputError where the band is empty.
    """
    cells, p = grid.known_cells()
    centre_m = (cells[:, 2] + 0.5) * grid.cell_m
    within = (centre_m >= low_m) & (centre_m <= high_m)
    if not within.any():
        reach = f"{centre_m.min():.3g} to {centre_m.max():.3g} m" if len(cells) else "nowhere"
        raise InvalidInputError(f"no known cell lies between {low_m:g} and {high_m:g} m; the map reaches {reach}")
    columns = cells[within, :2]
    first = columns.min(axis=0)
    shape = [int(each) for each in columns.max(axis=0) - first + 1]
    if shape[0] * shape[1] > MOST_PIXELS:
        raise InvalidInputError(f"the map is too wide for an image: {shape[0]} x {shape[1]} cells")
    highest = np.full(shape, -np.inf)
    np.maximum.at(highest, tuple((columns - first).T), p[within])
    return first * grid.cell_m, np.where(np.isinf(highest), np.nan, highest)
