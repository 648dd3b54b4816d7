"""A world at one moment: where everything that moves is, and the light that falls on it there."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from stereogrid.errors import unknown_name
from stereogrid.geometry import FloatArray, as_pose, inverse

from ..scene.scene import World
from .casting import Target
from .lighting import OFF_M, OwnLight, lamps_light, shown, sun_light
from .shapes import Actor
from .sheets import Spots
from .sky import sun_of
from .vectors import placed, turned


@dataclass(frozen=True)
class Stage:
    """poses: T_world_body (4, 4) of each body that is there, by its number; 0 is the world itself.

    lights: those of lighting.Sheets, with the moving bodies' where they are.
    """

    poses: Mapping[int, FloatArray]
    lights: NDArray[np.float32]


def poses_at(
    world: World, actors: Sequence[Actor], time_s: float, actors_at: Mapping[str, FloatArray]
) -> dict[int, FloatArray]:
    """T_world_body (4, 4) by body. Raises InvalidInputError for a pose that is none or of nobody."""
    poses = {0: np.eye(4)}
    for k, mover in enumerate(world.movers):
        poses[1 + k] = world.T_world_mover(mover, time_s)
    numbers = {actor.name: 1 + len(world.movers) + k for k, actor in enumerate(actors)}
    for name, pose in actors_at.items():
        if name not in numbers:
            raise unknown_name("actor", name, numbers)
        poses[numbers[name]] = as_pose(pose, f"the pose of {name!r}")
    return poses


def light_moving(
    world: World, targets: Sequence[Target], own: Sequence[OwnLight], poses: Mapping[int, FloatArray]
) -> NDArray[np.float32]:
    """The light on the sheets of all moving bodies, one after the other, where they are; 0 on those that are not.

    It comes from everywhere, from the sun, with shadows, and from the lamps, which are taken to be in sight.
    """
    lights = []
    for k, light in enumerate(own, start=1):
        if k in poses:
            total = world.ambient * light.openness + _light_at(world, (targets[0], targets[k]), light, poses[k])
            lights.append(np.where(light.glows, 1.0, shown(total)))
        else:
            lights.append(np.zeros(len(light.openness)))
    return np.concatenate(lights).astype(np.float32)


def _light_at(world: World, targets: tuple[Target, Target], light: OwnLight, T_world_body: FloatArray) -> FloatArray:
    here = _spots(placed(light.points, T_world_body), turned(light.normals, T_world_body))
    total = lamps_light(None, world.lamps, here)
    if world.sky is not None and world.sky.sun_power > 0:
        towards_sun = np.tile(turned(sun_of(world.sky)[None], inverse(T_world_body)), (len(total), 1))
        own_shade = targets[1].blocked(light.points + OFF_M * light.normals, towards_sun)
        total += np.where(own_shade, 0.0, sun_light(targets[:1], world.sky, here))
    return total


def _spots(points: FloatArray, normals: FloatArray) -> Spots:
    none = np.zeros(0, np.int64)
    return Spots(none, none, points, normals, normals)
