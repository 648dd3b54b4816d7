"""Which face a camera sees at every pixel: convex polygons, filled row by row into a buffer of inverse depth.

Inverse depth is affine over the image, so the comparison is exact, and neighbouring faces share their border
without gaps: a pixel belongs to a polygon when its centre lies in it, left and top borders included.
"""

import math
from typing import NamedTuple

import numpy as np

from stereogrid.geometry import Array

from ..kernel import inner, kernel
from .shapes import Shapes

NEAR_M = 0.01
"""What is nearer than this to the plane of the lens is cut off."""


class Outlines(NamedTuple):
    """The S faces that may be seen, as polygons in the image.

    faces (S,) int32. planes (S, 9): see shading. points (C, 2): columns and rows of their corners [px], face after
    face; starts (S + 1,): where each face's begin.
    """

    faces: Array
    planes: Array
    points: Array
    starts: Array


@inner
def _to_camera(vertex: Array, eye: Array, lens: Array) -> tuple[float, float, float]:
    """(x z, y z, z) of the pixel (x, y) and depth z of a vertex."""
    a, b, c = vertex[0] - eye[0], vertex[1] - eye[1], vertex[2] - eye[2]
    return (
        a * lens[0, 0] + b * lens[1, 0] + c * lens[2, 0],
        a * lens[0, 1] + b * lens[1, 1] + c * lens[2, 1],
        a * lens[0, 2] + b * lens[1, 2] + c * lens[2, 2],
    )


@kernel
def _cut_near(corners: Array, count: int, polygon: Array) -> int:
    """Write the pixels (K, 2) of a polygon's part beyond NEAR_M; returns K, 0 when it lies behind.

    corners (count, 3): see _to_camera.
    """
    kept = 0
    for k in range(count):
        a, b = (k if k > 0 else count) - 1, k
        if (corners[a, 2] > NEAR_M) != (corners[b, 2] > NEAR_M):
            # Always from the nearer end, so that both faces at an edge cut it at the same point.
            near, far = (a, b) if corners[a, 2] < corners[b, 2] else (b, a)
            share = (NEAR_M - corners[near, 2]) / (corners[far, 2] - corners[near, 2])
            for c in range(2):
                polygon[kept, c] = (corners[near, c] + share * (corners[far, c] - corners[near, c])) / NEAR_M
            kept += 1
        if corners[b, 2] > NEAR_M:
            polygon[kept, 0], polygon[kept, 1] = corners[b, 0] / corners[b, 2], corners[b, 1] / corners[b, 2]
            kept += 1
    return kept


@inner
def _meets_pixels(polygon: Array, count: int, shape: tuple[int, int], margin: float) -> bool:
    """Whether the box round a polygon holds the centre of a pixel of the image, give or take a margin."""
    low_x = high_x = polygon[0, 0]
    low_y = high_y = polygon[0, 1]
    for k in range(1, count):
        low_x, high_x = min(low_x, polygon[k, 0]), max(high_x, polygon[k, 0])
        low_y, high_y = min(low_y, polygon[k, 1]), max(high_y, polygon[k, 1])
    first_x, first_y = max(low_x - margin, 0.0), max(low_y - margin, 0.0)
    last_x, last_y = min(high_x + margin, shape[1] - 1.0), min(high_y + margin, shape[0] - 1.0)
    found: bool = math.ceil(first_x) <= last_x and math.ceil(first_y) <= last_y
    return found


@kernel
def survey(
    shapes: Shapes, span: tuple[int, int], camera: tuple[Array, Array], image: tuple[int, int, float]
) -> Outlines:
    """Those of the faces [span) that look at the camera and may cover a pixel.

    camera: eye and rays (4, 3), see shading.project_plane, and the inverse (3, 3) of the rays; both in the frame of
    the body that the faces belong to. image: height, width, and how far from the pixels' centres it is looked [px].
    """
    rays, lens = camera
    eye = rays[0]
    most = span[1] - span[0]
    room = shapes.starts[span[1]] - shapes.starts[span[0]] + most
    faces, starts = np.empty(most, np.int32), np.empty(most + 1, np.int64)
    points, planes = np.empty((room, 2)), np.empty((most, 9))
    corners = np.empty((room, 3))
    found = past = 0
    starts[0] = 0
    for f in range(span[0], span[1]):
        n = shapes.normals[f]
        distance = shapes.offsets[f] - (n[0] * eye[0] + n[1] * eye[1] + n[2] * eye[2])
        if not distance < 0.0:
            continue
        first, count = shapes.starts[f], shapes.starts[f + 1] - shapes.starts[f]
        for k in range(count):
            corners[k] = _to_camera(shapes.vertices[shapes.corners[first + k]], eye, lens)
        kept = _cut_near(corners, count, points[past:])
        if kept > 0 and _meets_pixels(points[past:], kept, (image[0], image[1]), image[2]):
            past += kept
            faces[found], starts[found + 1] = f, past
            _project_plane(shapes, f, rays, distance, planes[found])
            found += 1
    return Outlines(faces[:found], planes[:found], points[:past], starts[: found + 1])


@inner
def _project_plane(shapes: Shapes, f: int, rays: Array, distance: float, plane: Array) -> None:
    """Write the nine coefficients of a face in a camera; see shading."""
    n, eye = shapes.normals[f], rays[0]
    for c in range(3):
        ray = rays[1 + c]
        plane[c] = (n[0] * ray[0] + n[1] * ray[1] + n[2] * ray[2]) / distance
    for a in range(2):
        axis = shapes.axes[f, a]
        start = axis[0] * eye[0] + axis[1] * eye[1] + axis[2] * eye[2]
        for c in range(3):
            ray = rays[1 + c]
            along = axis[0] * ray[0] + axis[1] * ray[1] + axis[2] * ray[2]
            plane[3 + 3 * a + c] = along + start * plane[c]


@kernel
def _find_spans(polygon: Array, shift: tuple[float, float], spans: Array, width: int) -> tuple[int, int]:
    """Write the columns [first, past the last) of a polygon in rows [low, high) to spans (H, 2); returns low, high.

    Seen from behind a polygon runs clockwise: its spans end before they start, and nothing is drawn.
    """
    low, high = len(spans), 0
    count = len(polygon)
    for k in range(count):
        a, b = (k if k > 0 else count) - 1, k
        # A counterclockwise polygon goes down on its left side.
        side = 0 if polygon[b, 1] > polygon[a, 1] else 1
        top, bottom = (a, b) if side == 0 else (b, a)
        y_top, y_bottom = polygon[top, 1] - shift[1], polygon[bottom, 1] - shift[1]
        first = math.ceil(min(max(y_top, 0.0), float(len(spans))))
        last = math.ceil(min(max(y_bottom, 0.0), float(len(spans))))
        low, high = min(low, first), max(high, last)
        for y in range(first, last):
            share = (y - y_top) / (y_bottom - y_top)
            x = polygon[top, 0] + share * (polygon[bottom, 0] - polygon[top, 0]) - shift[0]
            spans[y, side] = math.ceil(min(max(x, 0.0), float(width)))
    return low, high


@kernel
def fill(outlines: Outlines, shape: tuple[int, int], shift: tuple[float, float]) -> Array:
    """Which of the outlined faces (H, W) int32 each pixel sees first, looking `shift` (x, y) [px] beside its centre.

    These are indices into outlines.faces, -1 where nothing is.
    """
    height, width = shape
    seen, nearest = np.empty((height, width), np.int32), np.empty((height, width))
    seen[:], nearest[:] = -1, 0.0
    spans = np.empty((height, 2), np.int64)
    planes, starts = outlines.planes, outlines.starts
    for k in range(len(outlines.faces)):
        low, high = _find_spans(outlines.points[starts[k] : starts[k + 1]], shift, spans, width)
        for y in range(low, high):
            start = planes[k, 1] * (y + shift[1]) + planes[k, 2] + planes[k, 0] * shift[0]
            for x in range(spans[y, 0], spans[y, 1]):
                inverse_depth = planes[k, 0] * x + start
                if inverse_depth > nearest[y, x]:
                    nearest[y, x], seen[y, x] = inverse_depth, k
    return seen
