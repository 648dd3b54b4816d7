"""The hot loops of scoring: arrays in, arrays out. Each has a NumPy twin in tests/unit/scoring."""

from typing import Any, NamedTuple

import numpy as np
from numba import njit


class Eyes(NamedTuple):
    """What `see_cells` must know of the stereo pair: pixels, metres, and the lattice of its depth images."""

    focal_px: float
    cx_px: float
    cy_px: float
    baseline_m: float
    width_px: float
    height_px: float
    pitch_x_px: float
    pitch_y_px: float
    max_range_m: float
    slack_m: float


SAME_SURFACE = 0.9
"""Neighbouring rays whose depths agree to this ratio are taken to meet one surface."""


@njit(cache=True, error_model="numpy")
def _minus(a: Any, b: Any) -> Any:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@njit(cache=True, error_model="numpy")
def _dot(a: Any, b: Any) -> Any:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(cache=True, error_model="numpy")
def _cross(a: Any, b: Any) -> Any:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@njit(cache=True, error_model="numpy")
def _separated(corners: Any, axis: Any, half: Any) -> Any:
    """True when the projections of a triangle (3, 3) and of the cube |x|, |y|, |z| <= half are disjoint."""
    a, b, c = axis
    p0 = a * corners[0, 0] + b * corners[0, 1] + c * corners[0, 2]
    p1 = a * corners[1, 0] + b * corners[1, 1] + c * corners[1, 2]
    p2 = a * corners[2, 0] + b * corners[2, 1] + c * corners[2, 2]
    radius = half * (abs(a) + abs(b) + abs(c))
    return min(p0, p1, p2) > radius or max(p0, p1, p2) < -radius


@njit(cache=True, error_model="numpy")
def _meets(corners: Any, half: Any) -> Any:
    """Does the triangle (3, 3) meet the closed cube of the given half side about the origin?

    Separating axes, Akenine-Moller, "Fast 3D triangle-box overlap testing", 2001.
    """
    if (
        _separated(corners, (1.0, 0.0, 0.0), half)
        or _separated(corners, (0.0, 1.0, 0.0), half)
        or _separated(corners, (0.0, 0.0, 1.0), half)
    ):
        return False
    u = (corners[1, 0] - corners[0, 0], corners[1, 1] - corners[0, 1], corners[1, 2] - corners[0, 2])
    v = (corners[2, 0] - corners[0, 0], corners[2, 1] - corners[0, 1], corners[2, 2] - corners[0, 2])
    if _separated(corners, _cross(u, v), half):
        return False
    for e in (u, v, _minus(v, u)):
        if (
            _separated(corners, (0.0, -e[2], e[1]), half)
            or _separated(corners, (e[2], 0.0, -e[0]), half)
            or _separated(corners, (-e[1], e[0], 0.0), half)
        ):
            return False
    return True


@njit(cache=True, error_model="numpy")
def mark_met_cells(triangles: Any, half: Any, met: Any) -> None:
    """Set met (nx, ny, nz) True where the cube of that half side about a cell's centre meets a triangle.

    triangles (T, 3, 3) in cells: cell (i, j, k) spans [i, i + 1] and so on. half > .5 grows the cubes.
    """
    corners = np.empty((3, 3))
    first, last = np.empty(3, np.int64), np.empty(3, np.int64)
    # Spelt out: assigning array expressions or slices would compile for three seconds more.
    for t in range(len(triangles)):
        for a in range(3):
            low = min(triangles[t, 0, a], triangles[t, 1, a], triangles[t, 2, a])
            high = max(triangles[t, 0, a], triangles[t, 1, a], triangles[t, 2, a])
            first[a] = max(0, np.ceil(low - half - 0.5))
            last[a] = min(met.shape[a] - 1, np.floor(high + half - 0.5))
        for i in range(first[0], last[0] + 1):
            for j in range(first[1], last[1] + 1):
                for k in range(first[2], last[2] + 1):
                    if not met[i, j, k]:
                        for c in range(3):
                            corners[c, 0] = triangles[t, c, 0] - i - 0.5
                            corners[c, 1] = triangles[t, c, 1] - j - 0.5
                            corners[c, 2] = triangles[t, c, 2] - k - 0.5
                        met[i, j, k] = _meets(corners, half)


@njit(cache=True, error_model="numpy")
def flip_above_crossings(triangles: Any, offset: Any, flips: Any) -> None:
    """Toggle flips (nx, ny, nz + 1) at the first cell whose centre lies above each crossing of a column.

    triangles (T, 3, 3) in cells. Columns stand at (i + .5 + offset[0], j + .5 + offset[1]). A running
    exclusive-or along z then tells the centres that a closed surface encloses.
    """
    nx, ny, nz = flips.shape
    for t in range(len(triangles)):
        ax, ay, az = triangles[t, 0]
        bx, by, bz = triangles[t, 1]
        cx, cy, cz = triangles[t, 2]
        area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        if area == 0.0:
            continue
        for i in range(max(0, np.floor(min(ax, bx, cx) - 0.5)), min(nx, np.floor(max(ax, bx, cx) + 1.5))):
            x = i + 0.5 + offset[0]
            for j in range(max(0, np.floor(min(ay, by, cy) - 0.5)), min(ny, np.floor(max(ay, by, cy) + 1.5))):
                y = j + 0.5 + offset[1]
                u = ((bx - x) * (cy - y) - (by - y) * (cx - x)) / area
                v = ((cx - x) * (ay - y) - (cy - y) * (ax - x)) / area
                if u >= 0.0 and v >= 0.0 and u + v <= 1.0:
                    z = u * az + v * bz + (1.0 - u - v) * cz
                    flips[i, j, min(max(int(np.ceil(z - 0.5)), 0), nz - 1)] ^= 1


@njit(cache=True, error_model="numpy")
def inverse_depth_at(inverse_depth: Any, column: Any, row: Any) -> Any:
    """Inverse depth of the first hit at (column, row), counted in rays of the lattice image [1/m].

    On a plane the inverse depth is linear over the image, so four rays on one surface are interpolated
    without error; across an edge the nearest ray decides.
    """
    rows, columns = inverse_depth.shape
    c, r = min(int(column), columns - 2), min(int(row), rows - 2)
    u, v = column - c, row - r
    q00, q01 = inverse_depth[r, c], inverse_depth[r, c + 1]
    q10, q11 = inverse_depth[r + 1, c], inverse_depth[r + 1, c + 1]
    if min(q00, q01, q10, q11) >= SAME_SURFACE * max(q00, q01, q10, q11):
        return (1.0 - v) * ((1.0 - u) * q00 + u * q01) + v * ((1.0 - u) * q10 + u * q11)
    return inverse_depth[r + int(v >= 0.5), c + int(u >= 0.5)]


@njit(cache=True, error_model="numpy")
def _eye_sees(point: Any, shift_m: Any, eyes: Any, inverse_depth: Any) -> Any:
    """(in the image, first hit no nearer than the point by slack) for the eye at +x by shift_m."""
    x, y, z = point
    x -= shift_m
    column = eyes.focal_px * x / z + eyes.cx_px + 0.5
    row = eyes.focal_px * y / z + eyes.cy_px + 0.5
    if not (0.0 <= column < eyes.width_px and 0.0 <= row < eyes.height_px):
        return False, False
    q = inverse_depth_at(inverse_depth, column / eyes.pitch_x_px, row / eyes.pitch_y_px)
    # Along one ray hit range / point range = hit depth / point depth.
    return True, q * z * (1.0 - eyes.slack_m / np.sqrt(x * x + y * y + z * z)) <= 1.0


@njit(cache=True, error_model="numpy")
def see_cells(cells: Any, box: Any, T_cam_cell: Any, eyes: Any, inverse_depths: Any) -> None:
    """Lower nearest_m to this pose's depth for the cells that both eyes see; mark in_view occluded or not.

    cells: (solid, nearest_m, in_view), each (nx, ny, nz). box (2, 3): first and past-the-last index to visit.
    T_cam_cell (3, 4): a cell's index to its centre in cam [m]. inverse_depths: (left, right) images [1/m].
    """
    solid, nearest_m, in_view = cells
    left, right = inverse_depths
    A = T_cam_cell
    for i in range(box[0, 0], box[1, 0]):
        for j in range(box[0, 1], box[1, 1]):
            for k in range(box[0, 2], box[1, 2]):
                z = A[2, 0] * i + A[2, 1] * j + A[2, 2] * k + A[2, 3]
                # A cell keeps its nearest view, so a farther one need not be tested.
                if z <= 0.0 or z >= nearest_m[i, j, k]:
                    continue
                x = A[0, 0] * i + A[0, 1] * j + A[0, 2] * k + A[0, 3]
                y = A[1, 0] * i + A[1, 1] * j + A[1, 2] * k + A[1, 3]
                if x * x + y * y + z * z > eyes.max_range_m * eyes.max_range_m:
                    continue
                inside_left, seen_left = _eye_sees((x, y, z), 0.0, eyes, left)
                inside_right, seen_right = _eye_sees((x, y, z), eyes.baseline_m, eyes, right)
                if inside_left and inside_right:
                    in_view[i, j, k] = True
                    if seen_left and seen_right and not solid[i, j, k]:
                        nearest_m[i, j, k] = z


@njit(cache=True, error_model="numpy")
def _squared_to_segment(ap: Any, ab: Any) -> Any:
    """Squared distance of the point a + ap to the segment from a to a + ab."""
    length2 = _dot(ab, ab)
    t = min(max(_dot(ap, ab) / length2, 0.0), 1.0) if length2 > 0.0 else 0.0
    gap = _minus(ap, (t * ab[0], t * ab[1], t * ab[2]))
    return _dot(gap, gap)


@njit(cache=True, error_model="numpy")
def _squared_to_triangle(p: Any, triangle: Any) -> Any:
    a = (triangle[0, 0], triangle[0, 1], triangle[0, 2])
    b = (triangle[1, 0], triangle[1, 1], triangle[1, 2])
    c = (triangle[2, 0], triangle[2, 1], triangle[2, 2])
    ab, bc, ca = _minus(b, a), _minus(c, b), _minus(a, c)
    ap, bp, cp = _minus(p, a), _minus(p, b), _minus(p, c)
    normal = _cross(ab, bc)
    norm2 = _dot(normal, normal)
    if (
        norm2 > 0.0
        and _dot(_cross(ab, ap), normal) >= 0.0
        and _dot(_cross(bc, bp), normal) >= 0.0
        and _dot(_cross(ca, cp), normal) >= 0.0
    ):
        return _dot(ap, normal) ** 2 / norm2
    return min(_squared_to_segment(ap, ab), _squared_to_segment(bp, bc), _squared_to_segment(cp, ca))


@njit(cache=True, error_model="numpy")
def distance_to_candidates(points: Any, candidates: Any, triangles: Any, distance: Any) -> None:
    """distance (N,) = exact distance of points (N, 3) to the nearest of their candidates (N, K)."""
    for n in range(len(points)):
        p = (points[n, 0], points[n, 1], points[n, 2])
        nearest = np.inf
        for m in range(candidates.shape[1]):
            # Neighbouring samples mostly lie on one triangle.
            if m == 0 or candidates[n, m] != candidates[n, m - 1]:
                nearest = min(nearest, _squared_to_triangle(p, triangles[candidates[n, m]]))
        distance[n] = np.sqrt(nearest)
