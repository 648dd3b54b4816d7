"""A simulated drive as a Source: physics along the waypoints, a stereo pair every few decimetres."""

from collections import deque
from collections.abc import Generator, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from math import hypot, pi, remainder
from typing import NamedTuple

import numpy as np

from stereogrid.camera import StereoCamera
from stereogrid.errors import InvalidInputError, unknown_name
from stereogrid.geometry import FloatArray, yaw_rad
from stereogrid.observation import Image, Observation, Odometry, Truth

from .rendering.render import View
from .rendering.renderers import RENDERERS, make_renderer
from .rig import StereoRig
from .robot.chassis import Chassis
from .robot.follower import MAX_TURN_RADPS, PathFollower
from .robot.headway import Headway
from .robot.pioneer import TICK_S, Pioneer, SimulationError
from .scene.scene import World

TICKS_AFTER = 5
"""A camera that is late sees what the robot does after the last observation: .167 s, more than any fault of time."""


@dataclass(frozen=True)
class Moment:
    """The robot's state when a picture is taken: time [s], true pose (4, 4), odometry, share of the path done."""

    stamp_s: float
    T_world_base: FloatArray
    odometry: Odometry
    progress: float


class Tick(NamedTuple):
    """The robot's state at one tick of the physics: time [s], true pose (4, 4), turns (2,) of its wheels [rad]."""

    stamp_s: float
    T_world_base: FloatArray
    wheels_rad: FloatArray


@dataclass
class Drive:
    """A Source: the drive through a world, from its first waypoint to its last.

    every_m, every_rad: a pair is taken when the robot has moved or turned by this much since the last one.
    max_distance_m: stop earlier. payload_kg: on the robot's plate. renderer: a name in renderers.RENDERERS.
    workers: rendering threads; they change the speed and nothing else.
    ticks: how the robot moved in the drive under way, as far as it was simulated: ahead of the observations.
    """

    world: World
    rig: StereoRig = field(default_factory=StereoRig)
    every_m: float = 0.2
    every_rad: float = 0.13
    speed_mps: float = 0.4
    max_distance_m: float | None = None
    payload_kg: float = 0.0
    renderer: str = "raster"
    workers: int = 2

    def __post_init__(self) -> None:
        for name in ("every_m", "every_rad", "workers"):
            if not (np.isfinite(getattr(self, name)) and getattr(self, name) > 0):
                raise InvalidInputError(f"{name} must be positive and finite, not {getattr(self, name)}")
        if self.max_distance_m is not None and not self.max_distance_m > 0:
            raise InvalidInputError(f"max_distance_m must be positive, not {self.max_distance_m}")
        self.camera: StereoCamera = self.rig.camera
        self.T_base_cam: FloatArray = self.rig.T_base_cam
        self.progress = 0.0
        self.ticks: list[Tick] = []
        PathFollower(self.world.waypoints_m, self.speed_mps)
        Chassis(payload_kg=self.payload_kg)
        if self.renderer not in RENDERERS:
            raise unknown_name("renderer", self.renderer, RENDERERS)

    def __iter__(self) -> Generator[Observation, None, None]:
        renderer = make_renderer(self.renderer, self.world)
        with ThreadPoolExecutor(self.workers) as pool:
            waiting: deque[tuple[Moment, Future[tuple[View, Image]]]] = deque()
            try:
                for moment in self.moments():
                    look = pool.submit(self.rig.look, renderer, moment.T_world_base, time_s=moment.stamp_s)
                    waiting.append((moment, look))
                    # Enough ahead to keep every thread busy, few enough to hold little in memory.
                    if len(waiting) > self.workers + 1:
                        yield self._observation(*waiting.popleft())
            except SimulationError:
                # A drive that ends early still gives all that was seen up to there.
                yield from self._all_of(waiting)
                raise
            yield from self._all_of(waiting)

    def _all_of(self, waiting: deque[tuple[Moment, "Future[tuple[View, Image]]"]]) -> Iterator[Observation]:
        while waiting:
            yield self._observation(*waiting.popleft())

    def moments(self) -> Iterator[Moment]:
        """The physics alone: when and where the pictures are taken."""
        follower = PathFollower(self.world.waypoints_m, self.speed_mps, self.max_distance_m)
        # Half a tick's motion less, so that a pair is taken at the tick nearest to where it is due.
        step_m = self.every_m - 0.5 * TICK_S * self.speed_mps
        step_rad = self.every_rad - 0.5 * TICK_S * MAX_TURN_RADPS
        headway = Headway()
        with Pioneer(self.world, payload_kg=self.payload_kg) as robot:
            self.ticks = [_tick(robot)]
            last = _moment(robot, follower)
            yield last
            while not follower.arrived:
                robot.drive(*follower.command(robot.T_world_base, TICK_S))
                self.ticks.append(_tick(robot))
                headway.check(robot, follower)
                if _has_moved(last.T_world_base, robot.T_world_base, step_m, step_rad):
                    last = _moment(robot, follower)
                    yield last
            for _ in range(TICKS_AFTER):
                robot.drive(*follower.command(robot.T_world_base, TICK_S))
                self.ticks.append(_tick(robot))

    def _observation(self, moment: Moment, future: "Future[tuple[View, Image]]") -> Observation:
        left, right = future.result()
        self.progress = moment.progress
        return Observation(
            stamp_s=moment.stamp_s,
            left=left.gray,
            right=right,
            odometry=moment.odometry,
            T_world_cam=moment.odometry.T_odom_base @ self.T_base_cam,
            truth=Truth(moment.T_world_base @ self.T_base_cam, left.depth_m, self._movers(moment.stamp_s)),
        )

    def _movers(self, time_s: float) -> dict[str, FloatArray]:
        return {mover.name: self.world.T_world_mover(mover, time_s) for mover in self.world.movers}


def _tick(robot: Pioneer) -> Tick:
    return Tick(robot.time_s, robot.T_world_base, robot.encoders_rad())


def _moment(robot: Pioneer, follower: PathFollower) -> Moment:
    progress = min(follower.progress_m / follower.length_m, 1.0)
    return Moment(robot.time_s, robot.T_world_base, robot.odometry.reading(), progress)


def _has_moved(T_world_last: FloatArray, T_world_now: FloatArray, step_m: float, step_rad: float) -> bool:
    """Whether the robot, which stays on the floor, moved or turned that far."""
    x_m, y_m = T_world_now[:2, 3] - T_world_last[:2, 3]
    turned_rad = remainder(yaw_rad(T_world_now) - yaw_rad(T_world_last), 2 * pi)
    return hypot(x_m, y_m) >= step_m or abs(turned_rad) >= step_rad
