"""The disparity image and its coarser copies: what a footprint of many pixels says, as one reading.

Level 0 has a node for every pixel, each further level one for every 2 x 2 nodes below. A node is the mean of the
*nearest* surface among its pixels, so that a thin obstacle survives in front of a wall; invalid pixels are left out.
Its width is that of a pixel over the root of the independent looks that its pixels hold (their number over the square
of the correlation length), and its relief is how far the surface itself reaches in depth within the node: a floor seen
at a grazing angle is no noise.
"""

import threading
from dataclasses import dataclass

import numpy as np
from numba import njit

from ..camera import StereoCamera
from ..geometry import Array
from ..observation import Disparity
from ..sensor_model import REACH_SIGMAS, SensorModel, reach_behind

GATE_SIGMAS = 2.0
"""Readings of neighbouring nodes that differ by less than this many sigmas of a pixel belong to one surface,"""
STEEPEST = 4.0
"""or by no more than a surface this steep explains (depth over width, as seen from the camera)."""
RELIEF_OF_NOISE = (1.2, 2.0)
"""So many variances of a child's mean, and so many more where children err independently, are taken for noise."""
LEAST_CERTAINTY = 2.0
"""A node whose disparity is less than this many of its own sigmas knows no depth, and counts as invalid."""
SMALLEST_LEVEL = 4
"""No level is narrower than this [nodes]."""


@dataclass(frozen=True)
class Pyramid:
    """nodes (N, 2) float32: d [px], then d / sigma and relief / sigma as two bfloat16 in one word; 0: invalid.

    windows (N, 2) float32 [m]: depth up to which a node and its three neighbours to the right and below show plainly
    free space, and from which they say nothing (-inf: none is valid). layout (L, 3) int64: first node, height and
    width of each level.
    """

    nodes: Array
    windows: Array
    layout: Array

    @classmethod
    def of(
        cls,
        camera: StereoCamera,
        disparity: Disparity,
        model: SensorModel,
        *,
        motion_sigma_m: float = 0.0,
        motion_rule: str = "rss",
        left_m2: Array | None = None,
        finest: int = 0,
    ) -> "Pyramid":
        """The pyramid of one disparity image, until the next of this thread. motion_sigma_m: eps of Eq. 13 [m].

        motion_rule: how eps joins the width. left_m2: covariance (3, 3) of the camera's position [m^2], along the
        axes of cam, which widens each reading by its part along the ray (eps_of_nodes). finest: the first level that
        will be read; what lies below is averaged, but not judged.
        """
        layout, sums, readings, nodes, windows = _buffers(camera.shape)
        steepest = STEEPEST / camera.focal_px
        average_nodes(disparity.disparity_px, disparity.sigma_px, layout, (GATE_SIGMAS, steepest), sums)
        looks_per_px = disparity.correlation_px**-2.0
        eps = motion_sigma_m / camera.focal_baseline_px_m
        reach = REACH_SIGMAS, reach_behind(model)
        constants = (looks_per_px, eps, camera.focal_baseline_px_m, *reach, *RELIEF_OF_NOISE, LEAST_CERTAINTY)
        finest = min(finest, len(layout) - 1)
        start = int(layout[finest, 0])
        of_nodes = None
        if left_m2 is not None:
            of_nodes = eps_of_nodes(camera, layout, motion_sigma_m, left_m2)
            of_nodes = of_nodes[start:] / np.float32(camera.focal_baseline_px_m)
        judge_nodes(sums, start, np.array(constants, np.float32), motion_rule == "linear", readings, of_nodes)
        pack_nodes(readings, start, readings[1:3].view(np.int32), nodes, nodes.view(np.int32))
        widen(readings[3], readings[4], layout[finest:], windows)
        return cls(nodes, windows, layout)


_kept = threading.local()


def _buffers(shape: tuple[int, int]) -> tuple[Array, Array, Array, Array, Array]:
    """Layout and arrays of this thread for images of that shape: new memory for each image would cost more time than
    the pyramid itself.
    """
    if getattr(_kept, "shape", None) != shape:
        layout = layout_of(shape)
        n = int(layout[-1, 0] + layout[-1, 1] * layout[-1, 2])
        _kept.shape, _kept.arrays = shape, (layout, *(np.zeros((k, n), np.float32) for k in (4, 5)))
        _kept.arrays += np.zeros((n, 2), np.float32), np.zeros((n, 2), np.float32)
    arrays: tuple[Array, Array, Array, Array, Array] = _kept.arrays
    return arrays


def layout_of(shape: tuple[int, int]) -> Array:
    """(L, 3) int64 first node, height and width of the levels of an image of shape (H, W)."""
    levels, first, (height, width) = [], 0, shape
    while True:
        levels.append((first, height, width))
        first += height * width
        if min(height, width) < 2 * SMALLEST_LEVEL:
            return np.array(levels, dtype=np.int64)
        height, width = (height + 1) // 2, (width + 1) // 2


def eps_of_nodes(camera: StereoCamera, layout: Array, eps_m: float, left_m2: Array) -> Array:
    """The depth error [m] (N,) float32 of the nodes of a layout (L, 3), from eps and the position's covariance (3, 3)
    [m^2] along the axes of cam: both add as independent errors do.

    Along the unit ray u the position errs by u^T S u; at depth z on a ray of length l that is (z / l)^2 times as much
    in depth: v^T S v / |v|^4 with v = (x, y, 1).
    """
    eps = np.empty(int(layout[-1, 0] + layout[-1, 1] * layout[-1, 2]), np.float32)
    fill_eps(layout, (camera.focal_px, camera.cx_px, camera.cy_px), float(eps_m) ** 2, left_m2, eps)
    return eps


@njit(cache=True, nogil=True, error_model="numpy")
def fill_eps(layout: Array, optics: tuple[float, float, float], square: float, S: Array, eps: Array) -> None:
    """Fill eps (N,) float32 [m]: see eps_of_nodes. optics: focal, cx, cy; square: eps^2 of all nodes [m^2]."""
    focal, cx, cy = optics
    one, always = np.float32(1), np.float32(square)
    for level in range(len(layout)):
        first, height, width = layout[level]
        step, middle = float(1 << level), 0.5 * ((1 << level) - 1)
        for row in range(height):
            y = (row * step + middle - cy) / focal
            # Along a row, v^T S v is a + (b + c x) x, and v^2 is e + x^2.
            a, b = np.float32((S[1, 1] * y + 2 * S[1, 2]) * y + S[2, 2]), np.float32(2 * (S[0, 1] * y + S[0, 2]))
            c, e = np.float32(S[0, 0]), one + np.float32(y * y)
            x0, dx = np.float32((middle - cx) / focal), np.float32(step / focal)
            of_row = eps[first + row * width : first + (row + 1) * width]
            for n in range(width):
                x = x0 + np.float32(n) * dx
                over = one / (e + x * x)
                of_row[n] = np.sqrt(max(a + (b + c * x) * x, np.float32(0)) * over * over + always)


@njit(cache=True, nogil=True, error_model="numpy")
def average_nodes(disparity: Array, sigma: Array, layout: Array, gates: tuple[float, float], sums: Array) -> None:
    """Fill sums (4, N) float32: mean d, mean sigma of a pixel, variance of d between children, number of pixels.

    disparity, sigma (H, W) float32, NaN = no match. gates: in sigmas, and in px a px of d and of node.
    """
    height, width = disparity.shape
    for row in range(height):
        d, s, v, n = sums[0], sums[1], sums[2], sums[3]
        for column in range(width):
            known = disparity[row, column] > 0
            at = row * width + column
            d[at] = disparity[row, column] if known else np.float32(0)
            s[at] = sigma[row, column] if known else np.float32(0)
            v[at] = np.float32(0)
            n[at] = np.float32(1) if known else np.float32(0)
    for level in range(1, len(layout)):
        below, bh, bw = layout[level - 1]
        first, h, w = layout[level]
        step = np.float32(gates[1] * (1 << level))
        for row in range(h):
            upper = below + 2 * row * bw
            # The last row and column of an odd level count twice: that moves no mean.
            lower = below + min(2 * row + 1, bh - 1) * bw
            whole = bw // 2
            _merge(sums, upper, lower, first + row * w, whole, 1, np.float32(gates[0]), step)
            if whole < w:
                _merge(sums, upper + bw - 1, lower + bw - 1, first + row * w + whole, 1, 0, np.float32(gates[0]), step)


@njit(cache=True, nogil=True, error_model="numpy")
def _merge(sums: Array, upper: int, lower: int, to: int, count: int, right: int, gate: float, step: float) -> None:
    """Merge children 2 i and 2 i + right, i < count, of the rows beginning at upper and lower into nodes from `to`."""
    zero, one = np.float32(0), np.float32(1)
    d0, s0, n0 = sums[0, upper:], sums[1, upper:], sums[3, upper:]
    d1, s1, n1 = sums[0, lower:], sums[1, lower:], sums[3, lower:]
    d, s, v, n = sums[0, to:], sums[1, to:], sums[2, to:], sums[3, to:]
    for n_ in range(count):
        # Unsigned: a signed index would carry a check for negative ones.
        i = np.uint64(n_)
        a, b = i + i, i + i + np.uint64(right)
        near = max(max(d0[a], d0[b]), max(d1[a], d1[b]))
        floor = near - step * near
        w0 = n0[a] if d0[a] >= floor - gate * s0[a] else zero
        w1 = n0[b] if d0[b] >= floor - gate * s0[b] else zero
        w2 = n1[a] if d1[a] >= floor - gate * s1[a] else zero
        w3 = n1[b] if d1[b] >= floor - gate * s1[b] else zero
        weight = w0 + w1 + w2 + w3
        share = one / max(weight, one)
        mean = (w0 * d0[a] + w1 * d0[b] + w2 * d1[a] + w3 * d1[b]) * share
        e0, e1, e2, e3 = d0[a] - mean, d0[b] - mean, d1[a] - mean, d1[b] - mean
        d[i] = mean
        s[i] = (w0 * s0[a] + w1 * s0[b] + w2 * s1[a] + w3 * s1[b]) * share
        v[i] = (w0 * e0 * e0 + w1 * e1 * e1 + w2 * e2 * e2 + w3 * e3 * e3) * share
        n[i] = weight


@njit(cache=True, nogil=True, error_model="numpy")
def judge_nodes(sums: Array, start: int, constants: Array, linear: bool, readings: Array, eps_: Array | None) -> None:
    """Fill readings (5, N) float32 from sums (4, N): d, d / sigma, relief / sigma, free_to, hidden_from [m];
    nodes before start are left out.

    constants (8,) float32: looks a pixel, eps / (f b) [1 / px], f b, reach before and behind [sigmas], noise factors,
    least certainty. eps_ float32: eps / (f b) of each node from start on; None: the same for all, and the compiled
    kernel has no trace of it.
    """
    looks_per_px, eps, focal_baseline = constants[0], constants[1], constants[2]
    before, behind, least, more = constants[3], constants[4], constants[5], constants[6]
    zero, one, tiny = np.float32(0), np.float32(1), np.float32(1e-9)
    four, quarter = np.float32(4), np.float32(0.25)
    d_, sigma_, between_, count_ = sums[0, start:], sums[1, start:], sums[2, start:], sums[3, start:]
    of_d, of_q, of_r, of_free, of_hidden = (
        readings[0, start:],
        readings[1, start:],
        readings[2, start:],
        readings[3, start:],
        readings[4, start:],
    )
    for n in range(len(d_)):
        d, sigma, between, count = d_[n], sigma_[n], between_[n], count_[n]
        if eps_ is not None:
            eps = eps_[n]
        looks = max(count * looks_per_px, one)
        of_child = max(quarter * count * looks_per_px, one)
        noise = sigma * sigma
        motion = eps * d * d
        # Averaging narrows the noise of pixels alone: where the robot is wrong, all of them are. Eq. 13.
        width = np.sqrt(noise / looks)
        width = width + motion if linear else np.sqrt(width * width + motion * motion)
        q = d / max(width, tiny)
        unexplained = between - (least + more * (one - one / looks)) * noise / of_child
        # A slope's children spread by 3/4 of its own variance, whose half extent is sqrt(3) of its deviation.
        r = np.sqrt(four * max(unexplained, zero)) / max(width, tiny)
        depth = focal_baseline / max(d, tiny)
        known = q >= constants[7]
        of_d[n] = d if known else zero
        of_q[n] = q if known else zero
        of_r[n] = r if known else zero
        of_free[n] = depth * (one - (before + r) / max(q, tiny)) if known else np.float32(np.inf)
        of_hidden[n] = depth * (one + (behind + r) / max(q, tiny)) if known else np.float32(-np.inf)


@njit(cache=True, nogil=True, error_model="numpy")
def pack_nodes(readings: Array, start: int, bits: Array, nodes: Array, node_bits: Array) -> None:
    """Pack d, and the upper halves of two float32 (bits (2, N) int32) in one word, so that a node is one load."""
    half = np.int32(0x8000)
    for n in range(np.uint64(start), np.uint64(nodes.shape[0])):
        nodes[n, 0] = readings[0, n]
        node_bits[n, 1] = ((bits[0, n] + half) & np.int32(-65536)) | (((bits[1, n] + half) >> 16) & np.int32(0xFFFF))


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"nnan", "nsz"})
def widen(free_to: Array, hidden_from: Array, layout: Array, windows: Array) -> None:
    """Fill windows (N, 2): the least free_to and the largest hidden_from of 2 x 2 nodes, at the upper left one."""
    for level in range(len(layout)):
        first, height, width = layout[level]
        for row in range(height - 1):
            upper, lower, end = first + row * width, first + (row + 1) * width, first + (row + 2) * width
            # Slices, and indices that cannot be negative: else every access carries a check.
            f0, f1, h0, h1 = free_to[upper:lower], free_to[lower:end], hidden_from[upper:lower], hidden_from[lower:end]
            of_row = windows[upper:lower]
            for n in range(width - 1):
                of_row[n, 0] = min(min(f0[n], f0[n + 1]), min(f1[n], f1[n + 1]))
                of_row[n, 1] = max(max(h0[n], h0[n + 1]), max(h1[n], h1[n + 1]))
