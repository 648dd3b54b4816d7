"""A world with the robot in it, as a bystander sees them, beside what the robot's cameras see."""

from dataclasses import dataclass, replace

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from numpy.typing import NDArray

from stereogrid.camera import StereoCamera
from stereogrid.errors import InvalidInputError
from stereogrid.geometry import FloatArray, look_at, transform
from stereogrid.observation import FloatImage, Image

from ..rendering.render import Renderer, View
from ..rendering.shapes import Actor
from ..rig import StereoRig
from ..robot.chassis import parts
from ..scene.scene import World
from .robot_body import TINTS, robot_solids, robot_textures

Bystander = tuple[float, float]
INDOORS_M: tuple[Bystander, ...] = ((2.6, 1.5), (2.6, 2.2), (2.2, 3.0), (1.6, 3.8), (0.8, 4.4))
OUTDOORS_M: tuple[Bystander, ...] = ((4.2, 1.9), (3.4, 2.6), (2.6, 3.6), (1.4, 5.0))
"""How far behind and above the robot the bystander may stand; the first place from where it is seen is taken."""
LOOK_UP_RAD = 0.16
"""The bystander looks past the robot by this much: it stands below the middle of his picture."""
NOTHING_GRAY = 236
"""Where indoors there is nothing, outside of the walls."""
ROBOT_M = ((0.0, 0.0, 0.35), (-0.25, 0.2, 0.2), (-0.25, -0.2, 0.2), (1.0, 0.0, 0.05))
"""What of the robot (in base), and of the ground before it, must be seen."""
CUT_M = 2.2
"""Indoors, what hangs higher than this is left out of the bystander's view: ceilings would hide the room."""
ROBOT = "robot"


@dataclass(frozen=True)
class Sight:
    """overview (H, W, 3) uint8 RGB; left, right (H, W) uint8; depth_m (H, W) of the left one, NaN where nothing is."""

    overview: NDArray[np.uint8]
    left: Image
    right: Image
    depth_m: FloatImage


class Viewer:
    """Looks at a world: once through the cameras of a rig, once as a bystander with a camera of his own."""

    def __init__(self, world: World, bystander: StereoCamera, rig: StereoRig | None = None) -> None:
        self.rig = rig or StereoRig()
        self.world = world
        self._camera = bystander
        open_world = without_ceiling(world)
        self._places = OUTDOORS_M if open_world is world else INDOORS_M
        body = robot_solids(self.rig)
        self._seen_by_bystander = Renderer(open_world, actors=(Actor(ROBOT, body, robot_textures()),))
        # To its own cameras the robot is nowhere; so one renderer may serve both, which spares half of the lighting.
        self._seen_by_robot = self._seen_by_bystander if open_world is world else Renderer(world)
        self._tints = _tints(open_world, [face.texture for solid in body for face in solid.faces])
        self._scene = EmbreeScene()
        # Embree keeps no copy of its own.
        self._mesh = TriangleMesh(self._scene, open_world.vertices_m.astype(np.float32), open_world.triangles)

    def look(self, T_world_base: FloatArray, *, time_s: float = 0.0) -> Sight:
        """What is seen with the robot at T_world_base (4, 4), time_s after the movers have started."""
        left, right = self.pair(T_world_base, time_s=time_s)
        return Sight(self.overview(T_world_base, time_s=time_s), left.gray, right, left.depth_m)

    def pair(self, T_world_base: FloatArray, *, time_s: float = 0.0) -> tuple[View, Image]:
        """The left view and the right image (H, W) alone."""
        return self.rig.look(self._seen_by_robot, T_world_base, time_s=time_s)

    def overview(self, T_world_base: FloatArray, *, time_s: float = 0.0) -> NDArray[np.uint8]:
        """The bystander's picture alone (H, W, 3) RGB: gray, as all cameras here see it, the robot in its colours."""
        eye = self.eye(T_world_base)
        view = self._seen_by_bystander.view(self._camera, eye, time_s=time_s, actors_at={ROBOT: T_world_base})
        gray = view.gray if self.world.sky else np.where(view.faces < 0, np.uint8(NOTHING_GRAY), view.gray)
        # Face -1 picks the last one of the table.
        return np.clip(gray[..., None] * self._tints[view.faces], 0, 255).astype(np.uint8)

    def eye(self, T_world_base: FloatArray) -> FloatArray:
        """The pose (4, 4) of the bystander's camera: behind and above the robot, where nothing hides it."""
        forward = T_world_base[:3, 0] * [1, 1, 0] / np.linalg.norm(T_world_base[:2, 0])
        at = T_world_base[:3, 3]
        wanted = transform(T_world_base, np.array(ROBOT_M))
        for back_m, up_m in self._places:
            eye_m = at - back_m * forward + [0, 0, up_m]
            if self._sees(eye_m, wanted):
                break
        down_rad = float(np.arctan2(up_m, back_m)) - LOOK_UP_RAD
        return look_at(eye_m, eye_m + np.cos(down_rad) * forward - [0, 0, np.sin(down_rad)])

    def _sees(self, eye_m: FloatArray, points_m: FloatArray) -> bool:
        away = points_m - eye_m
        origins = np.tile(eye_m, (len(points_m), 1)).astype(np.float32)
        reached = self._scene.run(origins, away.astype(np.float32), query="DISTANCE")
        # Distances are in lengths of the direction.
        return bool((reached > 0.97).all())


def without_ceiling(world: World) -> World:
    """The world without what hangs above CUT_M over its ground, where lamps light it; another one as it is."""
    if not world.lamps:
        return world
    kept = tuple(s for s in world.solids if _lowest_above_ground_m(world, s.vertices_m) < CUT_M)
    return replace(world, solids=kept)


def _lowest_above_ground_m(world: World, vertices_m: FloatArray) -> float:
    return float((vertices_m[:, 2] - world.ground_height_m(vertices_m[:, :2])).min())


def _tints(world: World, textures: list[str]) -> NDArray[np.float32]:
    """Factors (F + 1, 3) on red, green and blue by face: the world's and its movers', the robot's, and nothing's."""
    n_others = sum(len(s.faces) for s in (*world.solids, *(s for mover in world.movers for s in mover.solids)))
    robot = np.array([TINTS.get(name, (1.0, 1.0, 1.0)) for name in textures])
    return np.concatenate([np.ones((n_others, 3)), robot, np.ones((1, 3))]).astype(np.float32)


def pose_at(world: World, station_m: float) -> FloatArray:
    """The robot (4, 4) at station_m along the path [m], on the ground, tilted as the ground under its wheels is.

    Raises InvalidInputError beyond the ends of the path.
    """
    if not 0 <= station_m <= world.path_length_m:
        raise InvalidInputError(
            f"the path of {world.name!r} is {world.path_length_m:.1f} m long: no place is {station_m:g} m along it"
        )
    yaw = world.route.yaw_rad(station_m)
    return _on_ground(world, world.route.at(station_m), np.array([np.cos(yaw), np.sin(yaw)]))


def _on_ground(world: World, xy_m: FloatArray, ahead: FloatArray) -> FloatArray:
    left = np.array([-ahead[1], ahead[0]])
    ahead_m, left_m = np.max([part.place_m[:2] for part in parts() if part.is_tread], axis=0)
    fore, aft, port, starboard = (
        np.append(p, world.ground_height_m(p))
        for p in (xy_m + ahead_m * ahead, xy_m - ahead_m * ahead, xy_m + left_m * left, xy_m - left_m * left)
    )
    x = (fore - aft) / np.linalg.norm(fore - aft)
    z = np.cross(x, port - starboard)
    z /= np.linalg.norm(z)
    T = np.eye(4)
    T[:3, :3] = np.stack([x, np.cross(z, x), z], axis=1)
    T[:3, 3] = (fore + aft + port + starboard) / 4
    return T
