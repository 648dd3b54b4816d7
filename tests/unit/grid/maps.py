"""Maps filled by hand: what they hold is known cell by cell."""

import numpy as np

from stereogrid.grid import OccupancyGrid

HALF = 16
"""Random maps reach that many cells from the origin: blocks on both sides of it, some of them empty."""


def filled(cells, log_odds, n_updates=3, **options):
    """A map of .25 m cells: their multiples are exact in floating point, and so are ties."""
    grid = OccupancyGrid(**{"cell_m": 0.25, **options})
    values = np.broadcast_to(log_odds, len(cells))
    words = grid.blocks.rule.pack(values, np.broadcast_to(n_updates, len(cells)))
    grid.blocks.put(np.asarray(cells, dtype=np.int64), words)
    return grid


def every_cell(low, high):
    axes = [np.arange(a, b) for a, b in zip(low, high, strict=True)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)


def random_map(seed, *, share_known=0.3, share_occupied=0.1, **options):
    """Scattered cells in clumps: some blocks full, some sparse, some not held."""
    rng = np.random.default_rng(seed)
    cells = every_cell([-HALF] * 3, [HALF] * 3)
    of_block = rng.choice([0.0, 0.5 * share_known, 2 * share_known], (8, 8, 8))[tuple((cells // 8 % 8).T)]
    cells = cells[rng.random(len(cells)) < of_block]
    occupied = rng.random(len(cells)) < share_occupied
    log_odds = np.where(occupied, rng.uniform(0.1, 3.5, len(cells)), rng.uniform(-3.5, -0.1, len(cells)))
    return filled(cells, log_odds, rng.integers(1, 40, len(cells)), **options)


def known(grid):
    """{cell: p} of all that the map knows."""
    cells, p = grid.known_cells()
    return dict(zip(map(tuple, cells.tolist()), p.tolist(), strict=True))
