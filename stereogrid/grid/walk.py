"""A ray's way through the map, cell by cell (Amanatides and Woo 1987), in one leap over blocks that cannot stop it.

All lengths are in cells. A ray meets the cell that its origin lies in and then each cell in which it has some length:
where it runs through an edge or a corner, it goes straight to the cell beyond. Crossings are computed from whole
indices each time, never summed up, so that a leap over a block ends where the steps would have.
"""

import math

import numpy as np
from numba import njit

from ..geometry import Array
from .blocks import BLOCK
from .hashing import row_of
from .states import Judge, State

UNKNOWN, FREE, OCCUPIED = int(State.UNKNOWN), int(State.FREE), int(State.OCCUPIED)

BITS = BLOCK.bit_length() - 1
"""A cell's index shifted by so much is its block's."""
INNER = BLOCK - 1
"""The bits of a cell's index that say where in its block it stands."""
NOTHING_MET = 9
"""Beside the codes of State."""

Triple = tuple[float, float, float]
Ray = tuple[Triple, Triple, Triple]
"""Origin, unit direction and its reciprocal, +infinite where the direction has no such component.

Such a ray looks ahead to the boundary above it, never reaches it, and needs no case of its own.
"""

Rays = tuple[Array, Array, Array]
"""The same of N rays, (N, 3) each."""

Table = tuple[Array, Array, Array, Array]
"""BlockStore.table() and what is known of each row so far (R,) int8: NOT_LOOKED, CLEAR or SOLID."""
NOT_LOOKED, CLEAR, SOLID = 0, 1, 2


@njit(cache=True, nogil=True, error_model="numpy")
def walk_rays(
    rays: Rays,
    longest: float,
    unknown_stops: bool,
    table: Table,
    span: tuple[Array, Array],
    judge: Judge,
    out: tuple[Array, Array, Array],
) -> None:
    """Follow rays until an occupied cell, or to their end at `longest`.

    unknown_stops: an unknown cell ends a ray too. span: cells between which all blocks lie. Writes into out: where
    each ray ended (N,) float64, in which cell (N, 3) int64, and that cell's state (N,) int8.
    """
    origins, directions, reciprocals = rays
    ends, cells, states = out
    at, cross = np.empty(3, dtype=np.int64), np.empty(3)
    for n in range(len(origins)):
        # Tuples, because a view of an array counts references, which takes longer than to cross a block.
        ray = (
            (origins[n, 0], origins[n, 1], origins[n, 2]),
            (directions[n, 0], directions[n, 1], directions[n, 2]),
            (reciprocals[n, 0], reciprocals[n, 1], reciprocals[n, 2]),
        )
        first, last = (0.0, np.inf) if unknown_stops else _inside(ray, span)
        end, state = _walk(ray, (first, min(last, longest)), unknown_stops, table, judge, at, cross)
        if end < 0:
            _go_to(ray, longest, at, cross)
            end, state = longest, _state(at, table, judge)
        ends[n], states[n] = end, state
        for axis in range(3):
            cells[n, axis] = at[axis]


@njit(cache=True, nogil=True, error_model="numpy")
def _walk(
    ray: Ray,
    stretch: tuple[float, float],
    unknown_stops: bool,
    table: Table,
    judge: Judge,
    at: Array,
    cross: Array,
) -> tuple[float, int]:
    """Where on a stretch the ray is stopped, and the state of the cell `at` that stops it; -1, UNKNOWN if nowhere."""
    slots, indices, words, looks = table
    entry, limit = stretch
    for axis in range(3):
        at[axis] = math.floor(ray[0][axis])
        cross[axis] = _crossing(ray, axis, at[axis] + (ray[2][axis] > 0))
    if 0 < entry <= limit:
        _go_to(ray, entry, at, cross)
    while entry <= limit:
        row = row_of(at[0] >> BITS, at[1] >> BITS, at[2] >> BITS, slots, indices)
        if row >= 0 and (unknown_stops or _is_solid(words, row, judge, looks)):
            entry, state = _cross_block(ray, (entry, limit), unknown_stops, (words, row), judge, at, cross)
            if state != NOTHING_MET:
                return entry, state
        elif unknown_stops:
            return entry, UNKNOWN
        else:
            entry = _leap(ray, at, cross)
    return -1.0, UNKNOWN


@njit(cache=True, nogil=True, error_model="numpy")
def _is_solid(words: Array, row: int, judge: Judge, looks: Array) -> bool:
    """Whether a block holds an occupied cell: looked up once a call, by whichever ray comes first."""
    if looks[row] == NOT_LOOKED:
        n_occupied = 0
        for c in range(words.shape[1]):
            n_occupied += (words[row, c] >= judge[2]) & (words[row, c] & judge[0] > 0)
        looks[row] = SOLID if n_occupied > 0 else CLEAR
    solid: bool = looks[row] == SOLID
    return solid


@njit(cache=True, nogil=True, error_model="numpy")
def _cross_block(
    ray: Ray,
    stretch: tuple[float, float],
    unknown_stops: bool,
    block: tuple[Array, int],
    judge: Judge,
    at: Array,
    cross: Array,
) -> tuple[float, int]:
    """As _walk within a block, words and row: NOTHING_MET, and the entry of the cell `at`, where the ray leaves it."""
    # A number for each axis stays in a register, and steps without a branch: nobody can predict which axis is next.
    # The crossings after the next are computed while the next are compared.
    words, row = block
    ox, oy, oz = ray[0]
    rx, ry, rz = ray[2]
    ahead_x, ahead_y, ahead_z = np.int64(rx > 0), np.int64(ry > 0), np.int64(rz > 0)
    step_x, step_y, step_z = 2 * ahead_x - 1, 2 * ahead_y - 1, 2 * ahead_z - 1
    after_x, after_y, after_z = ahead_x + step_x, ahead_y + step_y, ahead_z + step_z
    x, y, z = at
    next_x, next_y, next_z = (x + after_x - ox) * rx, (y + after_y - oy) * ry, (z + after_z - oz) * rz
    cross_x, cross_y, cross_z = cross
    i, j, k = x & ~INNER, y & ~INNER, z & ~INNER
    entry, limit = stretch
    state = NOTHING_MET
    while entry <= limit and ((x ^ i) | (y ^ j) | (z ^ k)) & ~INNER == 0:
        word = words[row, (((x - i) << BITS | (y - j)) << BITS) | (z - k)]
        if word & judge[0] == 0:
            if unknown_stops:
                state = UNKNOWN
                break
        elif word >= judge[2]:
            state = OCCUPIED
            break
        entry = cross_x if cross_x < cross_y else cross_y
        entry = cross_z if cross_z < entry else entry
        go_x, go_y, go_z = cross_x <= entry, cross_y <= entry, cross_z <= entry
        cross_x = next_x if go_x else cross_x
        cross_y = next_y if go_y else cross_y
        cross_z = next_z if go_z else cross_z
        x += step_x * go_x
        y += step_y * go_y
        z += step_z * go_z
        next_x, next_y, next_z = (x + after_x - ox) * rx, (y + after_y - oy) * ry, (z + after_z - oz) * rz
    at[0], at[1], at[2] = x, y, z
    cross[0], cross[1], cross[2] = cross_x, cross_y, cross_z
    return entry, state


@njit(cache=True, nogil=True, error_model="numpy")
def _crossing(ray: Ray, axis: int, plane: int) -> float:
    """Where the ray crosses a boundary across an axis."""
    along: float = (plane - ray[0][axis]) * ray[2][axis]
    return along


@njit(cache=True, nogil=True, error_model="numpy")
def _place(at: Array) -> int:
    place: int = (((at[0] & INNER) << BITS | (at[1] & INNER)) << BITS) | (at[2] & INNER)
    return place


@njit(cache=True, nogil=True, error_model="numpy")
def _leap(ray: Ray, at: Array, cross: Array) -> float:
    """Go on to the first cell beyond the block of `at`; where the ray enters it."""
    entry = np.inf
    for axis in range(3):
        face = ((at[axis] >> BITS) + (ray[2][axis] > 0)) * BLOCK
        entry = min(entry, _crossing(ray, axis, face))
    _go_to(ray, entry, at, cross)
    return entry


@njit(cache=True, nogil=True, error_model="numpy")
def _go_to(ray: Ray, along: float, at: Array, cross: Array) -> None:
    """Set `at` to the cell that the ray is in once it has passed all boundaries up to `along`, and cross ahead of it.

    The floor of a point is a guess that rounding may put wrong by a cell; the crossings decide.
    """
    origin, direction, _ = ray
    for axis in range(3):
        if direction[axis] == 0:
            continue
        ahead, step = direction[axis] > 0, 1 if direction[axis] > 0 else -1
        start = math.floor(origin[axis])
        at[axis] = math.floor(origin[axis] + direction[axis] * along)
        while at[axis] != start and _crossing(ray, axis, at[axis] + (not ahead)) > along:
            at[axis] -= step
        while _crossing(ray, axis, at[axis] + ahead) <= along:
            at[axis] += step
        cross[axis] = _crossing(ray, axis, at[axis] + ahead)


@njit(cache=True, nogil=True, error_model="numpy")
def _inside(ray: Ray, span: tuple[Array, Array]) -> tuple[float, float]:
    """From where to where the ray may meet blocks; (inf, -1) where it meets none."""
    enter, leave = 0.0, np.inf
    for axis in range(3):
        if ray[1][axis] == 0:
            cell = math.floor(ray[0][axis])
            if not span[0][axis] <= cell < span[1][axis]:
                return np.inf, -1.0
            continue
        one, other = _crossing(ray, axis, span[0][axis]), _crossing(ray, axis, span[1][axis])
        enter, leave = max(enter, min(one, other)), min(leave, max(one, other))
    return enter, leave


@njit(cache=True, nogil=True, error_model="numpy")
def _state(at: Array, table: Table, judge: Judge) -> int:
    row = row_of(at[0] >> BITS, at[1] >> BITS, at[2] >> BITS, table[0], table[1])
    if row < 0:
        return UNKNOWN
    word = table[2][row, _place(at)]
    if word & judge[0] == 0 or judge[1] <= word < judge[2]:
        return UNKNOWN
    return OCCUPIED if word >= judge[2] else FREE
