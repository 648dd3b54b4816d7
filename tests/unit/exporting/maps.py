"""Maps to be exported."""

import numpy as np

from stereogrid.grid import OccupancyGrid


def random_map(seed, *, n=400, spread=30, cell_m=0.1, clamp=4.0):
    """n cells at most, some of them in solid boxes that prune, with a few log-odds that occur often."""
    rng = np.random.default_rng(seed)
    boxes = [np.argwhere(np.ones(rng.integers(1, 10, 3))) + rng.integers(-spread, spread, 3) for _ in range(3)]
    single = rng.integers(-spread, spread, (n, 3))
    cells = np.unique(np.concatenate([*boxes, single]), axis=0)
    log_odds = rng.choice([-2.0, -0.5, 0.0, 0.25, 3.0], len(cells))
    solid = (cells[:, None] == boxes[0][None]).all(axis=2).any(axis=1)
    return OccupancyGrid.from_cells(cell_m, cells, np.where(solid, 1.5, log_odds), clamp=clamp)


def known(grid):
    """{cell: log-odds} of all known cells."""
    cells, log_odds = grid.blocks.known()
    return dict(zip(map(tuple, cells.tolist()), log_odds.tolist(), strict=True))
