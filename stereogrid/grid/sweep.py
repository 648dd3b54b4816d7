"""The sweep: each block in view is visited once and each of its cells judged once, in disparity space.

A block is worked in stages over small buffers: project its cells; gather readings; judge; write evidence. The first and
the third are arithmetic alone, in float32 and without branches, and become vector instructions: Phi is a polynomial,
the logarithm a table.

The stages stand in this file: Numba's cache does not notice when a function from another file changes.
"""

import math
from typing import Any

import numpy as np
from numba import njit

from ..geometry import Array
from ..sensor_model import LOOKS_EXPONENT
from .blocks import BLOCK, CELLS
from .cells import LARGEST_EVIDENCE, NOTHING, ONE
from .footprint import cell_offsets, extent, rectangle, to_cam
from .judgement import Judgement

SKIPPED, FREE, JUDGED = 0, 1, 2
"""Kinds of blocks: nothing is learnt there; each cell gets the evidence of free space; each cell was judged."""

LEAST_SHARE = 0.01
"""A node that a footprint only touches counts a little, so that a cell whose other nodes are invalid learns by it."""
LANES = 16
"""Cells that are judged at once: so many float32 fit in the widest vectors there are."""


@njit(cache=True, nogil=True, error_model="numpy")
def level_of(side_px: float) -> int:
    """The pyramid's level whose nodes are read for cells of side_px: 1 to 2 nodes to a side, and 2 x 2 are read."""
    return int(max(math.log2(side_px), 0.0))


@njit(cache=True, nogil=True, error_model="numpy")
def sweep_blocks(blocks: Array, part: tuple[int, int], view: Any, pyramid: Any, model: Judgement, out: Any) -> None:
    """Judge blocks[part[0] : part[1]], of (B, 3) int64.

    view: T_cam_world (3, 4), focal, cx, cy, focal * baseline, width, height, cell, largest range. pyramid: nodes as
    uint64 (N,), windows as uint64 (N,) and as float32 (N, 2), layout. out: kinds (B,) int8, free evidence (B,) int16,
    evidence (B, 512) int16, of which the rows of JUDGED blocks are written.
    """
    pose, focal, _, _, _, _, _, cell, range_max = view
    kinds, free_evidence, evidence = out
    offsets, scratch = cell_offsets(pose, cell), _scratch()
    radius = 0.5 * math.sqrt(3.0) * (BLOCK - 1) * cell
    reach = 0.5 * (BLOCK - 1) * cell * (abs(pose[2, 0]) + abs(pose[2, 1]) + abs(pose[2, 2]))
    coarsest, rect = len(pyramid[3]) - 1, np.empty(4, np.int64)
    for b in range(part[0], part[1]):
        kinds[b] = SKIPPED
        corner = to_cam(pose, blocks[b, 0], blocks[b, 1], blocks[b, 2], cell)
        x, y = corner[0] + 0.5 * offsets[0, CELLS - 1], corner[1] + 0.5 * offsets[1, CELLS - 1]
        z = corner[2] + 0.5 * offsets[2, CELLS - 1]
        distance = math.sqrt(x * x + y * y + z * z)
        near, far = z - reach, z + reach
        if distance - radius > range_max or far < cell:
            continue
        finest = min(level_of(focal * cell / far), coarsest)
        level = min(level_of(focal * cell / max(near, cell)), coarsest)
        in_range = distance + radius <= range_max and finest == level
        begun, learnt = False, 0
        for each in range(finest, level + 1):
            kind = _whole(corner, offsets, (near, far), in_range, each, view, pyramid, rect) if near >= cell else JUDGED
            if kind == FREE:
                kinds[b], free_evidence[b] = FREE, _fixed(model.free * strength_of(each, model))
            elif kind == JUDGED:
                if not begun:
                    evidence[b, :] = NOTHING
                    begun = True
                depths = (
                    focal * cell / (1 << (each + 1)) if each < coarsest else 0.0,
                    focal * cell / (1 << each) if each else np.inf,
                )
                learnt += _cells(corner, offsets, depths, each, view, pyramid, model, scratch, evidence[b])
        if learnt:
            kinds[b] = JUDGED


@njit(cache=True, nogil=True, error_model="numpy")
def strength_of(level: int, model: Judgement) -> Any:
    """What an observation is worth to a cell that reads nodes of this level, by the looks that its footprint holds.

    A footprint is 1 to 2 nodes wide, 2 in area. One look is worth one reading; more of them narrow it (see the
    pyramid) and make it a little stronger.
    """
    looks = 2.0 * (1 << level) * (1 << level) * model.looks_per_px
    return model.weight * max(1.0, looks) ** LOOKS_EXPONENT


@njit(cache=True, nogil=True, error_model="numpy")
def _scratch() -> Any:
    """Buffers for one block, some of them seen in two ways."""
    geometry, base = np.empty((5, CELLS), np.float32), np.empty(CELLS, np.uint32)
    limits, chosen = np.empty(CELLS, np.uint64), np.zeros(CELLS + LANES, np.uint32)
    gathered, near_by = np.empty((4, CELLS), np.uint64), np.empty((4, CELLS), np.float32)
    readings = np.empty((4, 3, CELLS), np.float32)
    return (
        (geometry, base, limits, limits.view(np.float32), np.empty(CELLS, np.uint8), chosen),
        (gathered, gathered.view(np.int32), near_by, readings, readings.view(np.int32), np.empty(CELLS, np.float32)),
    )


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _whole(
    corner: Any, offsets: Array, depths: Any, in_range: bool, level: int, view: Any, pyramid: Any, rect: Array
) -> int:
    """Whether a block is free as a whole, or skipped as hidden or out of view, or must be judged cell by cell."""
    _, focal, cx, cy, _, width, height, cell, _ = view
    first, h, w = pyramid[3][level]
    inside = rectangle(corner, offsets, (focal, cx, cy, width, height), 1.0 / (1 << level), (h, w), rect)
    if rect[0] > rect[1]:
        return SKIPPED
    near, far = depths[0] - 0.5 * cell, depths[1] + 0.5 * cell
    least, most, whole = extent(pyramid[2], first, w, rect, (near, far))
    if near > most:
        return SKIPPED
    return FREE if inside and whole and in_range and far <= least else JUDGED


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _cells(
    corner: Any,
    offsets: Array,
    depths: Any,
    level: int,
    view: Any,
    pyramid: Any,
    model: Judgement,
    scratch: Any,
    evidence: Array,
) -> Any:
    """Judge the cells of a block whose depths are beyond depths[0], up to depths[1]; how many learnt something."""
    _, focal, cx, cy, focal_baseline, width, height, cell, range_max = view
    nodes, pairs, _, layout = pyramid
    geometry, base, limits, limits_m, needed, chosen = scratch[0]
    gathered, words, near_by, readings, bits, ratio = scratch[1]
    first, h, w = layout[level]
    strength = strength_of(level, model)
    scale = 1.0 / (1 << level)
    camera, cells = (focal, cx, cy, width, height), (cell, range_max, depths[0], depths[1])
    _project(corner, offsets, camera, cells, (first, h, w, scale), geometry, base)
    _limits(pairs, base, limits)
    free = _fixed(model.free * strength)
    count, learnt = _choose(limits_m, geometry, (0.5 * cell, free), needed, chosen, evidence)
    if count:
        full = (count + LANES - 1) // LANES * LANES
        sizes = (full, focal_baseline, 0.5 * cell, focal * cell * scale)
        _gather(nodes, base, w, geometry, sizes, chosen, gathered, near_by)
        _unpack(words, full, bits)
        if model.printed_odds > 0:
            _judge_printed(readings, near_by, count, model, ratio)
        else:
            _judge(readings, near_by, full, model, ratio)
        learnt += _write(ratio, chosen, count, model, strength, evidence)
    return learnt


@njit(cache=True, nogil=True, error_model="numpy")
def _project(corner: Any, offsets: Array, camera: Any, cells: Any, level: Any, geometry: Array, base: Array) -> None:
    """Fill base (512,), the first of each cell's four nodes, and geometry (5, 512).

    geometry: depth, range^2, 1 where in view, and how far right of and below the first node's centre, in nodes.
    """
    f32 = np.float32
    x0, y0, z0 = f32(corner[0]), f32(corner[1]), f32(corner[2])
    focal, cx, cy = f32(camera[0]), f32(camera[1] + 0.5), f32(camera[2] + 0.5)
    width, height, scale = f32(camera[3]), f32(camera[4]), f32(level[3])
    cell, farthest, beyond, up_to = f32(cells[0]), f32(cells[1] * cells[1]), f32(cells[2]), f32(cells[3])
    first, last_row, last_column = np.uint32(level[0]), f32(level[1] - 2), f32(level[2] - 2)
    w = np.uint32(level[2])
    one, zero, middle = f32(1), f32(0), f32(0.5)
    for c in range(CELLS):
        x, y, z = x0 + offsets[0, c], y0 + offsets[1, c], z0 + offsets[2, c]
        square = x * x + y * y + z * z
        over = one / max(z, cell)
        u, v = focal * x * over + cx, focal * y * over + cy
        seen = (z >= cell) & (z > beyond) & (z <= up_to) & (square <= farthest)
        seen = seen & (u >= zero) & (u < width) & (v >= zero) & (v < height)
        geometry[0, c] = z
        geometry[1, c] = square
        geometry[2, c] = one if seen else zero
        # The four nodes whose centres are nearest; at the image's edge the last four.
        across, down = max(u * scale - middle, zero), max(v * scale - middle, zero)
        column, row = np.int32(min(across, last_column)), np.int32(min(down, last_row))
        geometry[3, c] = min(across - f32(column), one)
        geometry[4, c] = min(down - f32(row), one)
        base[c] = first + np.uint32(row) * w + np.uint32(column)


@njit(cache=True, nogil=True, error_model="numpy")
def _limits(pairs: Array, base: Array, limits: Array) -> None:
    for c in range(CELLS):
        limits[c] = pairs[np.uint64(base[c])]


@njit(cache=True, nogil=True, error_model="numpy")
def _choose(limits_m: Array, geometry: Array, values: Any, needed: Array, chosen: Array, evidence: Array) -> Any:
    """Give the cells that are plainly free their evidence; put those that are to be judged in chosen.

    limits_m (1024,): the window of each cell. values: half a cell [m], evidence of free space. Returns how many are
    to be judged, and how many are free.
    """
    half, free = np.float32(values[0]), np.int16(values[1])
    n_free = np.int32(0)
    for c in range(CELLS):
        depth = geometry[0, c]
        shown = (geometry[2, c] > 0) & (depth - half <= limits_m[2 * c + 1])
        plain = shown & (depth + half <= limits_m[2 * c])
        evidence[c] = free if plain else evidence[c]
        n_free += np.int32(plain)
        needed[c] = np.uint8(shown & (not plain))
    count = np.uint64(0)
    for c in range(CELLS):
        chosen[count] = np.uint32(c)
        count += np.uint64(needed[c])
    return np.int64(count), np.int64(n_free)


@njit(cache=True, nogil=True, error_model="numpy")
def _gather(
    nodes: Array, base: Array, w: int, geometry: Array, sizes: Any, chosen: Array, gathered: Array, near_by: Array
) -> None:
    """Fill gathered (4, 512), the four nodes of each chosen cell, and near_by (4, 512).

    near_by: depth / (f b); half a cell over the range; shares of the footprint in the left and in the upper nodes.
    """
    step, one = np.uint64(w), np.uint64(1)
    for n in range(sizes[0]):
        c = np.uint64(chosen[n])
        at = np.uint64(base[c])
        gathered[0, n] = nodes[at]
        gathered[1, n] = nodes[at + one]
        gathered[2, n] = nodes[at + step]
        gathered[3, n] = nodes[at + step + one]
        near_by[0, n] = geometry[0, c]
        near_by[1, n] = geometry[1, c]
        near_by[2, n] = geometry[3, c]
        near_by[3, n] = geometry[4, c]
    scale, half = np.float32(1 / sizes[1]), np.float32(sizes[2])
    width, middle, end, unit = np.float32(sizes[3]), np.float32(0.5), np.float32(1.5), np.float32(1)
    for axis in range(2, 4):
        for n in range(sizes[0]):
            # Half the width of the footprint in nodes, whose centres are at 0 and 1.
            place, across = near_by[axis, n], middle * max(width / near_by[0, n], unit)
            before = middle - max(place - across, -middle)
            after = min(place + across, end) - middle
            near_by[axis, n] = before / (before + after)
    for n in range(sizes[0]):
        near_by[0, n] = near_by[0, n] * scale
        near_by[1, n] = half / np.sqrt(near_by[1, n])


@njit(cache=True, nogil=True, error_model="numpy")
def _unpack(words: Array, count: int, bits: Array) -> None:
    """Bits of d, d / sigma and relief / sigma, (4, 3, 512) int32, of gathered nodes (4, 1024) int32."""
    for k in range(4):
        for n in range(count):
            word = words[k, 2 * n + 1]
            bits[k, 0, n] = words[k, 2 * n]
            bits[k, 1, n] = word & np.int32(-65536)
            bits[k, 2, n] = word << np.int32(16)


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _phi(x: Any) -> Any:
    """Phi(x) - 1/2 to 3e-4, and exactly -+1/2 from -+3.5 on: a least-squares polynomial."""
    f32 = np.float32
    x = min(max(x, f32(-3.5)), f32(3.5))
    y = x * x
    p = f32(5.46413733e-08)
    p = f32(-2.97817854e-06) + y * p
    p = f32(7.12535984e-05) + y * p
    p = f32(-0.00100685015) + y * p
    p = f32(0.00957585315) + y * p
    p = f32(-0.0661152478) + y * p
    p = f32(0.399007647) + y * p
    return x * p


@njit(cache=True, nogil=True, error_model="numpy")
def _judge(readings: Array, near_by: Array, count: int, model: Judgement, ratio: Array) -> None:
    """Write the mean likelihood ratio of the four nodes of each cell, 0 where all of them are hidden or invalid.

    A node's ratio is F + (A - F) Phi(u + h) - (A - 1) Phi(u - h): see sensor_model.likelihood_ratio. The mean, by the
    nodes' shares of the footprint, is that of a surface which may lie in any part of the cell: one part that is hit
    outweighs others that are passed.
    """
    f32 = np.float32
    rise, fall, middle = f32(model.hit - model.passed), f32(model.hit - 1), f32(0.5 * (model.passed + 1))
    behind, zero, one, least = f32(model.behind), f32(0), f32(1), f32(LEAST_SHARE)
    for n in range(count):
        scale, half = near_by[0, n], near_by[1, n]
        total = weight = known = zero
        for k in range(4):
            d, q = readings[k, 0, n], readings[k, 1, n]
            t = d * scale
            u, h = q * (t - one), q * t * half + readings[k, 2, n]
            beside = near_by[2, n] if k % 2 == 0 else one - near_by[2, n]
            share = beside * (near_by[3, n] if k < 2 else one - near_by[3, n])
            valid = max(share, least) if d > zero else zero
            shown = valid if u - h <= behind else zero
            # A hidden part says nothing: 1.
            total += valid + shown * (middle - one + rise * _phi(u + h) - fall * _phi(u - h))
            weight += valid
            known += shown
        ratio[n] = total / max(weight, least) if known > zero else zero


@njit(cache=True, nogil=True, error_model="numpy")
def _judge_printed(readings: Array, near_by: Array, count: int, model: Judgement, ratio: Array) -> None:
    """As _judge, by Eqs. 11 and 12 as they stand, k = cell, and printed Eq. 3: a ratio is odds(p) odds(prior)."""
    odds_0 = model.printed_odds
    p_free = model.passed / (odds_0 + model.passed)
    for n in range(count):
        total, weight, known = 0.0, 0, 0
        for k in range(4):
            d, q = readings[k, 0, n], readings[k, 1, n]
            if d > 0:
                t = d * near_by[0, n]
                u, h = q * (t - 1), q * t * near_by[1, n]
                p = _printed(u, h, p_free)
                shown = u - h <= model.behind
                total += p / (1 - p) * odds_0 if shown else 1.0
                weight += 1
                known += shown
        ratio[n] = total / max(weight, 1) if known else 0.0


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _printed(u: float, h: float, p_free: float) -> float:
    side = p_free if u < 0 else 0.5
    p = side + (0.5 + 2 * h / math.sqrt(2 * math.pi) - side) * math.exp(-0.5 * u * u)
    # What exceeds 1 cannot be fused.
    return min(p, 1 - 1e-6) if u > -h - 3.5 else p_free


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _fixed(value: float) -> Any:
    return np.int16(round(min(max(value, -float(LARGEST_EVIDENCE)), float(LARGEST_EVIDENCE))))


@njit(cache=True, nogil=True, error_model="numpy")
def _write(ratio: Array, chosen: Array, count: int, model: Judgement, strength: float, evidence: Array) -> int:
    """Write the evidence of the chosen cells; how many of them learnt something."""
    table, last = model.table, np.float32(len(model.table) - 1)
    to_index, times = np.float32((len(table) - 1) / math.sqrt(model.hit)), np.float32(strength)
    least, most = np.float32(-LARGEST_EVIDENCE), np.float32(LARGEST_EVIDENCE)
    learnt = 0
    for n in range(count):
        known = ratio[n] > 0
        if model.printed_odds > 0:
            gain = np.float32(math.log(max(ratio[n], 1e-30)) * ONE)
        else:
            place = min(np.sqrt(ratio[n]) * to_index + np.float32(0.5), last) if known else np.float32(0)
            gain = table[np.uint64(np.int32(place))]
        value = np.rint(min(max(gain * times, least), most))
        evidence[np.uint64(chosen[n])] = np.int16(value) if known else np.int16(NOTHING)
        learnt += known
    return learnt
