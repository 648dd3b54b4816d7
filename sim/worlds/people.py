"""People who walk about where the robot drives."""

from dataclasses import replace

import numpy as np

from stereogrid.errors import InvalidInputError
from stereogrid.geometry import FloatArray, from_yaw

from ..robot.follower import PathFollower
from ..scene.movers import Mover
from ..scene.scene import World
from ..scene.solids import Solid
from .bodies import PAINTERS, person, trolley
from .clearance import Clearance
from .palette import painted

ROOM_M = 0.4
"""Least distance of a way from what stands: half a stride or half of a pair of shoulders, and a margin."""
APART_M = 0.7
"""Least distance of a walker's middle from the robot's and from another's, in a drive that goes as planned."""
OTHERS_M = 0.3
"""What others reach from their middles; a larger body stays away by this more than its own reach."""
START_APART_M = 2.0
"""Nobody starts nearer to the robot than this."""
SLACK_S = 1.0
"""The robot may be early or late by this much."""
SPEEDS_MPS = (0.6, 1.4)
SHORTEST_M, LONGEST_M = 1.8, 9.0
TRIES = 5000


def with_people(world: World, count: int, seed: int, *, robot_speed_mps: float = 0.4) -> World:
    """The world with `count` more people, who walk to and fro near the robot's path, some with a trolley.

    Their ways are straight, along the path or across it, free of all that stands, and timed so that a robot that
    drives at robot_speed_mps meets nobody closer than APART_M, middle to middle; at another speed it may.
    Same seed, same people.
    Raises InvalidInputError when there is no room for so many.
    """
    if count < 0 or seed < 0:
        raise InvalidInputError(f"count and seed of people must be >= 0, not {count} and {seed}")
    rng = np.random.default_rng([seed, world.seed, 2])
    plan = _Plan(world, robot_speed_mps)
    for k in range(count):
        name = f"person {len(world.movers) + k}"
        found = rng.random() < 0.2 and plan.find(name, trolley(rng), rng)
        # Where there is no room for a trolley there may be for somebody without one.
        if not found and not plan.find(name, person(rng), rng):
            raise InvalidInputError(f"the world {world.name!r} has no room for {count} people, only for {k}")
    textures = {**painted(PAINTERS, seed), **world.textures} if count else world.textures
    return replace(world, textures=textures, movers=(*world.movers, *plan.added))


class _Plan:
    """Where the robot and everybody is at all times of the drive, and room for one more."""

    def __init__(self, world: World, robot_speed_mps: float) -> None:
        self.added: list[Mover] = []
        self._clearance = Clearance(world)
        self._path = PathFollower(world.waypoints_m, robot_speed_mps)
        self._route = world.route
        self._robot = _drive(self._path)
        self._times_s: FloatArray = STEP_S * np.arange(len(self._robot), dtype=np.float64)
        self._others = [(mover.places(self._times_s)[:, :2], _room_m(mover.solids)) for mover in world.movers]

    def find(self, name: str, body: tuple[Solid, ...], rng: np.random.Generator) -> bool:
        """Add a mover on a way where there is room for its body; whether there is."""
        half_m = max(float(np.abs(solid.vertices_m[:, 0]).max()) for solid in body)
        reach_m, room_m = _reach_m(body), _room_m(body)
        for _ in range(TRIES):
            way_m = self._way(rng, half_m)
            # At the ends it turns about.
            if way_m is None or self._clearance.at(way_m).min() < reach_m:
                continue
            length_m = float(np.linalg.norm(way_m[1] - way_m[0]))
            speed, start_m = float(rng.uniform(*SPEEDS_MPS)), float(rng.uniform(0, 2 * length_m))
            mover = Mover(name, body, way_m, speed, start_m)
            places = mover.places(self._times_s)[:, :2]
            if self._is_apart(places, room_m):
                self.added.append(mover)
                self._others.append((places, room_m))
                return True
        return False

    def _way(self, rng: np.random.Generator, half_m: float) -> FloatArray | None:
        """A free straight way (2, 2), along the path or across it, for a body that reaches half_m before and behind
        it [m]; None where a guess finds no room."""
        station_m = float(rng.uniform(0, self._path.length_m))
        yaw = self._route.yaw_rad(station_m)
        ahead, aside = np.array([np.cos(yaw), np.sin(yaw)]), np.array([-np.sin(yaw), np.cos(yaw)])
        along = rng.random() < 0.5
        offset_m = float(rng.choice([-1, 1])) * float(rng.uniform(APART_M, 4.0)) if along else 0.0
        middle = self._route.at(station_m, offset_m)
        direction = ahead if along else aside
        back_m, on_m = (self._reach_m(middle, sign * direction) for sign in (-1, 1))
        back_m, on_m = (reach - max(half_m + 0.1 - ROOM_M, 0.0) for reach in (back_m, on_m))
        if min(back_m, on_m) < 0 or back_m + on_m < SHORTEST_M:
            return None
        length_m = min(back_m + on_m, float(rng.uniform(SHORTEST_M, LONGEST_M)))
        first_m = -back_m + float(rng.uniform(0, back_m + on_m - length_m))
        return np.array([middle + first_m * direction, middle + (first_m + length_m) * direction])

    def _reach_m(self, start: FloatArray, direction: FloatArray) -> float:
        """How far one can walk from a point before something is in the way [m]."""
        steps_m = np.arange(0.0, LONGEST_M, 0.05)
        blocked = self._clearance.at(start + steps_m[:, None] * direction) < ROOM_M
        free = int(blocked.argmax()) if blocked.any() else len(steps_m)
        return float(steps_m[max(free - 1, 0)])

    def _is_apart(self, places: FloatArray, apart_m: float) -> bool:
        if np.linalg.norm(places[0] - self._robot[0]) < START_APART_M:
            return False
        slack = round(SLACK_S / STEP_S)
        shifts = (self._robot, np.roll(self._robot, slack, axis=0), np.roll(self._robot, -slack, axis=0))
        for shift in shifts:
            if np.linalg.norm(places[slack:-slack] - shift[slack:-slack], axis=1).min() < apart_m:
                return False
        return all(np.linalg.norm(places - p, axis=1).min() >= max(apart_m, room_m) for p, room_m in self._others)


STEP_S = 0.1


def _drive(follower: PathFollower) -> FloatArray:
    """Where (T, 2) an ideal robot is every STEP_S from its start until some seconds after its arrival [m]."""
    x, y, yaw, places = 0.0, 0.0, 0.0, []
    while not follower.arrived:
        places.append((x, y))
        speed, turn = follower.command(from_yaw(yaw, (x, y, 0.0)), STEP_S)
        yaw += turn * STEP_S
        x, y = x + speed * STEP_S * float(np.cos(yaw)), y + speed * STEP_S * float(np.sin(yaw))
    return np.array(places + [(x, y)] * round(10.0 / STEP_S))


def _reach_m(body: tuple[Solid, ...]) -> float:
    """How far a body reaches from its middle, about which it turns [m]."""
    return max(float(np.linalg.norm(solid.vertices_m[:, :2], axis=1).max()) for solid in body)


def _room_m(body: tuple[Solid, ...]) -> float:
    """How far the middles of others stay away from that of a body [m]."""
    return max(APART_M, _reach_m(body) + OTHERS_M)
