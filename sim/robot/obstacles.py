"""What the robot can meet: the ground, the world's solids and its movers as bodies of the physics engine."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from stereogrid.geometry import FloatArray, quaternion_wxyz

from ..bullet import pybullet
from ..scene.movers import Mover
from ..scene.scene import World
from ..scene.solids import Solid
from ..scene.terrain import Terrain

LOW_M, HIGH_M = 0.005, 1.6
"""What is lower is rolled over unnoticed; what hangs higher neither the robot nor its sonars meet."""
MOST_VERTICES = 60_000
"""PyBullet silently cuts off a mesh of more than 131072 vertices or 524288 indices."""


@dataclass
class MovingBody:
    """A mover in the physics engine, where it was at the last tick."""

    mover: Mover
    body: int
    T_world_mover: FloatArray


def build_ground(terrain: Terrain | None, client: int) -> list[int]:
    """The ground's bodies: an endless plane, or the terrain's own triangles in bands."""
    if terrain is None:
        plane = pybullet.createCollisionShape(pybullet.GEOM_PLANE, physicsClientId=client)
        return [pybullet.createMultiBody(0, plane, physicsClientId=client)]
    return [_static(vertices, triangles, client) for vertices, triangles in _bands(terrain)]


def build_solids(world: World, client: int) -> list[int]:
    """A few static bodies of many triangles: hundreds of bodies would cost half of the simulation's time."""
    batch: list[Solid] = []
    bodies, count = [], 0
    for solid in _met(world):
        if batch and count + len(solid.vertices_m) > MOST_VERTICES:
            bodies.append(_static(*_merged(batch), client))
            batch, count = [], 0
        batch.append(solid)
        count += len(solid.vertices_m)
    if batch:
        bodies.append(_static(*_merged(batch), client))
    return bodies


def build_movers(world: World, client: int) -> list[MovingBody]:
    """The movers where they are at time 0."""
    moving = []
    for mover in world.movers:
        solids = [s for s in mover.solids if not s.soft and s.vertices_m[:, 2].min() < HIGH_M]
        if solids:
            body = _static(*_merged(solids), client)
            T = world.T_world_mover(mover, 0.0)
            moving.append(MovingBody(mover, body, T))
            place(body, T, client)
    return moving


def place(body: int, T_world_body: FloatArray, client: int) -> None:
    """Put a static body somewhere else."""
    w, x, y, z = quaternion_wxyz(T_world_body)
    pybullet.resetBasePositionAndOrientation(body, T_world_body[:3, 3].tolist(), [x, y, z, w], physicsClientId=client)


def _met(world: World) -> Iterator[Solid]:
    """The solids between LOW_M and HIGH_M over the ground that are hard enough to be met."""
    for solid in world.solids:
        if solid.soft or (world.terrain is not None and solid.seen_from_above):
            continue
        z = solid.vertices_m[:, 2]
        if world.terrain is not None:
            z = z - world.ground_height_m(solid.vertices_m[:, :2])
        if z.max() > LOW_M and z.min() < HIGH_M:
            yield solid


def _bands(terrain: Terrain) -> Iterator[tuple[FloatArray, FloatArray]]:
    """The top of the terrain: vertices (V, 3) and triangles (T, 3), some rows at a time."""
    rows, columns = terrain.heights_m.shape
    most = max(MOST_VERTICES // columns, 2) - 1
    for start in range(0, rows - 1, most):
        stop = min(start + most, rows - 1)
        x = terrain.origin_m[0] + np.arange(columns) * terrain.pitch_m
        y = terrain.origin_m[1] + np.arange(start, stop + 1) * terrain.pitch_m
        vertices = np.stack([*np.meshgrid(x, y), terrain.heights_m[start : stop + 1]], axis=-1).reshape(-1, 3)
        a = (np.arange(stop - start)[:, None] * columns + np.arange(columns - 1)).ravel()
        b, c, d = a + 1, a + columns + 1, a + columns
        yield vertices, np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])


def _merged(solids: Sequence[Solid]) -> tuple[FloatArray, FloatArray]:
    meshes = [solid.mesh() for solid in solids]
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    vertices = np.concatenate([mesh.vertices for mesh in meshes])
    return vertices, np.concatenate([mesh.faces + start for mesh, start in zip(meshes, starts, strict=False)])


def _static(vertices: FloatArray, triangles: FloatArray, client: int) -> int:
    shape = pybullet.createCollisionShape(
        pybullet.GEOM_MESH,
        vertices=vertices.tolist(),
        indices=triangles.ravel().tolist(),
        flags=pybullet.GEOM_FORCE_CONCAVE_TRIMESH,
        physicsClientId=client,
    )
    body: int = pybullet.createMultiBody(0, shape, physicsClientId=client)
    return body
