"""Where the robot stands on the ground: one contact a tyre, and those corners of its body that sink in.

The ground is a field of heights on triangles (Terrain, or a plane as one great square), so a contact is found by
looking up heights, with neither the jolts at inner edges nor the cost of a general collision of meshes.
"""

import math

import numpy as np

from stereogrid.geometry import Array

from ..kernel import inner, kernel

FOOTING_NUMBERS = 7
"""A footing: its point (3,) and its normal (3,), and how deep it sinks [m]."""
EARLY_M = 0.002
"""A footing is found this much before it is touched, so that a tyre that lands is met by its damper."""


@inner
def ground(heights: Array, origin: Array, x: float, y: float) -> tuple[float, float, float]:
    """The height at a point, as Terrain.height_m, and its slopes along x and y. origin (3,): x0, y0, pitch."""
    rows, columns = heights.shape
    u = min(max((x - origin[0]) / origin[2], 0.0), columns - 1.0)
    v = min(max((y - origin[1]) / origin[2], 0.0), rows - 1.0)
    column, row = min(int(u), columns - 2), min(int(v), rows - 2)
    u -= column
    v -= row
    h00, h10 = heights[row, column], heights[row, column + 1]
    h01, h11 = heights[row + 1, column], heights[row + 1, column + 1]
    along, across = (h10 - h00, h11 - h10) if u >= v else (h11 - h01, h01 - h00)
    return h00 + u * along + v * across, along / origin[2], across / origin[2]


@kernel
def tyre_footing(middle: Array, axle: Array, radius_m: float, heights: Array, origin: Array, out: Array) -> bool:
    """Fill out (FOOTING_NUMBERS,) with the contact of a wheel, or return False when it hangs in the air.

    The tyre is a thin disc; what sinks in of its lower half, weighted by how deep, gives the point and the normal, so
    that both change smoothly as it rolls from one triangle to the next.
    """
    # Straight down in the plane of the wheel, and forward.
    down_x, down_y, down_z = axle[2] * axle[0], axle[2] * axle[1], axle[2] * axle[2] - 1.0
    size = math.sqrt(down_x * down_x + down_y * down_y + down_z * down_z)
    if size < 0.3:
        return False
    down_x, down_y, down_z = down_x / size, down_y / size, down_z / size
    ahead_x, ahead_y = axle[1] * down_z - axle[2] * down_y, axle[2] * down_x - axle[0] * down_z
    ahead_z = axle[0] * down_y - axle[1] * down_x
    px = py = pz = nx = ny = nz = total = 0.0
    deepest = -EARLY_M
    for k in range(-16, 17):
        angle = k * (math.pi / 60)
        s, c = radius_m * math.sin(angle), radius_m * math.cos(angle)
        x, y = middle[0] + c * down_x + s * ahead_x, middle[1] + c * down_y + s * ahead_y
        z = middle[2] + c * down_z + s * ahead_z
        height, along, across = ground(heights, origin, x, y)
        up = 1 / math.sqrt(1 + along * along + across * across)
        weight = (height - z) * up + EARLY_M
        if weight > 0:
            deepest = max(deepest, weight - EARLY_M)
            total += weight
            px, py, pz = px + weight * x, py + weight * y, pz + weight * z
            nx, ny, nz = nx - weight * up * along, ny - weight * up * across, nz + weight * up
    if total == 0.0:
        return False
    out[0], out[1], out[2] = px / total, py / total, pz / total
    size = math.sqrt(nx * nx + ny * ny + nz * nz)
    out[3], out[4], out[5] = nx / size, ny / size, nz / size
    out[6] = deepest
    return True


@kernel
def corner_footing(x: float, y: float, z: float, heights: Array, origin: Array, out: Array) -> bool:
    """Fill out (FOOTING_NUMBERS,) with the contact of a point of the body, or return False."""
    height, along, across = ground(heights, origin, x, y)
    if height <= z:
        return False
    up = 1 / math.sqrt(1 + along * along + across * across)
    out[0], out[1], out[2] = x, y, z
    out[3], out[4], out[5] = -up * along, -up * across, up
    out[6] = up * (height - z)
    return True


@kernel
def stand(frame: Array, wheels: Array, corners: Array, radius_m: float, heights: Array, origin: Array) -> Array:
    """(W + C, FOOTING_NUMBERS): the contacts of wheels (W, 3) and corners (C, 3) of a body; depth NaN where none is.

    frame (12,): place and rotation, row by row, of the body.
    """
    axle, at = np.array([frame[4], frame[7], frame[10]]), np.empty(3)
    feet = np.empty((len(wheels) + len(corners), FOOTING_NUMBERS))
    for k in range(len(feet)):
        p = wheels[k] if k < len(wheels) else corners[k - len(wheels)]
        for i in range(3):
            at[i] = frame[i] + frame[3 + 3 * i] * p[0] + frame[4 + 3 * i] * p[1] + frame[5 + 3 * i] * p[2]
        if k < len(wheels):
            touches = tyre_footing(at, axle, radius_m, heights, origin, feet[k])
        else:
            touches = corner_footing(at[0], at[1], at[2], heights, origin, feet[k])
        if not touches:
            feet[k, 6] = np.nan
    return feet
