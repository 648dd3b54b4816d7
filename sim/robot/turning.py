"""How much further the wheels run than the robot turns: the ratio of wheel yaw, by the track as built, to true yaw."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import groupby

import numpy as np

from stereogrid.geometry import inverse, yaw_rad

from ..scene.scene import World
from ..scene.terrain import Terrain
from ..scene.textures import Texture
from .body import TRACK_M
from .chassis import MOST_PAYLOAD_KG
from .ground import SURFACES
from .odometry import WHEEL_RADIUS_M
from .pioneer import TICK_S, Pioneer

RAMP_S = 1.0
"""A manoeuvre starts gently, and is measured after that."""

IN_PLACE: tuple[tuple[float, float], ...] = tuple((0.0, s * w) for w in (0.1, 0.3, 0.8, 1.2) for s in (1, -1))
ARCS: tuple[tuple[float, float], ...] = (
    *((0.1, 0.25), (0.3, -0.75), (0.4, 1.0), (0.3, 0.3), (0.7, 0.7), (0.7, -0.35), (0.4, 0.08), (0.7, 0.14)),
    *((-0.1, 0.25), (-0.3, -0.3), (-0.5, 0.25)),
)
"""Speed [m/s] and turn rate [rad/s]: radii from 0.4 to 5 m, the last ones backwards."""


@dataclass(frozen=True)
class Turned:
    """A manoeuvre on some ground, and its ratio."""

    ground: str
    speed_mps: float
    turn_radps: float
    payload_kg: float
    ratio: float


def ratio(robot: Pioneer, speed_mps: float, turn_radps: float, duration_s: float = 4.0) -> float:
    """Wheel yaw over true yaw, about the robot's own axis, of a manoeuvre measured after a gentle start."""
    for k in range(round(RAMP_S / TICK_S)):
        robot.drive(*(np.array([speed_mps, turn_radps]) * k * TICK_S / RAMP_S))
    before_rad, T_world_before, turned_rad = robot.encoders_rad(), robot.T_world_base, 0.0
    for _ in range(round(duration_s / TICK_S)):
        robot.drive(speed_mps, turn_radps)
        turned_rad += yaw_rad(inverse(T_world_before) @ robot.T_world_base)
        T_world_before = robot.T_world_base
    left, right = robot.encoders_rad() - before_rad
    return float((right - left) * WHEEL_RADIUS_M / TRACK_M / turned_rad)


def measure() -> Iterator[Turned]:
    """The whole table: every manoeuvre on every surface, on tilted and on rough ground, bare and loaded."""
    grounds: dict[str, tuple[World | None, str]] = {surface: (None, surface) for surface in SURFACES}
    for degrees in (5, 10):
        grounds |= {f"{surface}, {degrees} degrees up": (slope(degrees), surface) for surface in ("vinyl", "gravel")}
    grounds |= {f"{surface}, rough": (rough(), surface) for surface in ("asphalt", "grass")}
    for name, (world, surface) in grounds.items():
        for payload_kg in (0.0, MOST_PAYLOAD_KG):
            for speed, turn in (*IN_PLACE, *ARCS):
                # A radian at least: on rough ground a bump alone turns the robot by some hundredths.
                duration_s = max(4.0, 1 / abs(turn))
                with Pioneer(world, payload_kg=payload_kg, surface=surface) as robot:
                    yield Turned(name, speed, turn, payload_kg, ratio(robot, speed, turn, duration_s))


def summary(measured: Iterable[Turned]) -> Iterator[str]:
    """A line for each ground and load: the lowest, mean and highest ratio, and where the lowest and highest are."""
    for (ground, payload_kg), group in groupby(measured, key=lambda turned: (turned.ground, turned.payload_kg)):
        turns = sorted(group, key=lambda turned: turned.ratio)
        mean = sum(turned.ratio for turned in turns) / len(turns)
        low, high = (f"{t.ratio:.3f} ({t.speed_mps:g} m/s, {t.turn_radps:g} rad/s)" for t in (turns[0], turns[-1]))
        yield f"{ground}, {payload_kg:g} kg: {mean:.4f}, from {low} to {high}"


def slope(degrees: float) -> World:
    """A plane that rises towards +x."""
    x = np.arange(-12.0, 12.5)
    heights = np.tile(np.tan(np.radians(degrees)) * x, (len(x), 1))
    return _ground("slope", Terrain(heights, (-12.0, -12.0), 1.0, "plain"))


def rough(seed: int = 0, height_m: float = 0.02) -> World:
    """Ground with bumps of that standard deviation, some decimetres wide, on gentle hills."""
    rng = np.random.default_rng(seed)
    pitch, count = 0.1, 241
    spectrum = np.fft.fft2(rng.standard_normal((count, count)))
    f = np.hypot(np.fft.fftfreq(count, pitch)[:, None], np.fft.fftfreq(count, pitch))
    bumps = np.real(np.fft.ifft2(spectrum * np.exp(-((f / 1.0) ** 2))))
    hills = np.real(np.fft.ifft2(spectrum * np.exp(-((f / 0.15) ** 2))))
    heights = height_m * bumps / bumps.std() + 0.1 * hills / hills.std()
    return _ground("rough", Terrain(heights, (-12.0, -12.0), pitch, "plain"))


def _ground(name: str, terrain: Terrain) -> World:
    texture = Texture(np.full((2, 2), 128, np.uint8))
    path = np.array([[0.0, 0.0], [1.0, 0.0]])
    return World(name, 0, (terrain.solid(),), {"plain": texture}, (), path, terrain=terrain)
