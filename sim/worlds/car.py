"""A parked car: a body lofted from cross-sections, glass, wheels, lights and seams."""

from collections.abc import Iterator

import numpy as np

from stereogrid.geometry import FloatArray, transform

from ..scene.skin import Skin, skinned, tube
from ..scene.solids import Paint, Solid, box

# Outline of a hatchback [m]: x forward, then height of sill, shoulder and top, half width at shoulder and top.
_OUTLINE = np.array(
    [
        (-2.10, 0.42, 0.70, 0.72, 0.66, 0.50),
        (-2.04, 0.30, 0.86, 0.92, 0.76, 0.58),
        (-1.82, 0.24, 0.94, 1.04, 0.81, 0.60),
        (-1.46, 0.22, 0.95, 1.34, 0.83, 0.58),
        (-0.90, 0.20, 0.94, 1.44, 0.85, 0.60),
        (-0.20, 0.20, 0.92, 1.46, 0.85, 0.61),
        (0.10, 0.20, 0.91, 1.41, 0.85, 0.60),
        (0.86, 0.20, 0.90, 0.97, 0.84, 0.72),
        (1.55, 0.22, 0.80, 0.87, 0.81, 0.66),
        (1.95, 0.26, 0.66, 0.72, 0.74, 0.58),
        (2.10, 0.40, 0.54, 0.56, 0.62, 0.48),
    ]
)
_EXTRA_X_M = (-1.75, -1.5, -1.36, -1.28, -0.53, -0.43, 0.16, 0.48, 0.58, 0.80, 1.2)
"""More stations, where glass ends and where the paint should look round."""

_SIDE_GLASS_M = ((-1.28, -0.53), (-0.43, 0.48))
_SCREENS_M = ((-1.75, -1.5), (0.16, 0.80))
WHEEL_X_M = (-1.30, 1.30)
WHEEL_RADIUS_M = 0.31
HALF_WIDTH_M = 0.875
"""To the hubs; the mirrors reach 0.1 m further."""


def car(name: str, T_world_car: FloatArray, paint: str) -> Iterator[Solid]:
    """A hatchback of 4.2 m; T_world_car (4, 4): x forward, z up, its origin on the ground below its middle."""
    sections = _sections()
    yield _body(name, sections, T_world_car, paint)
    for side in (-1.0, 1.0):
        for k, x in enumerate(WHEEL_X_M):
            yield from _wheel(f"{name} wheel {side:+.0f} {k}", T_world_car, (x, side))
        for k, x in enumerate((0.7, -0.36, -1.2)):
            yield _seam(f"{name} seam {side:+.0f} {k}", T_world_car, _flank(sections, x, side))
        yield from _details(name, T_world_car, side, paint)
    for end, low, high, texture in (
        ("grille", (2.0, -0.42, 0.36), (2.108, 0.42, 0.5), "tyre"),
        ("front plate", (2.06, -0.26, 0.39), (2.125, 0.26, 0.48), "plate"),
        ("rear plate", (-2.125, -0.26, 0.5), (-2.06, 0.26, 0.61), "plate"),
    ):
        yield box(f"{name} {end}", low, high, Paint(texture, fit=True), T_world_box=T_world_car)


def _sections() -> FloatArray:
    """Outline rows at all stations, from the rear to the front."""
    x = np.sort(np.concatenate([_OUTLINE[:, 0], _EXTRA_X_M]))
    return np.column_stack([x, *(np.interp(x, _OUTLINE[:, 0], _OUTLINE[:, k]) for k in range(1, 6))])


def _ring(section: FloatArray) -> FloatArray:
    """(11, 3): a cross-section from the right sill over the roof to the left sill."""
    x, sill, shoulder, top, wide, narrow = section
    half = np.array(
        [
            (wide - 0.07, sill),
            (wide + 0.005, 0.5 * (sill + shoulder)),
            (wide - 0.01, shoulder),
            (narrow, top),
            (0.5 * narrow, top + 0.018),
        ]
    )
    right = np.column_stack([np.full(5, x), -half[:, 0], half[:, 1]])
    return np.concatenate([right, [[x, 0.0, top + 0.024]], right[::-1] * [1, -1, 1]])


def _body(name: str, sections: FloatArray, T_world_car: FloatArray, paint: str) -> Solid:
    rings = np.array([_ring(section) for section in sections])
    count, around = rings.shape[:2]
    i, j = (a.ravel() for a in np.meshgrid(np.arange(count - 1), np.arange(around), indexing="ij"))
    a, b = i * around + j, (i + 1) * around + j
    after = (j + 1) % around - j
    skin = np.stack([a, b, b + after, a, b + after, a + after], axis=1).reshape(-1, 3)
    fan = np.stack([np.zeros(around - 2, np.int64), np.arange(1, around - 1), np.arange(2, around)], axis=1)
    triangles = np.concatenate([skin, fan, fan[:, ::-1] + (count - 1) * around])
    middle = 0.5 * (sections[i, 0] + sections[i + 1, 0])
    names = ["car glass" if _is_glass(x, k) else paint for x, k in zip(middle, j, strict=True) for _ in range(2)]
    names += [paint] * (2 * len(fan))
    return skinned(f"{name} body", transform(T_world_car, rings.reshape(-1, 3)), triangles, Skin(names))


def _is_glass(x_m: float, j: int) -> bool:
    """Whether the strip j round the body is glass at x_m: 2 and 7 are the sides, 3 to 6 the top."""
    spans = {2: _SIDE_GLASS_M, 7: _SIDE_GLASS_M}.get(j, _SCREENS_M if 3 <= j <= 6 else ())
    return any(low < x_m < high for low, high in spans)


def _flank(sections: FloatArray, x_m: float, side: float) -> FloatArray:
    """(3, 3): the line from the sill to the shoulder at x_m on one side."""
    section = np.array([np.interp(x_m, sections[:, 0], sections[:, k]) for k in range(6)])
    return _ring(section)[:3] * [1.0, -side, 1.0]


def _seam(name: str, T_world_car: FloatArray, line_m: FloatArray) -> Solid:
    """The gap round a door, as a dark thread half sunk in the paint."""
    return tube(name, transform(T_world_car, line_m), np.full(len(line_m), 0.0035), "tyre", sides=4)


def _wheel(name: str, T_world_car: FloatArray, place: tuple[float, float]) -> Iterator[Solid]:
    """Arch, tyre, rim and hub about an axle at x on one side, each standing out a little further."""
    x, side = place
    # Half of the drum, its ends from the middle of the car, and what it shows; the ends inside are no two in a plane.
    arch, tyre = (0.365, (0.70, 0.858), "tyre"), (WHEEL_RADIUS_M, (0.62, 0.866), "tyre")
    rim, hub = (0.205, (0.68, 0.870), "hub"), (0.06, (0.66, HALF_WIDTH_M), "tyre")
    for k, (radius, out, texture) in enumerate((arch, tyre, rim, hub)):
        ends = np.array([[x, side * y, WHEEL_RADIUS_M - 0.01] for y in out])
        yield tube(f"{name} {k}", transform(T_world_car, ends), np.full(2, radius), texture, sides=18)


def _details(name: str, T: FloatArray, side: float, paint: str) -> Iterator[Solid]:
    """Lights and mirror of one side; corners are given for the left one."""
    for part, low, high, texture in (
        ("headlight", (1.86, 0.40, 0.50), (2.065, 0.63, 0.63), "lamp glass"),
        ("tail light", (-2.075, 0.52, 0.64), (-1.9, 0.70, 0.86), "tail light"),
        ("mirror", (0.52, 0.84, 0.90), (0.64, 0.98, 1.03), paint),
    ):
        y = sorted((side * low[1], side * high[1]))
        corners = ((low[0], y[0], low[2]), (high[0], y[1], high[2]))
        yield box(f"{name} {part} {side:+.0f}", *corners, Paint(texture), T_world_box=T)
