"""What embree sees, one ray a pixel, to compare the renderer with."""

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene

from sim.rig import MINORU
from sim.scene.scene import World
from stereogrid.geometry import FloatArray


def cast_rays(world: World, T_world_cam: FloatArray) -> tuple[np.ndarray, np.ndarray]:
    """The face (H, W) that embree hits first at each pixel, -1 for none, and the depth (H, W) of its plane [m]."""
    scene, vertices = EmbreeScene(), world.vertices_m.astype(np.float32)
    TriangleMesh(scene, vertices, world.triangles)
    eye, rays = T_world_cam[:3, 3], MINORU.ray_directions.reshape(-1, 3) @ T_world_cam[:3, :3].T
    origins = np.tile(eye.astype(np.float32), (len(rays), 1))
    hits = scene.run(origins, rays.astype(np.float32), query="INTERSECT")
    a, b, c = np.moveaxis(world.vertices_m[world.triangles[hits]], 1, 0)
    normals = np.cross(b - a, c - a)
    depth = ((a - eye) * normals).sum(axis=1) / (rays * normals).sum(axis=1)
    of_triangle = np.repeat(np.arange(len(world.face_corners)), [len(c) - 2 for c in world.face_corners])
    faces = np.where(hits >= 0, of_triangle[hits], -1)
    return faces.reshape(MINORU.shape), depth.reshape(MINORU.shape)
