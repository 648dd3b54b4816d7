"""Rendering a world: the face that each pixel sees, its texture and light, and its depth, all from the same planes."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stereogrid.camera import StereoCamera
from stereogrid.errors import InvalidInputError
from stereogrid.geometry import FloatArray, as_floats
from stereogrid.observation import FloatImage, Image

from ..scene.scene import World
from ..scene.textures import Texture
from .atlas import Atlas
from .casting import Target
from .lighting import bake
from .pinhole import EDGE_CONTRAST, Pinhole, camera_rays
from .rays import edge_pixels, pixel_points
from .shading import Rays, Surfaces
from .shadows import Shadows, silhouette
from .shapes import Actor, Bodies, gather
from .sky import sky_numbers
from .stage import Stage, light_moving, poses_at
from .tracing import Tracer

EDGE_LOOKS = ((-0.25, -0.25), (0.25, -0.25), (-0.25, 0.25), (0.25, 0.25))
"""Edges between faces are the mean of four looks: one would leave stairs that left and right do not share."""

KEPT_STAGES = 4

Supersampling = Literal["edges"] | int
"""How often a pixel is looked at: at edges, or n times along each side of every pixel; 1 is a single look."""

NOBODY: Mapping[str, FloatArray] = MappingProxyType({})


@dataclass(frozen=True)
class View:
    """What one camera sees: gray (H, W) uint8, true depth z (H, W) float32 [m], NaN where nothing is, and the face
    (H, W) int32 that each pixel's centre sees, -1 for none: see Renderer.objects and Renderer.normals."""

    gray: Image
    depth_m: FloatImage
    faces: NDArray[np.int32]


@dataclass(frozen=True)
class Hits:
    """What N rays meet: gray (N,) float32, 0 to 255; depth (N,) in lengths of their directions, NaN for none; the
    face (N,) int32, -1 for none."""

    gray: FloatImage
    depth: FloatArray
    faces: NDArray[np.int32]


class Renderer:
    """A world ready to be photographed. Rendering is a pure function and may run in several threads.

    actors: bodies that are drawn where `actors_at` of a view says, and left out of it otherwise. Faces are numbered
    through the world's solids, then through its movers, then through the actors.
    """

    def __init__(self, world: World, *, actors: Sequence[Actor] = ()) -> None:
        self._world, self._actors = world, tuple(actors)
        bodies = gather(world, self._actors)
        textures = _textures(world, self._actors)
        atlas = Atlas.pack(textures)
        looks = [textures[face.texture] for face in bodies.faces]
        moving = [*(mover.solids for mover in world.movers), *(actor.solids for actor in self._actors)]
        silhouettes = [silhouette(solids) for solids in moving]
        self._tracer = _tracer(bodies, looks, [s.hull for s in silhouettes])
        sheets, self._own_lights = bake(world, bodies, self._tracer.opaque, np.array([look.glows for look in looks]))
        self._shadows = Shadows(world, bodies, silhouettes, self._tracer.opaque[1:])
        self._stages: dict[bytes, Stage] = {}
        self._surfaces = Surfaces(
            _tiles(bodies, textures, atlas),
            sheets.sheets,
            sheets.lights,
            atlas.levels,
            atlas.texels,
            sky_numbers(world, atlas),
        )

    def faces(self, camera: StereoCamera, T_world_cam: FloatArray, *, time_s: float = 0.0) -> NDArray[np.int32]:
        """The face (H, W) of the world that each pixel sees, -1 for none; see `view`."""
        pinhole = self._pinhole((camera, T_world_cam), self._stage(time_s, NOBODY), [(0.0, 0.0)])
        return pinhole.faces(pinhole.seen())

    def view(
        self,
        camera: StereoCamera,
        T_world_cam: FloatArray,
        *,
        time_s: float = 0.0,
        supersampling: Supersampling = "edges",
        actors_at: Mapping[str, FloatArray] = NOBODY,
    ) -> View:
        """The picture and the depth of a single pinhole camera at T_world_cam (4, 4), an optical frame.

        time_s: where the world's movers are. actors_at: pose T_world_actor (4, 4) of each actor that is there.
        Depth is that of the first surface, even if it is glass and the picture shows what is behind.
        """
        shifts = _shifts(supersampling)
        pinhole = self._pinhole((camera, T_world_cam), self._stage(time_s, actors_at), shifts)
        seen = pinhole.seen()
        gray, depth_m, sight = pinhole.shade(seen)
        if supersampling == "edges":
            pinhole.soften_edges(gray, sight, shifts)
        elif supersampling > 1:
            gray = pinhole.mean(shifts)
        faces = pinhole.faces(seen)
        if len(pinhole.stage.poses) > 1:
            points, lit = pixel_points(depth_m, pinhole.rays), (pinhole.stage.poses, pinhole.surfaces)
            gray = self._shadows.dimmed(gray.ravel(), points, faces.ravel(), lit).reshape(camera.shape)
        return View(_bytes(gray), depth_m, faces)

    def view_rows(
        self,
        camera: StereoCamera,
        T_world_cam: FloatArray,
        *,
        time_s: float = 0.0,
        supersampling: Supersampling = "edges",
        actors_at: Mapping[str, FloatArray] = NOBODY,
    ) -> View:
        """The picture of a rolling shutter, whose row y is seen from T_world_cam[y]: poses (H, 4, 4).

        Depth is along each row's own axis. Several times as slow as `view`: every pixel is a cast ray.
        """
        if np.shape(T_world_cam) != (camera.height_px, 4, 4):
            raise InvalidInputError(f"T_world_cam must be ({camera.height_px}, 4, 4), not {np.shape(T_world_cam)}")
        stage, shifts = self._stage(time_s, actors_at), _shifts(supersampling)
        rows = np.array([camera_rays(camera, T) for T in T_world_cam])
        y, x = (grid.ravel() for grid in np.indices(camera.shape))
        hits, sight = self._trace(_row_rays(rows, x, y, (0.0, 0.0)), stage)
        gray, sight = hits.gray.reshape(camera.shape), sight.reshape(camera.shape)
        if len(shifts) > 1:
            edges = edge_pixels(sight, gray, EDGE_CONTRAST) if supersampling == "edges" else np.ones_like(sight, bool)
            y, x = np.nonzero(edges)
            looks = [self._trace(_row_rays(rows, x, y, shift), stage)[0].gray for shift in shifts]
            gray[edges] = sum(looks) / np.float32(len(looks))
        depth_m = hits.depth.reshape(camera.shape).astype(np.float32)
        return View(_bytes(gray), depth_m, hits.faces.reshape(camera.shape))

    def trace(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
        *,
        pixel: tuple[ArrayLike, ArrayLike] | None = None,
        time_s: float = 0.0,
        actors_at: Mapping[str, FloatArray] = NOBODY,
    ) -> Hits:
        """What rays from origins (N, 3) along directions (N, 3), in world, meet.

        pixel: how much the direction changes one pixel to the right and one down, (N, 3) or (3,) each: textures are
        filtered to that; by default not at all. Depth is right to 1e-6 of itself; so is what is mirrored.
        """
        o, d = as_floats(origins), as_floats(directions)
        if o.ndim != 2 or o.shape[1] != 3 or o.shape != d.shape:
            raise InvalidInputError(f"origins and directions must be (N, 3) both, not {o.shape} and {d.shape}")
        a, b = (np.broadcast_to(as_floats(step), o.shape) for step in (pixel or (np.zeros(3), np.zeros(3))))
        rays = Rays(*(np.ascontiguousarray(part) for part in (o, d, a, b)))
        return self._trace(rays, self._stage(time_s, actors_at))[0]

    def normals(
        self, faces: NDArray[np.int32], *, time_s: float = 0.0, actors_at: Mapping[str, FloatArray] = NOBODY
    ) -> FloatImage:
        """Outward unit normals (..., 3) float32 in world of the faces (...) of a View, NaN for none.

        time_s, actors_at: those of the view. Of uneven ground they are its triangles'.
        """
        normals = np.full((*faces.shape, 3), np.nan, np.float32)
        there = faces >= 0
        normals[there] = self._tracer.planes(faces[there], self._stage(time_s, actors_at))[0]
        return normals

    @cached_property
    def object_names(self) -> tuple[str, ...]:
        """The world's solids, then its movers, then the actors, by name."""
        return (
            *(solid.name for solid in self._world.solids),
            *(mover.name for mover in self._world.movers),
            *(actor.name for actor in self._actors),
        )

    @cached_property
    def object_of_face(self) -> NDArray[np.int32]:
        """(F,) the number, an index into `object_names`, of the object that each face belongs to."""
        bodies = self._tracer.bodies
        moving = len(self._world.solids) + bodies.body_of_face - 1
        return np.where(bodies.body_of_face == 0, bodies.solid_of_face, moving).astype(np.int32)

    def objects(self, faces: NDArray[np.int32]) -> NDArray[np.int32]:
        """The number, an index into `object_names`, of the object that each face (...) belongs to, -1 for none."""
        return np.where(faces < 0, np.int32(-1), self.object_of_face[faces])

    def _pinhole(
        self, eye: tuple[StereoCamera, FloatArray], stage: Stage, shifts: Sequence[tuple[float, float]]
    ) -> Pinhole:
        margin_px = max(max(map(abs, shift)) for shift in shifts)
        return Pinhole(*eye, margin_px, stage, self._tracer, self._surfaces._replace(lights=stage.lights))

    def _trace(self, rays: Rays, stage: Stage) -> tuple[Hits, NDArray[np.int32]]:
        surfaces = self._surfaces._replace(lights=stage.lights)
        gray, depth, faces, sight = self._tracer.trace(rays, stage, surfaces)
        if len(stage.poses) > 1:
            points = rays.apex + depth[:, None] * rays.direction
            gray = self._shadows.dimmed(gray, points, faces, (stage.poses, surfaces))
        return Hits(gray, depth, faces), sight

    def _stage(self, time_s: float, actors_at: Mapping[str, FloatArray]) -> Stage:
        poses = poses_at(self._world, self._actors, time_s, actors_at)
        if len(poses) == 1:
            return Stage(poses, self._surfaces.lights)
        key = b"".join(k.to_bytes(4, "big") + pose.tobytes() for k, pose in poses.items())
        stage = self._stages.get(key)
        if stage is None:
            moving = light_moving(self._world, self._tracer.opaque, self._own_lights, poses)
            stage = Stage(poses, np.concatenate([self._surfaces.lights[: -len(moving)], moving]))
            # Left and right look at the same moment: it is kept for a while. What it holds depends on its key alone.
            self._stages = {**dict(list(self._stages.items())[1 - KEPT_STAGES :]), key: stage}
        return stage


def _bytes(gray: FloatImage) -> Image:
    return (np.minimum(gray, 255) + 0.5).astype(np.uint8)


def _shifts(supersampling: Supersampling) -> tuple[tuple[float, float], ...]:
    """Where in a pixel it is looked, beside its centre [px]."""
    if supersampling == "edges":
        return EDGE_LOOKS
    if not isinstance(supersampling, int) or not 1 <= supersampling <= 8:
        raise InvalidInputError(f"supersampling must be 'edges' or 1 to 8, not {supersampling!r}")
    steps = [float(s) for s in (np.arange(supersampling) + 0.5) / supersampling - 0.5]
    return tuple((dx, dy) for dy in steps for dx in steps)


def _row_rays(rows: FloatArray, x: NDArray[np.intp], y: NDArray[np.intp], shift: tuple[float, float]) -> Rays:
    """The rays at N pixels of a picture whose rows have cameras (H, 4, 3) of their own."""
    eye, across, down, corner = np.moveaxis(rows[y], 1, 0)
    directions = (x + shift[0])[:, None] * across + (y + shift[1])[:, None] * down + corner
    return Rays(*(np.ascontiguousarray(part) for part in (eye, directions, across, down)))


def _tracer(bodies: Bodies, looks: Sequence[Texture], hulls: Sequence[FloatArray]) -> Tracer:
    body, clear = bodies.body_of_face, np.array([look.clear for look in looks])
    opaque, targets = [], []
    for k in range(len(bodies.face_starts) - 1):
        opaque.append(Target(bodies, (body == k) & ~clear))
        targets.append(Target(bodies, body == k) if clear[body == k].any() else opaque[-1])
    return Tracer(bodies, targets, opaque, np.array([look.gloss for look in looks]), clear, hulls)


def _textures(world: World, actors: Sequence[Actor]) -> dict[str, Texture]:
    textures = dict(world.textures)
    for actor in actors:
        for name, texture in actor.textures.items():
            if textures.setdefault(name, texture) is not texture:
                raise InvalidInputError(f"the actor {actor.name!r} brings a second texture named {name!r}")
    return textures


def _tiles(bodies: Bodies, textures: Mapping[str, Texture], atlas: Atlas) -> FloatArray:
    """(F, 6): texture origin s, t [m]; tiles per metre along s, t; first and last level in the atlas."""
    rows = []
    for face in bodies.faces:
        width_m, height_m = face.size_m or textures[face.texture].size_m
        rows.append((*face.origin_m, 1 / width_m, 1 / height_m, *atlas.spans[face.texture]))
    return np.array(rows)
