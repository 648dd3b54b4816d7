"""A quick look through PyBullet's TinyRenderer: flat grays, depth to centimetres. Never for scores.

It samples by nearest neighbour, off by half a pixel, and knows no sky, light or texture of the world.
"""

from threading import Lock
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from stereogrid.camera import StereoCamera
from stereogrid.geometry import FloatArray, inverse

from ..bullet import pybullet
from ..scene.scene import World
from .render import View
from .shapes import Bodies, gather

NEAR_M, FAR_M = 0.05, 100.0
MOST_TRIANGLES = 8000
"""Of one mesh: PyBullet's shared memory holds no more."""
LIGHT = {"lightDirection": [0.4, 0.3, 1.0], "shadow": 0, "lightAmbientCoeff": 0.5, "lightDiffuseCoeff": 0.5}


class BulletRenderer:
    """A world as PyBullet draws it, with the `view` of render.Renderer. One picture at a time, from any thread."""

    def __init__(self, world: World) -> None:
        self._world, self._lock = world, Lock()
        self._client = pybullet.connect(pybullet.DIRECT)
        bodies = gather(world, ())
        self._parts = [self._add(bodies, k) for k in range(1 + len(world.movers))]

    def __del__(self) -> None:
        if pybullet.isConnected(self._client):
            pybullet.disconnect(self._client)

    def view(self, camera: StereoCamera, T_world_cam: FloatArray, *, time_s: float = 0.0) -> View:
        """What a camera at T_world_cam (4, 4) sees, roughly; faces are not known, -1 everywhere."""
        # OpenGL looks along -z with y up.
        T_gl_world = np.diag([1.0, -1.0, -1.0, 1.0]) @ inverse(T_world_cam)
        with self._lock:
            self._place_movers(time_s)
            _, _, rgba, buffer, _ = pybullet.getCameraImage(
                camera.width_px,
                camera.height_px,
                T_gl_world.T.ravel().tolist(),
                _projection(camera).T.ravel().tolist(),
                renderer=pybullet.ER_TINY_RENDERER,
                physicsClientId=self._client,
                **LIGHT,
            )
        # A wheel built without NumPy gives tuples.
        gray = np.asarray(rgba, np.uint8).reshape(*camera.shape, 4)[..., 0].copy()
        share = np.asarray(buffer, np.float64).reshape(camera.shape)
        depth_m = FAR_M * NEAR_M / (FAR_M - (FAR_M - NEAR_M) * share)
        missing = share >= 1.0
        gray[missing] = 0 if self._world.sky is None else round(255 * self._world.sky.horizon)
        depth_m[missing] = np.nan
        return View(gray, depth_m.astype(np.float32), np.full(camera.shape, -1, np.int32))

    def _add(self, bodies: Bodies, k: int) -> list[int]:
        """The meshes of a body, one a texture and chunk."""
        textures = np.array([face.texture for face in bodies.faces])
        mine = bodies.body_of_face == k
        parts = []
        for name in np.unique(textures[mine]):
            triangles = bodies.triangles(mine & (textures == name))[0]
            gray = float(self._world.textures[name].image.mean()) / 255
            parts += [
                self._add_mesh(bodies.shapes.vertices[triangles[first : first + MOST_TRIANGLES]].reshape(-1, 3), gray)
                for first in range(0, len(triangles), MOST_TRIANGLES)
            ]
        return parts

    def _add_mesh(self, corners: FloatArray, gray: float) -> int:
        a, b, c = corners[::3], corners[1::3], corners[2::3]
        normals = np.cross(b - a, c - a)
        # A fan over a side with more than two corners has triangles without area.
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
        client: dict[str, Any] = {"physicsClientId": self._client}
        shape = pybullet.createVisualShape(
            pybullet.GEOM_MESH,
            vertices=corners.tolist(),
            indices=list(range(len(corners))),
            normals=np.repeat(normals, 3, axis=0).tolist(),
            rgbaColor=[gray, gray, gray, 1.0],
            **client,
        )
        return int(pybullet.createMultiBody(baseVisualShapeIndex=shape, **client))

    def _place_movers(self, time_s: float) -> None:
        for mover, parts in zip(self._world.movers, self._parts[1:], strict=True):
            T = self._world.T_world_mover(mover, time_s)
            turn = Rotation.from_matrix(T[:3, :3]).as_quat()
            for part in parts:
                pybullet.resetBasePositionAndOrientation(part, T[:3, 3], turn, physicsClientId=self._client)


def _projection(camera: StereoCamera) -> FloatArray:
    """OpenGL's matrix (4, 4) of a pinhole camera whose pixel centres are at integers, rows downwards."""
    w, h, f = camera.width_px, camera.height_px, camera.focal_px
    depth = -(FAR_M + NEAR_M) / (FAR_M - NEAR_M), -2 * FAR_M * NEAR_M / (FAR_M - NEAR_M)
    return np.array(
        [
            [2 * f / w, 0.0, (w - 1 - 2 * camera.cx_px) / w, 0.0],
            [0.0, 2 * f / h, (2 * camera.cy_px - (h - 1)) / h, 0.0],
            [0.0, 0.0, *depth],
            [0.0, 0.0, -1.0, 0.0],
        ]
    )
