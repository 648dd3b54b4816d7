"""Rendering a world by casting one ray a pixel: image and true depth come from the same rays."""

from dataclasses import dataclass

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from numpy.typing import NDArray

from stereogrid.camera import StereoCamera
from stereogrid.geometry import FloatArray
from stereogrid.observation import FloatImage, Image

from . import shading
from .atlas import Atlas
from .lighting import FacePlanes, Sheets, bake
from .scene import World

SUBPIXELS = np.array([[-0.25, -0.25], [0.25, -0.25], [-0.25, 0.25], [0.25, 0.25]])
"""Edges between faces are the mean of four rays: one ray would leave stairs that left and right do not share."""


EDGE_CONTRAST = 8.0
"""Fainter edges [gray levels] are left alone: softening them costs rays and shows nothing."""


@dataclass(frozen=True)
class View:
    """What one camera sees: gray (H, W) uint8 and true depth z (H, W) float32 [m], NaN where nothing is."""

    gray: Image
    depth_m: FloatImage


class Renderer:
    """A world ready to be photographed. Rendering is a pure function and may run in several threads."""

    def __init__(self, world: World) -> None:
        self._faces = _face_planes(world)
        self._face_of_triangle = world.face_of_triangle
        self._scene = EmbreeScene()
        # Embree keeps no copy of its own of these: they must outlive the scene.
        self._vertices = world.vertices_m.astype(np.float32)
        TriangleMesh(self._scene, self._vertices, world.triangles)
        self._atlas = Atlas.pack(world.textures)
        glows = np.array([world.textures[f.texture].glows for solid in world.solids for f in solid.faces])
        self._sheets: Sheets = bake(self._scene, self._faces, lamps=world.lamps, ambient=world.ambient, glows=glows)
        self._tiles = _tiles(world, self._atlas)

    def view(self, camera: StereoCamera, T_world_cam: FloatArray) -> View:
        """The picture and the depth of a single pinhole camera at T_world_cam (4, 4), an optical frame."""
        rays = _camera_rays(camera, T_world_cam)
        directions = shading.pixel_rays(rays, camera.width_px, camera.height_px)
        faces = self._first_faces(rays[0], directions).reshape(camera.shape)
        scene = (
            shading.project_planes(self._faces.normals, self._faces.offsets, self._faces.axes, rays),
            self._tiles,
            self._sheets.sheets,
            self._atlas.levels,
            self._atlas.texels,
            self._sheets.lights,
        )
        gray, depth_m = shading.shade(faces, *scene)
        pixels = shading.edge_pixels(faces, gray, EDGE_CONTRAST)
        between = shading.subpixel_rays(rays, pixels, SUBPIXELS)
        shading.soften(gray, pixels, SUBPIXELS, self._first_faces(rays[0], between).reshape(-1, 4), *scene)
        return View((np.minimum(gray, 255) + 0.5).astype(np.uint8), depth_m)

    def _first_faces(self, eye_m: FloatArray, directions: NDArray[np.float32]) -> NDArray[np.int32]:
        """The face (N,) that each ray (N, 3) from the eye meets first, -1 for none."""
        origins = np.empty_like(directions)
        origins[:] = eye_m.astype(np.float32)
        triangles = self._scene.run(origins, directions, query="INTERSECT")
        faces: NDArray[np.int32] = shading.faces_of(triangles, self._face_of_triangle)
        return faces


def _camera_rays(camera: StereoCamera, T_world_cam: FloatArray) -> FloatArray:
    """(4, 3): the eye, then the rows whose sum x * row + y * row + row is the ray of unit depth at pixel (x, y)."""
    right, down, forward = T_world_cam[:3, :3].T
    corner = forward - (camera.cx_px * right + camera.cy_px * down) / camera.focal_px
    return np.array([T_world_cam[:3, 3], right / camera.focal_px, down / camera.focal_px, corner])


def _face_planes(world: World) -> FacePlanes:
    faces = [f for solid in world.solids for f in solid.faces]
    axes = np.array([(f.s_axis, f.t_axis) for f in faces])
    # The texture's s points right and t down, seen from outside: their cross product points inwards.
    normals = -np.cross(axes[:, 0], axes[:, 1])
    corners = [world.vertices_m[list(c)] for c in world.face_corners]
    offsets = np.array([float(points[0] @ n) for points, n in zip(corners, normals, strict=True)])
    flat = [points @ a.T for points, a in zip(corners, axes, strict=True)]
    return FacePlanes(normals, offsets, axes, np.array([(st.min(axis=0), st.max(axis=0)) for st in flat]))


def _tiles(world: World, atlas: Atlas) -> FloatArray:
    """(F, 6): texture origin s, t [m]; tiles per metre along s, t; first and last level in the atlas."""
    rows = []
    for face in (f for solid in world.solids for f in solid.faces):
        width_m, height_m = face.size_m or world.textures[face.texture].size_m
        rows.append((*face.origin_m, 1 / width_m, 1 / height_m, *atlas.spans[face.texture]))
    return np.array(rows)
