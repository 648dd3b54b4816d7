"""The robot's body in the physics engine, on tyres and motors of our own.

PyBullet moves the body and keeps it out of the things around, with no friction; the tyres give the forces of the
ground, and of the tyres on what they touch, and turn the wheels.
"""

from math import pi, remainder

import numpy as np

from stereogrid.geometry import FloatArray, from_quaternion_wxyz, from_rotation, from_yaw, yaw_rad

from ..bullet import pybullet
from ..scene.scene import World
from .chassis import Chassis, Part, bottom_corners, parts
from .footing import stand
from .ground import Surface
from .obstacles import MovingBody, build_ground, build_movers, build_solids, place
from .odometry import EFFECTIVE_TRACK_M, WHEEL_RADIUS_M
from .tyres import CONTACT_NUMBERS, TyreLaw, Tyres

STEP_S = 1 / 240
STEPS_A_TICK = 8
TICK_S = STEPS_A_TICK * STEP_S
SETTLE_STEPS = 240
"""Before time starts, the robot settles on its tyres."""
TORQUE_NM = 12.0
"""The most that the motor of a side gives: on most floors the wheels slip before."""
HIGHEST_START_M = 0.2
"""The robot may start on a slab as high as this."""
TRACK_M, WHEELBASE_M = 0.398, 0.268
SIDEWAYS = (EFFECTIVE_TRACK_M / TRACK_M - 1) * (TRACK_M / WHEELBASE_M) ** 2
"""Tyres hold this much better sideways than along: the real robot's effective track comes out then."""
SPRING_NPM, DAMPER_NSPM = 30000.0, 800.0
SCRUB_M = 0.25
WORLD_GROUP, ROBOT_GROUP, GROUND_GROUP = 1, 2, 4
RAY_GROUP = 1
"""Of the engine's rays; it must be in the mask of what they are to hit."""


class Body:
    """A robot that stands at x = y = 0 of a world, or of an empty plane, heading +x.

    turns_rad (2,): of the left and the right wheels since the start.
    """

    def __init__(self, world: World | None, chassis: Chassis, surface: Surface) -> None:
        self._world = world
        self._com_m, self._mass = chassis.balance()
        self._shapes = parts()
        self._wheels = np.array([part.place_m for part in self._shapes if part.is_tread]) - self._com_m
        self._corners = bottom_corners(self._shapes) - self._com_m
        self._ground = _heights(world)
        self._tyres = Tyres(_law(surface), self._mass, self._wheels, len(self._wheels) + len(self._corners))
        self.turns_rad = np.zeros(2)
        self.client: int = pybullet.connect(pybullet.DIRECT)
        try:
            self._build()
            self._frames = np.array([self._frame(), self._frame()])
            self.run(np.zeros(2), True, 0.0, SETTLE_STEPS)
        except BaseException:
            self.close()
            raise
        self.turns_rad = np.zeros(2)

    def close(self) -> None:
        """Leave the physics engine."""
        if self.client >= 0:
            pybullet.disconnect(self.client)
            self.client = -1

    @property
    def T_world_base(self) -> FloatArray:
        """The true pose (4, 4)."""
        p, q = pybullet.getBasePositionAndOrientation(self._robot, physicsClientId=self.client)
        # PyBullet reports the centre of mass.
        T = from_quaternion_wxyz([q[3], q[0], q[1], q[2]], p)
        T[:3, 3] -= T[:3, :3] @ self._com_m
        return T

    @property
    def spins_radps(self) -> FloatArray:
        """(2,) of the left and the right wheels."""
        return self._tyres.spins_radps

    @property
    def torques_nm(self) -> FloatArray:
        """(2,) of the motors of the left and the right wheels."""
        return self._tyres.torques_nm

    def touched_m(self) -> FloatArray:
        """Where (K, 3) the body, wheels included, pressed on things and its corners on the ground, in base."""
        T = self.T_world_base
        things = (self._contacts()[:, :3] - T[:3, 3]) @ T[:3, :3]
        grounded = self._corners[self._tyres.loads_n[len(self._wheels) :] > 0] + self._com_m
        return np.concatenate([things, grounded])

    def run(self, targets_radps: FloatArray, powered: bool, time_s: float, steps: int = STEPS_A_TICK) -> None:
        """Some steps with the motors turning the wheels (2,) [rad/s], or off. time_s: where the movers go to."""
        client = self.client
        motors = np.stack([targets_radps, np.full(2, float(powered))], axis=1)
        paths = [(m, m.T_world_mover, self._world.T_world_mover(m.mover, time_s)) for m in self._movers if self._world]
        for k in range(steps):
            for moving, start, end in paths:
                _move(moving, start, end, (k + 1) / steps, client)
            self._push(motors)
            pybullet.stepSimulation(physicsClientId=client)
            self.turns_rad = self.turns_rad + STEP_S * self.spins_radps

    def _push(self, motors: FloatArray) -> None:
        """Apply the forces of the ground and the tyres for the next step."""
        client, robot, frames = self.client, self._robot, self._frames
        frames[0], frames[1] = frames[1], self._frame()
        feet = stand(frames[1], self._wheels, self._corners, WHEEL_RADIUS_M, *self._ground)
        v, w = pybullet.getBaseVelocity(robot, physicsClientId=client)
        forces = self._tyres.step(frames, np.array(v + w), feet, self._contacts(), motors).tolist()
        at = frames[1, :3].tolist()
        pybullet.applyExternalForce(robot, -1, forces[:3], at, pybullet.WORLD_FRAME, physicsClientId=client)
        pybullet.applyExternalTorque(robot, -1, forces[3:], pybullet.WORLD_FRAME, physicsClientId=client)

    def _frame(self) -> tuple[float, ...]:
        """Twelve numbers: the centre of mass and the rotation, row by row."""
        p, q = pybullet.getBasePositionAndOrientation(self._robot, physicsClientId=self.client)
        numbers: tuple[float, ...] = p + pybullet.getMatrixFromQuaternion(q)
        return numbers

    def _contacts(self) -> FloatArray:
        """(K, CONTACT_NUMBERS) of the last step, those that bore a load."""
        points = pybullet.getContactPoints(self._robot, physicsClientId=self.client)
        rows = [(*c[5], *c[7], c[9]) for c in points if c[9] > 0]
        return np.array(rows, dtype=np.float64).reshape(-1, CONTACT_NUMBERS)

    def _build(self) -> None:
        client, world = self.client, self._world
        pybullet.setPhysicsEngineParameter(
            fixedTimeStep=STEP_S, numSolverIterations=50, deterministicOverlappingPairs=1, physicsClientId=client
        )
        pybullet.setGravity(0, 0, -9.81, physicsClientId=client)
        # The ground is there for the sonars alone.
        for ground in build_ground(world.terrain if world is not None else None, client):
            pybullet.setCollisionFilterGroupMask(ground, -1, GROUND_GROUP, RAY_GROUP, physicsClientId=client)
        bodies: list[int] = []
        self._movers: list[MovingBody] = []
        if world is not None:
            self._movers = build_movers(world, client)
            bodies += [*build_solids(world, client), *(m.body for m in self._movers)]
        for body in bodies:
            pybullet.setCollisionFilterGroupMask(body, -1, WORLD_GROUP, ROBOT_GROUP | RAY_GROUP, physicsClientId=client)
        self._robot = self._build_robot()
        pybullet.setCollisionFilterGroupMask(self._robot, -1, ROBOT_GROUP, WORLD_GROUP, physicsClientId=client)

    def _build_robot(self) -> int:
        client = self.client
        shape = _compound(self._shapes, self._com_m, client)
        T = self._start()
        place_m = (T[:3, :3] @ self._com_m + T[:3, 3]).tolist()
        robot: int = pybullet.createMultiBody(self._mass[0], shape, -1, place_m, physicsClientId=client)
        place(robot, from_rotation(T[:3, :3], place_m), client)
        pybullet.changeDynamics(
            robot, -1, localInertiaDiagonal=self._mass[1:].tolist(), linearDamping=0, angularDamping=0,
            lateralFriction=0, activationState=pybullet.ACTIVATION_STATE_DISABLE_SLEEPING,
            contactStiffness=SPRING_NPM, contactDamping=DAMPER_NSPM, physicsClientId=client,
        )  # fmt: skip
        return robot

    def _start(self) -> FloatArray:
        """The pose (4, 4) of the base, on whatever its wheels stand on: the ground or a slab on it."""
        feet = np.array([part.place_m[:2] for part in self._shapes if part.is_tread])
        ground = self._world.ground_height_m(feet) if self._world is not None else np.zeros(len(feet))
        tops = np.c_[feet, ground + HIGHEST_START_M].tolist()
        ends = np.c_[feet, ground].tolist()
        hits = pybullet.rayTestBatch(tops, ends, collisionFilterMask=WORLD_GROUP, physicsClientId=self.client)
        height = np.array([hit[3][2] if hit[0] >= 0 else z for hit, z in zip(hits, ground, strict=True)])
        along, across, middle = np.linalg.lstsq(np.c_[feet, np.ones(len(feet))], height, rcond=None)[0]
        up = np.array([-along, -across, 1.0]) / np.sqrt(1 + along**2 + across**2)
        left = np.cross(up, [1.0, 0.0, 0.0])
        left /= np.linalg.norm(left)
        # On the highest of the wheels: it falls the rest.
        lift = float(np.max(height - feet @ [along, across] - middle))
        return from_rotation(np.stack([np.cross(left, up), left, up], axis=1), [0.0, 0.0, middle + lift])


def _law(surface: Surface) -> TyreLaw:
    width_m = max(part.size_m[1] for part in parts() if part.is_wheel)
    return TyreLaw(
        friction=surface.friction, rolling=surface.rolling, creep=surface.creep, sideways=SIDEWAYS,
        still_mps=2e-5, radius_m=WHEEL_RADIUS_M, half_width_m=width_m / 2, inertia_kgm2=0.02,
        torque_nm=TORQUE_NM, gain_nms=20000.0, drag_nm=0.1, step_s=STEP_S,
        spring_npm=SPRING_NPM, damper_nspm=DAMPER_NSPM, scrub_m=SCRUB_M, body_friction=0.3,
    )  # fmt: skip


def _heights(world: World | None) -> tuple[FloatArray, FloatArray]:
    """The ground as footing.ground reads it: heights, and x0, y0 and pitch."""
    if world is None or world.terrain is None:
        return np.zeros((2, 2)), np.array([-1e6, -1e6, 2e6])
    terrain = world.terrain
    return np.ascontiguousarray(terrain.heights_m, np.float64), np.array([*terrain.origin_m, terrain.pitch_m])


def _move(moving: MovingBody, start: FloatArray, end: FloatArray, share: float, client: int) -> None:
    """A share of the way from where it was to where it is to be, both upright; the short way round."""
    turn_rad = remainder(yaw_rad(end) - yaw_rad(start), 2 * pi)
    T = from_yaw(yaw_rad(start) + share * turn_rad, start[:3, 3] + share * (end[:3, 3] - start[:3, 3]))
    moving.T_world_mover = T
    place(moving.body, T, client)


def _compound(shapes: list[Part], com_m: FloatArray, client: int) -> int:
    sideways = pybullet.getQuaternionFromEuler([np.pi / 2, 0, 0])
    wheels = [part.is_wheel for part in shapes]
    shape: int = pybullet.createCollisionShapeArray(
        shapeTypes=[pybullet.GEOM_CYLINDER if wheel else pybullet.GEOM_BOX for wheel in wheels],
        radii=[part.size_m[0] if part.is_wheel else 0.0 for part in shapes],
        lengths=[part.size_m[1] if part.is_wheel else 0.0 for part in shapes],
        halfExtents=[[0.0] * 3 if part.is_wheel else [s / 2 for s in part.size_m] for part in shapes],
        collisionFramePositions=[(part.place_m - com_m).tolist() for part in shapes],
        collisionFrameOrientations=[sideways if wheel else [0.0, 0.0, 0.0, 1.0] for wheel in wheels],
        physicsClientId=client,
    )
    return shape
