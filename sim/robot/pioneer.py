"""The simulated Pioneer 3-AT: a skid-steered robot in a world, its motors and its senses."""

from types import TracebackType

import numpy as np

from stereogrid.errors import InvalidInputError, StereogridError
from stereogrid.geometry import FloatArray

from ..scene.scene import World
from .battery import FULL_V, Battery
from .body import GROUND_GROUP, TICK_S, WORLD_GROUP, Body
from .chassis import MASS_KG, Chassis
from .ground import find_surface
from .odometry import EFFECTIVE_TRACK_M, WHEEL_RADIUS_M, WheelOdometry
from .sonar import SonarNoise, ping
from .touch import StallWatch, bumpers

__all__ = ["TICK_S", "Pioneer", "SimulationError"]

STEEPEST_RAD = np.radians(45.0)
"""A robot that leans more has tipped over."""
FALL_M = 0.5
"""A robot this far below the ground has fallen off it."""


class SimulationError(StereogridError):
    """The simulated robot cannot do what it was asked: it is stuck, or it fell."""


class Pioneer:
    """A robot at rest at the origin of a world (or of an empty plane), heading +x. Use as a context manager.

    payload_kg: on its top plate. surface: by name, the world's own by default. battery_v: at the start, at rest.
    sonar_noise: none by default; drawn by seed, anew each time that the sonars are asked.
    T_world_base (4, 4) is its true pose, odometry what it believes, time_s since the start; bumpers: bit masks of the
    front and the rear, see touch.bumpers; stalled: of the left and the right wheels; motors_on.
    Rebuilding it gives the same motion bit for bit; there is no reset.
    """

    def __init__(
        self,
        world: World | None = None,
        *,
        payload_kg: float = 0.0,
        surface: str | None = None,
        mass_kg: float = MASS_KG,
        battery_v: float = FULL_V,
        sonar_noise: SonarNoise | None = None,
        seed: int = 0,
    ) -> None:
        ground = find_surface(surface if surface is not None else world.surface if world is not None else "vinyl")
        if seed < 0:
            raise InvalidInputError(f"the seed of the sonars' noise must be >= 0, not {seed}")
        self.battery = Battery(battery_v)
        self._world = world
        self._body = Body(world, Chassis(mass_kg, payload_kg), ground)
        self._stall_watch = StallWatch()
        self._sonar_noise, self._sonar_rng = sonar_noise or SonarNoise(), np.random.default_rng(seed)
        self.time_s = 0.0
        self.odometry = WheelOdometry()
        self.bumpers, self.stalled, self.motors_on = (0, 0), (False, False), True
        self.T_world_base = self._body.T_world_base

    def __enter__(self) -> "Pioneer":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Leave the physics engine; the robot is gone."""
        self._body.close()

    @property
    def battery_v(self) -> float:
        """The battery's voltage now [V]."""
        return self.battery.volts

    @property
    def wheel_speeds_mps(self) -> FloatArray:
        """Speeds (2,) of the left and the right tyres' treads now [m/s]."""
        return WHEEL_RADIUS_M * self._body.spins_radps

    def encoders_rad(self) -> FloatArray:
        """Turns (2,) of the left and the right wheels since the start [rad]; the two on a side are geared together."""
        return self._body.turns_rad

    def sonar_m(self) -> FloatArray:
        """Ranges (16,) of the sonars now [m]; 5.0 where nothing is heard."""
        ranges_m = ping(self.T_world_base, self._body.client, WORLD_GROUP | GROUND_GROUP)
        return self._sonar_noise.applied(ranges_m, self._sonar_rng)

    def drive(self, speed_mps: float, turn_radps: float) -> None:
        """Run the wheels for one tick of TICK_S as the firmware would: by the published effective track."""
        half = turn_radps * EFFECTIVE_TRACK_M / 2
        self.drive_wheels(speed_mps - half, speed_mps + half)

    def drive_wheels(self, left_mps: float, right_mps: float) -> None:
        """Run the wheels for one tick, each side at its own speed [m/s]."""
        if not np.isfinite([left_mps, right_mps]).all():
            raise InvalidInputError(f"speeds of wheels must be finite, not {left_mps} and {right_mps}")
        self._tick(np.array([left_mps, right_mps]) / WHEEL_RADIUS_M, True)

    def coast(self) -> None:
        """One tick with the motors off and the wheels free."""
        self._tick(np.zeros(2), False)

    def _tick(self, targets_radps: FloatArray, powered: bool) -> None:
        body, before_rad = self._body, self._body.turns_rad
        self.time_s += TICK_S
        body.run(targets_radps, powered, self.time_s)
        self.odometry.update(*(body.turns_rad - before_rad))
        self.motors_on = powered
        spins, torques = body.spins_radps.tolist(), body.torques_nm.tolist()
        self.battery.draw(torques, spins, TICK_S)
        self.stalled = self._stall_watch.update(targets_radps.tolist(), spins, TICK_S)
        self.bumpers = bumpers(body.touched_m())
        self.T_world_base = body.T_world_base
        self._check_upright()

    def _check_upright(self) -> None:
        T = self.T_world_base
        x, y, z = T[:3, 3]
        where = f"at x = {x:.2f} m, y = {y:.2f} m after {self.time_s:.1f} s"
        # Written so that NaN fails too.
        if not T[2, 2] > np.cos(STEEPEST_RAD):
            raise SimulationError(f"the robot tipped over {where}")
        if self._world is None or self._world.terrain is None:
            height_m = 0.0
        else:
            (low_x, low_y), (high_x, high_y) = self._world.terrain.bounds_m
            if not (low_x <= x <= high_x and low_y <= y <= high_y):
                raise SimulationError(f"the robot left the ground {where}")
            height_m = float(self._world.ground_height_m(T[:2, 3]))
        if z < height_m - FALL_M:
            raise SimulationError(f"the robot fell through the ground {where}")
