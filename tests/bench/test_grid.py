"""How fast the grid takes frames, and how large it grows. A round is a frame, in CPU seconds; no time is asserted.

`make bench-grid` runs this and draws it; every figure is in the rows' extra_info, as experiments.grid_bench names them.
"""

import time
from dataclasses import dataclass, replace
from functools import cache

import pytest

from experiments.frames import PERIOD_M, Frames, FramesConfig, make_frames
from experiments.grid_bench import GROWTH_RANGE_M, GROWTH_WIDTH_PX, SPACING_M, GrowthRow, SpeedRow, plain
from experiments.grid_contenders import GRIDS, GridContender, StereogridMap, along

N_FRAMES = 10
"""After the first. The median frame counts: they are much alike, and a shared machine disturbs some."""
DRIVES = {"stereogrid": 5, "octomap": 1}
"""How often they are driven, each time into a new map."""
GROWTH_CELL_M, LAST_M = 0.05, 10.0


@cache
def frames_of(width_px: int, range_m: float, n: int = 1 + N_FRAMES) -> Frames:
    return make_frames(FramesConfig(width_px=width_px, range_m=range_m, n=n, spacing_m=SPACING_M))


@pytest.fixture(scope="module", autouse=True)
def compiled() -> None:
    """Kernels compiled beforehand."""
    frames, grid = frames_of(320, 4.0), StereogridMap(0.2, 4.0)
    for disparity, T_world_cam in list(frames)[:2]:
        grid.add(grid.prepared(frames.camera, disparity, T_world_cam))


@pytest.mark.parametrize("contender", GRIDS)
@pytest.mark.parametrize("range_m", [4.0, 8.0, 16.0])
@pytest.mark.parametrize("width_px", [320, 640])
@pytest.mark.parametrize("cell_m", [0.05, 0.1, 0.2])
@pytest.mark.benchmark(timer=time.process_time)
def test_speed(benchmark, contender, cell_m, width_px, range_m):
    """Frames after the first, into a map that knows the first."""
    frames = frames_of(width_px, range_m)
    made = []

    def drives():
        while True:
            made[:] = [GRIDS[contender](cell_m, range_m)]
            first, *others = (made[0].prepared(frames.camera, *frame) for frame in frames)
            made[0].add(first)
            yield from (((other,), {}) for other in others)

    upcoming = drives()
    benchmark.group = f"{cell_m} m, {width_px} px, {range_m:g} m"
    benchmark.pedantic(
        lambda frame: made[0].add(frame), setup=lambda: next(upcoming), rounds=N_FRAMES * DRIVES[contender]
    )
    grid, fps = made[0], 1 / benchmark.stats.stats.median
    row = SpeedRow(contender, cell_m, width_px, range_m, N_FRAMES, fps, grid.n_bytes)
    if isinstance(grid, StereogridMap):
        row = replace(row, n_known=grid.grid.n_known, updates_per_frame=grid.n_updates() / len(frames))
    benchmark.extra_info.update(plain(row))


@dataclass
class Driven:
    """A map, how far it has been driven [m], and the CPU time of its slowest frame."""

    grid: GridContender
    to_m: float = 0.0
    slowest_s: float = 0.0


@pytest.fixture(scope="module")
def driven():
    """driven(contender): its Driven; the lengths follow on one another."""
    states = {}
    return lambda name: states.setdefault(name, Driven(GRIDS[name](GROWTH_CELL_M, GROWTH_RANGE_M)))


@pytest.mark.parametrize(
    ("contender", "length_m"), [("stereogrid", 10.0), ("octomap", 10.0), ("stereogrid", 100.0), ("stereogrid", 1000.0)]
)
@pytest.mark.benchmark(timer=time.process_time)
def test_growth(benchmark, driven, contender, length_m):
    """The last ten metres of a drive; the slowest frame is sought along all of it."""
    frames, state = frames_of(GROWTH_WIDTH_PX, GROWTH_RANGE_M, n=round(PERIOD_M / SPACING_M)), driven(contender)
    grid = state.grid

    def prepared(from_m, to_m):
        return (grid.prepared(frames.camera, *frame) for frame in along(frames, from_m, to_m))

    for frame in prepared(state.to_m, length_m - LAST_M):
        start_s = time.process_time()
        grid.add(frame)
        state.slowest_s = max(state.slowest_s, time.process_time() - start_s)
    last = list(prepared(length_m - LAST_M, length_m))
    upcoming = (((frame,), {}) for frame in last)
    benchmark.group = f"the last {LAST_M:g} of {length_m:g} m"
    benchmark.pedantic(grid.add, setup=lambda: next(upcoming), rounds=len(last))
    stats = benchmark.stats.stats
    state.to_m, state.slowest_s = length_m, max(state.slowest_s, stats.max)
    known = grid.grid.n_known if isinstance(grid, StereogridMap) else None
    measured = 1 / stats.median, 1e3 * state.slowest_s, grid.n_bytes, known
    benchmark.extra_info.update(plain(GrowthRow(contender, GROWTH_CELL_M, length_m, *measured)))
