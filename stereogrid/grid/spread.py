"""A map that may lie a little elsewhere than where it was drawn."""

from typing import TYPE_CHECKING, Any

import numpy as np
from numba import njit
from numpy.typing import ArrayLike
from scipy.stats import norm, qmc

from ..errors import InvalidInputError
from ..geometry import Array, FloatArray, as_covariance, as_floats
from ..sensor_model import log_odds, probability
from .boxes import check_memory
from .fusion import in_parts

if TYPE_CHECKING:
    from .occupancy import OccupancyGrid

STILL_CELLS = 0.25
"""A map whose cells are displaced by less than this (one standard deviation) is left as it is: it is no finer."""
PLACES = ((1.0, 16), (2.0, 32), (np.inf, 64))
"""For displacements of up to so many cells, so many places are tried; the mean over them is good to some .01."""
KNOWN_SHARE = 0.1
"""A cell that is known in fewer of the places than this stays unknown; else those count in which it is known."""
WORKING_BYTES = 16
"""Of a cell of the box while it is spread: p and whether it is known, of the map and summed up."""
Box = tuple[Array, Array, Array]
"""First cell (3,) int64 of a dense box; p (X, Y, Z) float32, 0 where unknown; known (X, Y, Z) float32, 0 or 1."""


def spread(grid: "OccupancyGrid", covariance: ArrayLike, about_m: ArrayLike) -> "OccupancyGrid":
    """A new map: of each cell the mean probability over where the map may lie.

    covariance (3, 3): of the map's displacement along x and y [m], and of its turn [rad] about the vertical through
    about_m (2,) [m]; all normal. By the law of total probability a cell is as likely occupied as it is to lie on an
    occupied one, given that it lies where the map is known: just behind a wall, that is on the wall or nowhere, and
    what is said of cells there holds of those alone that turn out to be in view. (The mean is of probabilities, not of
    likelihood ratios: those would grow with every look at the same wall, though no look tells where it lies.)

    Raises InvalidInputError for what is no covariance, MapTooLargeError beyond the map's memory limit.
    """
    sigma, about = as_covariance(covariance, 3), as_floats(about_m)
    if about.shape != (2,) or not np.isfinite(about).all():
        raise InvalidInputError(f"about_m must be two finite numbers, not {about_m!r}")
    cells, values = grid.blocks.known()
    displaced_cells = _displacement_m(cells * grid.cell_m, sigma, about) / grid.cell_m
    if displaced_cells < STILL_CELLS:
        return grid.crop(np.full(3, -np.inf), np.full(3, np.inf))
    places = _places(sigma, next(n for most, n in PLACES if displaced_cells <= most))
    box = _padded(grid, cells, values, (places, about))
    found, p = _mean(box, places, about / grid.cell_m, grid.cell_m, grid.threads)
    # What was never certain at all stays within the map's clamp.
    return grid.from_cells(
        grid.cell_m,
        found,
        log_odds(np.clip(p, 1e-9, 1 - 1e-9)),
        model=grid.model,
        fusion=grid.fusion,
        clamp=grid.clamp,
        memory_limit_gb=grid.memory_limit_gb,
        threads=grid.threads,
    )


def _displacement_m(points_m: FloatArray, sigma: FloatArray, about_m: FloatArray) -> float:
    """The root mean square over points (N, 3) of how far they are displaced [m], one standard deviation."""
    if not len(points_m):
        return 0.0
    x, y = (points_m[:, :2] - about_m).T
    of_x = sigma[0, 0] - 2 * y * sigma[0, 2] + y**2 * sigma[2, 2]
    of_y = sigma[1, 1] + 2 * x * sigma[1, 2] + x**2 * sigma[2, 2]
    return float(np.sqrt(np.mean(of_x + of_y)))


def _places(sigma: FloatArray, n: int) -> FloatArray:
    """n equally likely displacements (n, 3), spread evenly, whose mean is 0 and whose covariance is sigma."""
    uniform = qmc.Sobol(3, scramble=False).random(n) + 0.5 / n
    normal = norm.ppf(uniform)
    normal -= normal.mean(axis=0)
    white = normal @ np.linalg.inv(np.linalg.cholesky(np.cov(normal.T, bias=True))).T
    values, vectors = np.linalg.eigh(sigma)
    places: FloatArray = white @ (vectors * np.sqrt(np.maximum(values, 0))).T
    return places


def _padded(grid: "OccupancyGrid", cells: Array, values: Array, moved: tuple[FloatArray, FloatArray]) -> Box:
    """The map as a dense box with room for every place (n, 3) about a point."""
    places, about_m = moved
    farthest_m = np.abs((cells[:, :2] + 0.5) * grid.cell_m - about_m).max()
    reach_m = np.abs(places[:, :2]).max() + np.sqrt(2) * farthest_m * np.abs(places[:, 2]).max()
    reach = int(np.ceil(reach_m / grid.cell_m)) + 1
    pad = np.array([reach, reach, 0])
    first, shape = cells.min(axis=0) - pad, np.ptp(cells, axis=0) + 1 + 2 * pad
    size = " x ".join(str(n) for n in shape)
    check_memory(WORKING_BYTES * float(np.prod(shape, dtype=float)), grid.memory_limit_gb, f"a map of {size} cells")
    p, known = np.zeros(shape, np.float32), np.zeros(shape, np.float32)
    at = tuple((cells - first).T)
    p[at], known[at] = probability(values), 1
    return first, p, known


def _mean(box: Box, places: FloatArray, about: FloatArray, cell_m: float, threads: int) -> tuple[Array, FloatArray]:
    """Cells (N, 3) that are known in enough of the places, and their mean probability (N,). about: in cells."""
    first, p, known = box
    sums, counts = np.zeros_like(p), np.zeros_like(p)
    # A cell looks up what lies where it came from.
    turns = np.stack([np.cos(places[:, 2]), np.sin(places[:, 2])], axis=1)
    moves, origin = places[:, :2] / cell_m, about - first[:2]
    in_parts(len(p), threads, lambda part: add_places(part, (p, known), (moves, turns, origin), (sums, counts)))
    found = np.argwhere(counts >= KNOWN_SHARE * len(places))
    at = tuple(found.T)
    return found + first, sums[at].astype(np.float64) / counts[at]


@njit(cache=True, nogil=True, error_model="numpy")
def add_places(part: tuple[int, int], box: tuple[Array, Array], places: Any, out: tuple[Array, Array]) -> None:
    """Add to sums and counts (X, Y, Z), for x in part, what box shows in each of the places: moves (n, 2) in cells,
    turns (n, 2) (cosine, sine) about origin (2,) in cells of the box.
    """
    p, known = box
    moves, turns, origin = places
    sums, counts = out
    for x in range(part[0], part[1]):
        for y in range(p.shape[1]):
            total, count = sums[x, y], counts[x, y]
            for n in range(len(moves)):
                across, up = x + 0.5 - origin[0] - moves[n, 0], y + 0.5 - origin[1] - moves[n, 1]
                a = int(np.floor(turns[n, 0] * across + turns[n, 1] * up + origin[0]))
                b = int(np.floor(turns[n, 0] * up - turns[n, 1] * across + origin[1]))
                if 0 <= a < p.shape[0] and 0 <= b < p.shape[1]:
                    of_column, is_known = p[a, b], known[a, b]
                    for z in range(len(total)):
                        total[z] += of_column[z]
                        count[z] += is_known[z]
