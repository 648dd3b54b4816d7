"""A simulated drive as a Source: physics along the waypoints, a stereo pair every few decimetres."""

from collections import deque
from collections.abc import Generator, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from math import ceil, hypot, pi, remainder

import numpy as np

from stereogrid.camera import StereoCamera
from stereogrid.errors import InvalidInputError
from stereogrid.geometry import FloatArray, yaw_rad
from stereogrid.observation import Image, Observation, Odometry, Truth

from .follower import MAX_TURN_RADPS, PathFollower
from .pioneer import TICK_S, Pioneer, SimulationError
from .render import Renderer, View
from .rig import StereoRig
from .scene import World

PATIENCE_S = 6.0
"""A robot that gains less than 2 cm of its path in this time is stuck."""


@dataclass(frozen=True)
class Moment:
    """The robot's state when a picture is taken: time [s], true pose (4, 4), odometry, share of the path done."""

    stamp_s: float
    T_world_base: FloatArray
    odometry: Odometry
    progress: float


@dataclass
class Drive:
    """A Source: the drive through a world, from its first waypoint to its last.

    every_m, every_rad: a pair is taken when the robot has moved or turned by this much since the last one.
    max_distance_m: stop earlier. workers: rendering threads; they change the speed and nothing else.
    """

    world: World
    rig: StereoRig = field(default_factory=StereoRig)
    every_m: float = 0.2
    every_rad: float = 0.13
    speed_mps: float = 0.4
    max_distance_m: float | None = None
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
        PathFollower(self.world.waypoints_m, self.speed_mps)

    @property
    def most_observations(self) -> int:
        """An upper estimate of how many observations the drive yields."""
        length_m = min(self.max_distance_m or np.inf, self.world.path_length_m)
        legs = np.diff(self.world.waypoints_m, axis=0)
        turned_rad = float(np.abs(np.diff(np.unwrap(np.arctan2(legs[:, 1], legs[:, 0])))).sum())
        return 2 + ceil(length_m / self.every_m) + ceil(1.3 * turned_rad / self.every_rad)

    def __iter__(self) -> Generator[Observation, None, None]:
        renderer = Renderer(self.world)
        with ThreadPoolExecutor(self.workers) as pool:
            waiting: deque[tuple[Moment, Future[tuple[View, Image]]]] = deque()
            for moment in self.moments():
                waiting.append((moment, pool.submit(self.rig.look, renderer, moment.T_world_base)))
                # Enough ahead to keep every thread busy, few enough to hold little in memory.
                if len(waiting) > self.workers + 1:
                    yield self._observation(*waiting.popleft())
            while waiting:
                yield self._observation(*waiting.popleft())

    def moments(self) -> Iterator[Moment]:
        """The physics alone: when and where the pictures are taken."""
        follower = PathFollower(self.world.waypoints_m, self.speed_mps, self.max_distance_m)
        # Half a tick's motion less, so that a pair is taken at the tick nearest to where it is due.
        step_m = self.every_m - 0.5 * TICK_S * self.speed_mps
        step_rad = self.every_rad - 0.5 * TICK_S * MAX_TURN_RADPS
        watch = _Watch()
        with Pioneer(self.world) as robot:
            last = _moment(robot, follower)
            yield last
            while not follower.arrived:
                robot.drive(*follower.command(robot.T_world_base, TICK_S))
                watch.check(robot, follower)
                if _has_moved(last.T_world_base, robot.T_world_base, step_m, step_rad):
                    last = _moment(robot, follower)
                    yield last

    def _observation(self, moment: Moment, future: "Future[tuple[View, Image]]") -> Observation:
        left, right = future.result()
        self.progress = moment.progress
        return Observation(
            stamp_s=moment.stamp_s,
            left=left.gray,
            right=right,
            odometry=moment.odometry,
            T_world_cam=moment.odometry.T_odom_base @ self.T_base_cam,
            truth=Truth(moment.T_world_base @ self.T_base_cam, left.depth_m),
        )


@dataclass
class _Watch:
    """Notices when the robot makes no headway."""

    progress_m: float = 0.0
    since_s: float = 0.0

    def check(self, robot: Pioneer, follower: PathFollower) -> None:
        if follower.progress_m > self.progress_m + 0.02:
            self.progress_m, self.since_s = follower.progress_m, robot.time_s
        elif robot.time_s - self.since_s > PATIENCE_S:
            x, y = robot.T_world_base[:2, 3]
            raise SimulationError(f"the robot is stuck at x = {x:.2f} m, y = {y:.2f} m after {robot.time_s:.1f} s")


def _moment(robot: Pioneer, follower: PathFollower) -> Moment:
    progress = min(follower.progress_m / follower.length_m, 1.0)
    return Moment(robot.time_s, robot.T_world_base, robot.odometry.reading(), progress)


def _has_moved(T_world_last: FloatArray, T_world_now: FloatArray, step_m: float, step_rad: float) -> bool:
    """Whether the robot, which stays on the floor, moved or turned that far."""
    x_m, y_m = T_world_now[:2, 3] - T_world_last[:2, 3]
    turned_rad = remainder(yaw_rad(T_world_now) - yaw_rad(T_world_last), 2 * pi)
    return hypot(x_m, y_m) >= step_m or abs(turned_rad) >= step_rad
