"""What the robot looks like: a red Pioneer 3-AT with black top plate, sonar rings and a mast with its two cameras."""

from collections.abc import Iterator

import numpy as np

from stereogrid.geometry import FloatArray

from ..rig import StereoRig
from ..robot.chassis import TOP_M, Part, parts
from ..robot.sonar import HEADINGS_RAD, PLACES_M
from ..scene import textures as paint
from ..scene.solids import Paint, Solid, Vector, box, moved, prism, rod
from ..scene.textures import Texture

FLANK_TOP_M = 0.214
"""Above this height the chassis is narrower, and the sonars' rings are before and behind it."""
PLATE_M = (TOP_M - 0.004, TOP_M)
"""Heights of the top plate's lower and upper side."""
PLATE_OUTLINE_M = ((0.24, 0.13), (0.17, 0.19), (-0.17, 0.19), (-0.24, 0.13))
"""Corners of its left half; the right half mirrors it."""
SONAR_RADIUS_M = 0.018
LENS_RADIUS_M = 0.009

TINTS: dict[str, tuple[float, float, float]] = {
    "robot red": (2.1, 0.42, 0.36),
    "robot gold": (1.15, 1.0, 0.6),
}
"""Colours of a gray picture's parts: factors on red, green and blue, by texture."""


def robot_textures() -> dict[str, Texture]:
    """The textures of robot_solids; they are always the same."""
    rng = np.random.default_rng([0x9A7, 0])
    plain = {
        "robot red": (0.40, 0.01),
        "robot black": (0.17, 0.012),
        "robot tyre": (0.24, 0.04),
        "robot rim": (0.62, 0.015),
        "robot gold": (0.70, 0.03),
        "robot lens": (0.05, 0.0),
    }
    return {name: paint.paint(*shade)(rng) for name, shade in plain.items()}


def robot_solids(rig: StereoRig) -> tuple[Solid, ...]:
    """The robot in base: x forward, z up, z = 0 on the ground; its cameras where the rig has them."""
    shapes = parts()
    treads, flanks = ([p for p in shapes if p.is_wheel and p.is_tread == tread] for tread in (True, False))
    return (
        *_hull([p for p in shapes if not p.is_wheel]),
        *_plate(),
        *(solid for k, pair in enumerate(zip(treads, flanks, strict=True)) for solid in _wheel(k, *pair)),
        *(solid for where, x_sign in (("front", 1), ("rear", -1)) for solid in _sonars(where, x_sign)),
        *_cameras(rig),
    )


def _hull(boxes: list[Part]) -> Iterator[Solid]:
    """The chassis up to its flanks' top, the electronics on it, and the bumpers: red, to be seen from afar."""
    hull, *bumpers = ((p.place_m - np.array(p.size_m) / 2, p.place_m + np.array(p.size_m) / 2) for p in boxes)
    yield box("chassis", _vector(hull[0]), (*_vector(hull[1])[:2], FLANK_TOP_M), Paint("robot red"))
    for k, (low, high) in enumerate(bumpers):
        yield box(f"bumper {k}", _vector(low), _vector(high), Paint("robot red"))
    yield box("lid", (-0.16, -0.12, FLANK_TOP_M - 0.002), (0.16, 0.12, PLATE_M[0] + 0.001), Paint("robot black"))


def _plate() -> Iterator[Solid]:
    right = [(x, -y) for x, y in reversed(PLATE_OUTLINE_M)]
    low, high = (np.array([(x, y, z) for x, y in (*PLATE_OUTLINE_M, *right)]) for z in PLATE_M)
    yield prism("top plate", low, high, Paint("robot black"))


def _wheel(k: int, tread: Part, flank: Part) -> Iterator[Solid]:
    (x, y, z), (tread_radius, _), (_, width) = tread.place_m.tolist(), tread.size_m, flank.size_m
    outside = float(np.sign(y))
    inner, outer = y - outside * width / 2, y + outside * width / 2
    for name, radius, past, texture in (("tyre", 1.0, 0.0, "robot tyre"), ("rim", 0.58, 0.004, "robot rim")):
        ends = ((x, inner, z), (x, outer + outside * past, z))
        yield rod(f"wheel {k} {name}", ends, radius * tread_radius, Paint(texture), sides=20)
    hub = ((x, outer, z), (x, outer + outside * 0.012, z))
    yield rod(f"wheel {k} hub", hub, 0.018, Paint("robot black"), sides=8)


def _sonars(where: str, x_sign: int) -> Iterator[Solid]:
    """A black ring below the plate with a gold disc for each sonar."""
    mine = np.flatnonzero(np.sign(PLACES_M[:, 0]) == x_sign)
    # They are numbered clockwise, a prism's corners counterclockwise.
    outline = PLACES_M[mine[::-1], :2]
    low, high = (np.column_stack([outline, np.full(len(outline), z)]) for z in (FLANK_TOP_M - 0.002, PLATE_M[0]))
    yield prism(f"{where} sonar ring", low, high, Paint("robot black"))
    for k in mine:
        away = np.array([np.cos(HEADINGS_RAD[k]), np.sin(HEADINGS_RAD[k]), 0.0])
        start, end = PLACES_M[k] - 0.012 * away, PLACES_M[k] + 0.005 * away
        yield rod(f"{where} sonar {k}", (_vector(start), _vector(end)), SONAR_RADIUS_M, Paint("robot gold"), sides=10)


def _cameras(rig: StereoRig) -> Iterator[Solid]:
    """The mast, and on it the housing with both lenses."""
    T_base_cam, width = rig.T_base_cam, rig.camera.baseline_m
    left = T_base_cam[:3, 3]
    middle = left + T_base_cam[:3, 0] * width / 2
    foot = (float(middle[0]) - 0.025, float(middle[1]), PLATE_M[1] - 0.004)
    yield rod("mast", (foot, (foot[0], foot[1], float(middle[2]))), 0.014, Paint("robot rim"), sides=10)
    low, high = (-0.028, -0.02, -0.04), (width + 0.028, 0.02, -0.006)
    yield box("housing", low, high, Paint("robot black"), T_world_box=T_base_cam)
    for side, x in (("left", 0.0), ("right", width)):
        for name, radius, end, texture in (
            ("barrel", 1.5 * LENS_RADIUS_M, 0.004, "robot rim"),
            ("lens", LENS_RADIUS_M, 0.006, "robot lens"),
        ):
            cylinder = rod(f"{side} {name}", ((x, 0.0, -0.012), (x, 0.0, end)), radius, Paint(texture), sides=14)
            yield moved(cylinder, T_base_cam)


def _vector(point_m: FloatArray) -> Vector:
    x, y, z = point_m.tolist()
    return x, y, z
