"""Which face a camera sees at every pixel: convex polygons, filled row by row into a buffer of inverse depth.

Inverse depth is affine over the image, so the comparison is exact, and neighbouring faces share their border
without gaps: a pixel belongs to a polygon when its centre lies in it, left and top borders included.
"""

import math

import numpy as np

from stereogrid.geometry import Array

from .kernel import kernel

NEAR_M = 0.01
"""What is nearer than this to the plane of the lens is cut off."""


@kernel
def _cut_near(points: Array, corners: Array, polygon: Array) -> int:
    """Write the pixels (K, 2) of a polygon's part beyond NEAR_M; returns K, 0 when it lies behind.

    points (V, 3): (x z, y z, z) of the pixel (x, y) and depth z of all vertices; corners: indices of the polygon's.
    """
    count = 0
    for k in range(len(corners)):
        a, b = corners[k - 1], corners[k]
        if (points[a, 2] > NEAR_M) != (points[b, 2] > NEAR_M):
            # Always from the nearer end, so that both faces at an edge cut it at the same point.
            near, far = (a, b) if points[a, 2] < points[b, 2] else (b, a)
            share = (NEAR_M - points[near, 2]) / (points[far, 2] - points[near, 2])
            for c in range(2):
                polygon[count, c] = (points[near, c] + share * (points[far, c] - points[near, c])) / NEAR_M
            count += 1
        if points[b, 2] > NEAR_M:
            polygon[count, 0], polygon[count, 1] = points[b, 0] / points[b, 2], points[b, 1] / points[b, 2]
            count += 1
    return count


@kernel
def _find_spans(polygon: Array, count: int, spans: Array, width: int) -> tuple[int, int]:
    """Write the columns [first, past the last) of a polygon in rows [low, high) to spans (H, 2); returns low, high.

    Seen from behind a polygon runs clockwise: its spans end before they start, and nothing is drawn.
    """
    low, high = len(spans), 0
    for k in range(count):
        a, b = (k if k > 0 else count) - 1, k
        # A counterclockwise polygon goes down on its left side.
        side = 0 if polygon[b, 1] > polygon[a, 1] else 1
        top, bottom = (a, b) if side == 0 else (b, a)
        first = math.ceil(min(max(polygon[top, 1], 0.0), float(len(spans))))
        last = math.ceil(min(max(polygon[bottom, 1], 0.0), float(len(spans))))
        low, high = min(low, first), max(high, last)
        for y in range(first, last):
            share = (y - polygon[top, 1]) / (polygon[bottom, 1] - polygon[top, 1])
            x = polygon[top, 0] + share * (polygon[bottom, 0] - polygon[top, 0])
            spans[y, side] = math.ceil(min(max(x, 0.0), float(width)))
    return low, high


@kernel
def first_faces(points: Array, corners: Array, starts: Array, planes: Array, shape: tuple[int, int]) -> Array:
    """The face (H, W) int32 that each pixel's centre sees first, -1 for none.

    points (V, 3): see _cut_near. corners: of all faces, one after the other, counterclockwise seen from outside;
    starts (F + 1,): where each face's begin. planes (F, >= 3): inverse depth (x, y, 1) of each face.
    """
    height, width = shape
    faces, nearest = np.empty((height, width), np.int32), np.empty((height, width))
    faces[:], nearest[:] = -1, 0.0
    spans = np.empty((height, 2), np.int64)
    polygon = np.empty((len(corners), 2))
    for f in range(len(starts) - 1):
        count = _cut_near(points, corners[starts[f] : starts[f + 1]], polygon)
        low, high = _find_spans(polygon, count, spans, width)
        for y in range(low, high):
            start = planes[f, 1] * y + planes[f, 2]
            for x in range(spans[y, 0], spans[y, 1]):
                inverse_depth = planes[f, 0] * x + start
                if inverse_depth > nearest[y, x]:
                    nearest[y, x], faces[y, x] = inverse_depth, f
    return faces
