"""A map to turn in the browser, inside the page: what view3d.js draws, packed small.

A page that stands alone rules out what fetches anything; a report that is mailed, what weighs megabytes. trimesh's
viewer (three.js) is 0.7 MB before the first cell and 53 bytes a face, so a street is 18 MB; viser's page is 0.7 MB and
16 bytes a face, and draws a street less than once a second without a graphics card. Here a face is a byte or two, and a
page has MOST_FACES at most.
"""

import base64
import json
import math
import zlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib import colormaps

from ..errors import InvalidInputError
from ..exporting.cubes import outer_faces
from ..figures.colours import PATH_COLOUR, TRUTH_COLOUR
from ..figures.cubes import above_path_m
from ..geometry import Array, FloatArray
from ..grid import OccupancyGrid

SCRIPT = Path(__file__).with_name("view3d.js")
MOST_FACES = 400_000
LARGEST_INDEX = 65_000
"""Cells across: corners are packed in 16 bits."""
MOST_PATH_POINTS = 2_000
PALETTE = colormaps["viridis"](np.linspace(0.12, 1, 9))[:, :3]
LINES_A_SPAN = 10
GRID_LINE, PATH, TRUE_PATH, FRUSTUM = range(4)
"""Kinds of lines."""
WIDTHS_PX = (1.0, 3.0, 2.2, 1.6)
"""Of the kinds of lines."""


@dataclass(frozen=True)
class Scene3D:
    """json: what view3d.js draws; note: what a reader should know of it; heights_m: where the colours begin and end;
    has_truth: whether the true path is drawn."""

    json: str
    note: str
    heights_m: tuple[float, float]
    has_truth: bool


def map_scene(
    grid: OccupancyGrid,
    path_m: FloatArray,
    *,
    eye_and_target_m: tuple[FloatArray, FloatArray],
    true_path_m: FloatArray | None = None,
    frustum_m: FloatArray | None = None,
    above_path_to_m: float = math.inf,
    most_faces: int = MOST_FACES,
) -> Scene3D:
    """Cells with p > .5 up to above_path_to_m over the camera's path (M, 3) [m] (a ceiling hides what is below it).

    eye_and_target_m: where one looks from at first, and at what (3,) [m]; true_path_m (M, 3): NaN rows are left out;
    frustum_m (S, 2, 3): lines of the camera. A map of more than most_faces outer faces is drawn in coarser cells, and
    the note says so. Raises InvalidInputError where no cell is left.
    """
    centres = grid.occupied_centres()
    centres = centres[above_path_m(centres, path_m) <= above_path_to_m]
    if not len(centres):
        raise InvalidInputError("the map has no occupied cell in the heights to be drawn")
    cells = np.floor(centres / grid.cell_m).astype(np.int64)
    faces, origin, factor = _bounded_faces(cells, most_faces)
    cell_m = grid.cell_m * factor
    low_m, high_m = (float(each) for each in np.percentile(centres[:, 2], [1, 99]))
    known = None if true_path_m is None else true_path_m[~np.isnan(true_path_m).any(axis=1)]
    lines = [_ground(centres, low_m), _along(path_m, PATH)]
    lines += [_along(known, TRUE_PATH)] if known is not None else []
    lines += [_lines(frustum_m, FRUSTUM)] if frustum_m is not None else []
    scene = {
        "faces": _packed(np.diff(faces, axis=1, prepend=0).astype("<u2")),
        "lines": _packed(np.concatenate(lines).astype("<f4")),
        "origin": [float(each) for each in origin * cell_m],
        "cell_m": cell_m,
        "heights_m": [low_m, max(high_m, low_m + cell_m)],
        "palette": PALETTE.round(3).tolist(),
        "colours": [[0.5, 0.5, 0.5, 0.45], *(_rgba(c) for c in (PATH_COLOUR, TRUTH_COLOUR, PATH_COLOUR))],
        "widths": WIDTHS_PX,
        "eye": _orbit(*eye_and_target_m),
        "box": np.percentile(centres, [0.2, 99.8], axis=0).round(2).tolist(),
    }
    note = f"Squares on the ground: {_ground_step_m(centres):g} m."
    if factor > 1:
        note += f" In cells of {cell_m:g} m instead of {grid.cell_m:g} m, to keep this page small."
    return Scene3D(json.dumps(scene), note, (low_m, high_m), known is not None)


def _bounded_faces(cells: Array, most: int) -> tuple[Array, Array, int]:
    """Faces (4, F) of cells (N, 3): x, y, z of the lowest corner and the side; the origin (3,) they count from, and
    by how much cells were made coarser so that they are `most` at most."""
    factor = 1
    while True:
        coarse = np.unique(cells // factor, axis=0)
        origin = coarse.min(axis=0)
        if (np.ptp(coarse, axis=0) < LARGEST_INDEX).all():
            corners, quads = outer_faces(coarse)
            if len(quads) <= most:
                return _sided(corners - origin, quads), origin, factor
        factor += 1


def _sided(corners: Array, quads: Array) -> Array:
    """Faces (4, F): the lowest corner, and the side: twice the axis, and one more where it faces up that axis."""
    first, second, last = (corners[quads[:, k]] for k in (0, 1, 3))
    normal = np.cross(second - first, last - first)
    axis = np.abs(normal).argmax(axis=1)
    up = np.take_along_axis(normal, axis[:, None], axis=1)[:, 0] > 0
    faces = np.column_stack([first, 2 * axis + up])
    return faces[np.lexsort(faces.T[[2, 1, 0, 3]])].T


def _orbit(eye_m: FloatArray, target_m: FloatArray) -> dict[str, object]:
    """Where one looks from, as view3d.js counts: an angle, a height and a distance about what is looked at."""
    away = eye_m - target_m
    far = float(np.linalg.norm(away))
    return {
        "at": [float(each) for each in target_m],
        "yaw": math.atan2(away[1], away[0]),
        "pitch": math.asin(away[2] / far),
        "far": far,
    }


def _ground_step_m(centres: FloatArray) -> float:
    """Side of the squares on the ground: 1, 2 or 5 times a power of ten [m], some LINES_A_SPAN across the map."""
    span = max(float(np.ptp(centres[:, :2], axis=0).max()) / LINES_A_SPAN, 1e-3)
    power = 10.0 ** math.floor(math.log10(span))
    return next(n * power for n in (1, 2, 5, 10) if n * power >= span)


def _ground(centres: FloatArray, z_m: float) -> FloatArray:
    """Lines of squares under the map, at the height z_m."""
    step = _ground_step_m(centres)
    low = np.floor(np.percentile(centres[:, :2], 0.5, axis=0) / step) - 1
    high = np.ceil(np.percentile(centres[:, :2], 99.5, axis=0) / step) + 1
    x, y = (np.arange(a, b + 1) * step for a, b in zip(low, high, strict=True))
    along_y = [[[at, y[0], z_m], [at, y[-1], z_m]] for at in x]
    along_x = [[[x[0], at, z_m], [x[-1], at, z_m]] for at in y]
    return _lines(np.array(along_y + along_x), GRID_LINE)


def _along(path_m: FloatArray, kind: int) -> FloatArray:
    kept = path_m[np.unique(np.linspace(0, len(path_m) - 1, MOST_PATH_POINTS).astype(int))] if len(path_m) else path_m
    return _lines(np.stack([kept[:-1], kept[1:]], axis=1), kind)


def _lines(segments_m: FloatArray, kind: int) -> FloatArray:
    """Rows (S, 7): both ends and the kind of segments (S, 2, 3)."""
    return np.column_stack([segments_m.reshape(-1, 6), np.full(len(segments_m), kind)])


def _rgba(colour: str) -> list[float]:
    return [int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)] + [1.0]


def _packed(array: Array) -> str:
    return base64.b64encode(zlib.compress(array.tobytes(), 9)).decode()
