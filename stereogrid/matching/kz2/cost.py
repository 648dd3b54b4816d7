"""The energy of Kolmogorov and Zabih with the data cost and the automatic parameters of its published reference.

Kolmogorov and Zabih, "Computing visual correspondence with occlusions using graph cuts" (ICCV 2001); parameters after
Kolmogorov, Monasse and Tan, "Kolmogorov and Zabih's graph cuts stereo matching algorithm" (IPOL 2014).
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ...observation import Image

CUT_OFF = 30
"""Largest colour difference that counts, a channel [grey levels]."""
SMOOTH_BELOW = 8
"""A colour change smaller than this, in both images, is no edge [grey levels]."""
LARGEST_DENOMINATOR = 16
NO_ASSIGNMENT = np.iinfo(np.int16).max
"""Stands in the cost where the match would lie outside the right image."""

Costs = NDArray[np.int16]


@dataclass(frozen=True)
class Weights:
    """The energy's parameters over one denominator: occlusion K, and lambda1 > lambda2 of smoothness."""

    occlusion: int
    lambda1: int
    lambda2: int
    denominator: int


class Energy(NamedTuple):
    """What the kernels read. E = sum over matches of cost + sum over broken neighbouring matches of lambda.

    cost (L, H, W) int16: denominator * D - K of the match (x, y) -> (x - d, y), NO_ASSIGNMENT outside. left_flat,
    right_flat (H, W) uint8: as flat_edges gives them.
    """

    cost: Any
    left_flat: Any
    right_flat: Any
    lambda1: int
    lambda2: int


def energy_of_pair(left: Image, right: Image, num_disparities: int) -> tuple[Energy, Weights]:
    """The energy of a pair of images (H, W) or (H, W, 3) uint8, labels 0 .. num_disparities - 1."""
    data = data_cost(left, right, num_disparities)
    weights = automatic_weights(data)
    cost = np.int16(weights.denominator) * data - np.int16(weights.occlusion)  # at most 16 * 900: no overflow
    cost[data < 0] = NO_ASSIGNMENT
    return Energy(cost, flat_edges(left), flat_edges(right), weights.lambda1, weights.lambda2), weights


def data_cost(left: Image, right: Image, num_disparities: int) -> Costs:
    """D (L, H, W): the squared Birchfield-Tomasi difference, mean of the channels, in integers; -1 = no match.

    Birchfield and Tomasi (PAMI 1998): the distance of a pixel to the range that the other one and its four neighbours
    span at half way; each channel is cut off before it is squared.
    """
    cost = np.full((num_disparities, *left.shape[:2]), -1, np.int16)
    _fill_cost(cost, np.stack(_ranges(left)), np.stack(_ranges(right)))
    return cost


def _ranges(image: Image) -> tuple[NDArray[np.int16], NDArray[np.int16], NDArray[np.int16]]:
    """(values, lowest, highest) (H, W, channels): of each pixel and half way to its four neighbours, rounded down."""
    value = image.reshape(*image.shape[:2], -1).astype(np.int16)
    around = np.pad(value, ((1, 1), (1, 1), (0, 0)), mode="edge")
    near = (around[:-2, 1:-1], around[2:, 1:-1], around[1:-1, :-2], around[1:-1, 2:])
    half = [(value + other) // 2 for other in near]
    return value, np.minimum.reduce([value, *half]), np.maximum.reduce([value, *half])


@njit(cache=True, nogil=True)
def _fill_cost(cost: Any, left: Any, right: Any) -> None:
    """left, right (3, H, W, channels) int16: values, lowest, highest."""
    count, height, width = cost.shape
    channels = left.shape[3]
    for d in range(min(count, width)):
        for y in range(height):
            for x in range(d, width):
                total = 0
                for c in range(channels):
                    a, b = left[0, y, x, c], right[0, y, x - d, c]
                    to_right = max(a - right[2, y, x - d, c], right[1, y, x - d, c] - a, 0)
                    to_left = max(b - left[2, y, x, c], left[1, y, x, c] - b, 0)
                    total += min(to_right, to_left, CUT_OFF) ** 2
                cost[d, y, x] = total // channels


def automatic_weights(data: Costs) -> Weights:
    """K: the k-th smallest cost of a pixel, on average; lambda2 = K / 5, lambda1 = 3 lambda2, as fractions.

    k = max(3, (L + 2) / 4), over the pixels that have all L matches. The denominator, at most 16, is the one with the
    smallest sum of relative errors. That gives the fractions of the reference on its published pairs.
    """
    labels = len(data)
    complete = data[:, :, labels - 1 :].reshape(labels, -1)
    rank = min(max(3, (labels + 2) // 4), labels) - 1
    occlusion = float(np.partition(complete, rank, axis=0)[rank].mean()) if complete.size else 0.0
    wanted = np.maximum(np.array([occlusion, 0.6 * occlusion, 0.2 * occlusion]), 1e-3)
    by_denominator = {n: np.maximum(np.rint(wanted * n), 1).astype(int) for n in range(1, LARGEST_DENOMINATOR + 1)}
    best = min(by_denominator, key=lambda n: float(np.abs(by_denominator[n] / (n * wanted) - 1).sum()))
    k, lambda1, lambda2 = (int(number) for number in by_denominator[best])
    return Weights(k, lambda1, lambda2, best)


def flat_edges(image: Image) -> NDArray[np.uint8]:
    """(H, W) uint8: bit k where the colour hardly changes to the neighbour right (0), left, below and above (3)."""
    value = image.reshape(*image.shape[:2], -1).astype(np.int16)
    flat = np.zeros(image.shape[:2], np.uint8)
    for axis, bits in ((1, (1, 2)), (0, (4, 8))):
        same = np.abs(np.diff(value, axis=axis)).max(axis=2) < SMOOTH_BELOW
        before, after = (np.s_[:, :-1], np.s_[:, 1:]) if axis else (np.s_[:-1], np.s_[1:])
        flat[before] |= np.uint8(bits[0]) * same
        flat[after] |= np.uint8(bits[1]) * same
    return flat
