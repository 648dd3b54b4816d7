"""The simulated Pioneer 3-AT: PyBullet physics of a skid-steered robot in a static world."""

from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
import trimesh

from stereogrid.errors import StereogridError
from stereogrid.geometry import FloatArray, from_quaternion_wxyz

from .bullet import pybullet
from .odometry import EFFECTIVE_TRACK_M, WHEEL_RADIUS_M, WheelOdometry
from .scene import World

URDF = Path(__file__).parent / "assets" / "pioneer3at.urdf"
STEP_S = 1 / 240
STEPS_A_TICK = 8
TICK_S = STEPS_A_TICK * STEP_S
"""The wheels' controller and the encoders run at 30 Hz."""
MOTOR_TORQUE_NM = 12.0
WHEEL_FRICTION: dict[str, Any] = {
    "lateralFriction": 0.8,
    # Sideways along the axle tyres scrub more easily than they roll: the measured ratio of wheel yaw to true
    # yaw is then 1.4 to 1.6, as on the real robot (0.588 / 0.398).
    "anisotropicFriction": [1.0, 0.233, 1.0],
    # Tyres resist rolling a little; without it gentle arcs would turn too easily.
    "rollingFriction": 0.0005,
    "contactStiffness": 10000.0,
    "contactDamping": 300.0,
}
MAX_TILT = 0.3
"""Sine of the tilt beyond which the robot has fallen."""


class SimulationError(StereogridError):
    """The simulated robot cannot do what it was asked: it is stuck, or it fell."""


class Pioneer:
    """A robot at rest at the origin of a world (or of an empty plane), heading +x. Use as a context manager.

    T_world_base (4, 4) is its true pose, odometry what it believes, time_s since the start.
    Rebuilding it gives the same motion bit for bit; there is no reset.
    """

    def __init__(self, world: World | None = None) -> None:
        self._client = pybullet.connect(pybullet.DIRECT)
        self.time_s = 0.0
        self.odometry = WheelOdometry()
        try:
            self._build(world)
        except BaseException:
            self.close()
            raise
        self._encoders_rad = self.encoders_rad()
        self.T_world_base = self._pose()

    def __enter__(self) -> "Pioneer":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Leave the physics engine; the robot is gone."""
        if self._client >= 0:
            pybullet.disconnect(self._client)
            self._client = -1

    def encoders_rad(self) -> FloatArray:
        """Turns (2,) of the left and the right wheels since the start [rad]; the two on a side are geared together."""
        states = pybullet.getJointStates(self._robot, range(4), physicsClientId=self._client)
        angles = [state[0] for state in states]
        return np.array([(angles[0] + angles[1]) / 2, (angles[2] + angles[3]) / 2])

    def drive(self, speed_mps: float, turn_radps: float) -> None:
        """Run the wheels for one tick of TICK_S as the firmware would: by the published effective track."""
        half = turn_radps * EFFECTIVE_TRACK_M / 2
        left, right = (speed_mps - half) / WHEEL_RADIUS_M, (speed_mps + half) / WHEEL_RADIUS_M
        self._spin([left, left, right, right], STEPS_A_TICK)
        self.time_s += TICK_S
        encoders = self.encoders_rad()
        self.odometry.update(*(encoders - self._encoders_rad))
        self._encoders_rad = encoders
        self.T_world_base = self._pose()
        if self.T_world_base[2, 2] < np.sqrt(1 - MAX_TILT**2):
            raise SimulationError(f"the robot fell over at {self.time_s:.1f} s")

    def _pose(self) -> FloatArray:
        p, q = pybullet.getBasePositionAndOrientation(self._robot, physicsClientId=self._client)
        T_world_com = from_quaternion_wxyz([q[3], q[0], q[1], q[2]], p)
        # PyBullet reports the centre of mass.
        return T_world_com @ self._T_com_base

    def _spin(self, wheels_radps: list[float], steps: int) -> None:
        pybullet.setJointMotorControlArray(
            self._robot,
            range(4),
            pybullet.VELOCITY_CONTROL,
            targetVelocities=wheels_radps,
            forces=[MOTOR_TORQUE_NM] * 4,
            physicsClientId=self._client,
        )
        for _ in range(steps):
            pybullet.stepSimulation(physicsClientId=self._client)

    def _build(self, world: World | None) -> None:
        client = self._client
        # The cache would hand out an older robot from the same path.
        pybullet.setPhysicsEngineParameter(
            fixedTimeStep=STEP_S,
            numSolverIterations=50,
            deterministicOverlappingPairs=1,
            enableFileCaching=0,
            physicsClientId=client,
        )
        pybullet.setGravity(0, 0, -9.81, physicsClientId=client)
        plane = pybullet.createCollisionShape(pybullet.GEOM_PLANE, physicsClientId=client)
        ground = pybullet.createMultiBody(0, plane, physicsClientId=client)
        pybullet.changeDynamics(ground, -1, lateralFriction=1.0, physicsClientId=client)
        if world is not None:
            self._build_obstacles(world)
        flags = pybullet.URDF_USE_IMPLICIT_CYLINDER | pybullet.URDF_USE_INERTIA_FROM_FILE
        self._robot = pybullet.loadURDF(str(URDF), flags=flags, physicsClientId=client)
        com_m = pybullet.getDynamicsInfo(self._robot, -1, physicsClientId=client)[3]
        self._T_com_base = from_quaternion_wxyz([1, 0, 0, 0], [-c for c in com_m])
        for link in range(-1, 4):
            friction = WHEEL_FRICTION if link >= 0 else {}
            pybullet.changeDynamics(
                self._robot, link, linearDamping=0, angularDamping=0, jointDamping=0, physicsClientId=client, **friction
            )
        # Half a second to settle on its tyres before time starts.
        self._spin([0.0] * 4, 120)

    def _build_obstacles(self, world: World) -> None:
        """One static body of triangles: hundreds of bodies would cost half of the simulation's time."""
        # The floor is the plane, and what hangs high the robot cannot touch.
        low = [s for s in world.solids if s.vertices_m[:, 2].max() > 0 and s.vertices_m[:, 2].min() < 0.6]
        mesh = trimesh.util.concatenate([solid.mesh() for solid in low])
        hull = pybullet.createCollisionShape(
            pybullet.GEOM_MESH,
            vertices=mesh.vertices.tolist(),
            indices=mesh.faces.ravel().tolist(),
            flags=pybullet.GEOM_FORCE_CONCAVE_TRIMESH,
            physicsClientId=self._client,
        )
        pybullet.createMultiBody(0, hull, physicsClientId=self._client)
