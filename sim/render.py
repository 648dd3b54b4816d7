"""Rendering a world: the face that each pixel sees, its texture and light, and its depth, all from the same planes."""

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
from .visibility import first_faces

SUBPIXELS = ((-0.25, -0.25), (0.25, -0.25), (-0.25, 0.25), (0.25, 0.25))
"""Edges between faces are the mean of four looks: one would leave stairs that left and right do not share."""

EDGE_CONTRAST = 8.0
"""Fainter edges [gray levels] are left alone: softening them costs time and shows nothing."""


@dataclass(frozen=True)
class View:
    """What one camera sees: gray (H, W) uint8 and true depth z (H, W) float32 [m], NaN where nothing is."""

    gray: Image
    depth_m: FloatImage


class Renderer:
    """A world ready to be photographed. Rendering is a pure function and may run in several threads."""

    def __init__(self, world: World) -> None:
        self._vertices_m = world.vertices_m
        self._corners = np.concatenate(world.face_corners)
        self._starts = np.cumsum([0, *(len(corners) for corners in world.face_corners)])
        self._faces = _face_planes(world)
        atlas = Atlas.pack(world.textures)
        sheets = _lit(world, self._faces)
        self._surfaces = shading.Surfaces(
            _tiles(world, atlas), sheets.sheets, sheets.lights, atlas.levels, atlas.texels
        )

    def faces(self, camera: StereoCamera, T_world_cam: FloatArray) -> NDArray[np.int32]:
        """The face (H, W) of the world that each pixel sees, -1 for none; see `view`."""
        return self._visible(_camera_rays(camera, T_world_cam), camera.shape)[0]

    def view(self, camera: StereoCamera, T_world_cam: FloatArray) -> View:
        """The picture and the depth of a single pinhole camera at T_world_cam (4, 4), an optical frame."""
        rays = _camera_rays(camera, T_world_cam)
        faces, planes = self._visible(rays, camera.shape)
        gray, depth_m = shading.shade(faces, planes, self._surfaces)
        edges = shading.edge_pixels(faces, gray, EDGE_CONTRAST)
        soft = np.zeros_like(gray)
        for dx, dy in SUBPIXELS:
            shifted = rays + [[0.0], [0.0], [0.0], [1.0]] * (dx * rays[1] + dy * rays[2])
            faces, planes = self._visible(shifted, camera.shape)
            soft += shading.shade(np.where(edges, faces, np.int32(-1)), planes, self._surfaces)[0]
        gray[edges] = soft[edges] / len(SUBPIXELS)
        return View((np.minimum(gray, 255) + 0.5).astype(np.uint8), depth_m)

    def _visible(self, rays: FloatArray, shape: tuple[int, int]) -> tuple[NDArray[np.int32], FloatArray]:
        """The face (H, W) that each pixel sees, -1 for none, and the planes of all faces as shading wants them."""
        planes: FloatArray = shading.project_planes(self._faces.normals, self._faces.offsets, self._faces.axes, rays)
        # einsum, unlike matmul, sums in the same order on any number of threads.
        points = np.einsum("va,ab->vb", self._vertices_m - rays[0], np.linalg.inv(rays[1:]))
        faces: NDArray[np.int32] = first_faces(points, self._corners, self._starts, planes, shape)
        return faces, planes


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


def _lit(world: World, faces: FacePlanes) -> Sheets:
    scene = EmbreeScene()
    # Embree keeps no copy of its own of these: they must outlive the scene.
    vertices = world.vertices_m.astype(np.float32)
    TriangleMesh(scene, vertices, world.triangles)
    glows = np.array([world.textures[f.texture].glows for solid in world.solids for f in solid.faces])
    return bake(scene, faces, lamps=world.lamps, ambient=world.ambient, glows=glows)


def _tiles(world: World, atlas: Atlas) -> FloatArray:
    """(F, 6): texture origin s, t [m]; tiles per metre along s, t; first and last level in the atlas."""
    rows = []
    for face in (f for solid in world.solids for f in solid.faces):
        width_m, height_m = face.size_m or world.textures[face.texture].size_m
        rows.append((*face.origin_m, 1 / width_m, 1 / height_m, *atlas.spans[face.texture]))
    return np.array(rows)
