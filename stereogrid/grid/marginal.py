"""The mean of what one observation says to a cell, over the poses that its camera may have had.

P(observation | cell) is the mean over the poses of P(observation | cell, pose), so likelihood ratios are averaged,
not evidence: one pose by which the cell is hit outweighs others by which rays pass it. A pose that says nothing of a
cell counts as the ratio 1.
"""

import math
from typing import Any

import numpy as np
from numba import njit

from ..geometry import Array
from .blocks import CELLS
from .cells import LARGEST_EVIDENCE, NOTHING, ONE
from .sweep import FREE, JUDGED, SKIPPED

BELOW_NAT = 16
"""A ratio that is smaller than the largest by this factor e^16 adds nothing to the mean."""
EXPONENTIALS = np.append(np.exp(-np.arange(BELOW_NAT * ONE) / ONE), 0.0).astype(np.float32)
"""e^-x for x in ONE-ths of a nat; the last stands for all that is further below."""
BITS_OF_ROOT_HALF = 0x3F3504F3
"""sqrt(1/2) as float32."""


@njit(cache=True, nogil=True, error_model="numpy")
def average(part: tuple[int, int], weights: Array, weight: float, stack: Any, exponentials: Array) -> None:
    """Average blocks part[0] to part[1] over K poses of weights (K,) float32, in place: the first pose gets the mean.

    stack: kinds (K, B) int8, free evidence (K, B) int16 and evidence (K, B, 512) int16, as the sweep writes them.
    weight: what the observation is worth: it is applied to the mean.
    """
    kinds, free, evidence = stack
    top, mean, known = np.empty(CELLS, np.int32), np.empty(CELLS, np.float32), np.empty(CELLS, np.uint8)
    for b in range(part[0], part[1]):
        seen = judged = False
        for k in range(len(weights)):
            seen = seen or kinds[k, b] != SKIPPED
            judged = judged or kinds[k, b] == JUDGED
        if judged:
            _largest(kinds[:, b], free[:, b], evidence[:, b], top, known)
            _mean(kinds[:, b], free[:, b], evidence[:, b], (weights, exponentials), top, mean)
            _write(top, mean, known, weight, evidence[0, b])
            kinds[0, b] = JUDGED
        elif seen:
            free[0, b] = _whole(kinds[:, b], free[:, b], weights, weight)
            kinds[0, b] = FREE


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _whole(kinds: Array, free: Array, weights: Array, weight: float) -> Any:
    """The evidence for all the cells of a block that some poses see as free and others do not see."""
    largest = 0.0 if (kinds == SKIPPED).any() else -np.inf
    for k in range(len(weights)):
        largest = max(largest, float(free[k])) if kinds[k] == FREE else largest
    mean = 0.0
    for k in range(len(weights)):
        mean += weights[k] * math.exp(((free[k] if kinds[k] == FREE else 0) - largest) / ONE)
    return np.int16(round(weight * (largest + ONE * math.log(mean))))


@njit(cache=True, nogil=True, error_model="numpy")
def _largest(kinds: Array, free: Array, evidence: Array, top: Array, known: Array) -> None:
    """Fill top (512,), the largest evidence of each cell, and known (512,): whether any pose says something."""
    for k in range(len(kinds)):
        whole = np.int32(free[k]) if kinds[k] == FREE else np.int32(0)
        if kinds[k] == JUDGED:
            row = evidence[k]
            for c in range(CELLS):
                told = row[c] != NOTHING
                value = np.int32(row[c]) if told else np.int32(0)
                top[c] = max(top[c], value) if k else value
                known[c] = (known[c] if k else np.uint8(0)) | np.uint8(told)
        else:
            told = kinds[k] == FREE
            for c in range(CELLS):
                top[c] = max(top[c], whole) if k else whole
                known[c] = (known[c] if k else np.uint8(0)) | np.uint8(told)


@njit(cache=True, nogil=True, error_model="numpy")
def _mean(kinds: Array, free: Array, evidence: Array, constants: Any, top: Array, mean: Array) -> None:
    """Fill mean (512,): the mean ratio of each cell over its largest one."""
    weights, exponentials = constants
    last = np.int32(len(exponentials) - 1)
    mean[:] = np.float32(0)
    for k in range(len(kinds)):
        share = weights[k]
        if kinds[k] == JUDGED:
            row = evidence[k]
            for c in range(CELLS):
                value = np.int32(row[c]) if row[c] != NOTHING else np.int32(0)
                mean[c] += share * exponentials[np.uint64(min(top[c] - value, last))]
        else:
            value = np.int32(free[k]) if kinds[k] == FREE else np.int32(0)
            for c in range(CELLS):
                mean[c] += share * exponentials[np.uint64(min(top[c] - value, last))]


@njit(cache=True, nogil=True, error_model="numpy")
def _write(top: Array, mean: Array, known: Array, weight: float, evidence: Array) -> None:
    """Write weight (top + log mean) as evidence (512,).

    The logarithm is that of a power of two and of m in [sqrt(1/2), sqrt(2)), log m = 2 atanh((m - 1) / (m + 1)):
    arithmetic alone, which becomes vector instructions; right to 1e-6.
    """
    f32 = np.float32
    one, third, fifth, seventh = f32(1), f32(1 / 3), f32(1 / 5), f32(1 / 7)
    nat, log_2, times = f32(ONE), f32(math.log(2)), f32(weight)
    least, most = f32(-LARGEST_EVIDENCE), f32(LARGEST_EVIDENCE)
    bits = mean.view(np.int32)
    rest = np.empty(CELLS, np.int32)
    m = rest.view(np.float32)
    for c in range(CELLS):
        power = (bits[c] - np.int32(BITS_OF_ROOT_HALF)) >> np.int32(23)
        rest[c] = bits[c] - (power << np.int32(23))
        mean[c] = f32(power) * log_2
    for c in range(CELLS):
        s = (m[c] - one) / (m[c] + one)
        y = s * s
        log = mean[c] + f32(2) * s * (one + y * (third + y * (fifth + y * seventh)))
        value = np.rint(min(max(times * (f32(top[c]) + nat * log), least), most))
        evidence[c] = np.int16(value) if known[c] else np.int16(NOTHING)
