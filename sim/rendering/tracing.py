"""Casting rays of any kind through a world at one moment, one bounce on what is glossy or clear included."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from stereogrid.geometry import FloatArray, inverse
from stereogrid.observation import FloatImage

from .casting import Target
from .rays import OFF_M, mirror_rays, rays_near
from .shading import Rays, Surfaces, shade_rays
from .shapes import Bodies
from .stage import Stage
from .vectors import placed, turned

Faces = NDArray[np.int32]

PRIMES = (7919, 104729, 15485863)
"""Faces seen at once are mixed to one number by these."""


@dataclass(frozen=True)
class Tracer:
    """targets, opaque: of each body all faces, and those that are not clear. gloss, clear (F,): see Texture.

    hulls: balls (4,) round the moving bodies, from the first on, in their frames: middle and radius [m].
    """

    bodies: Bodies
    targets: Sequence[Target]
    opaque: Sequence[Target]
    gloss: FloatArray
    clear: NDArray[np.bool_]
    hulls: Sequence[FloatArray]

    def trace(self, rays: Rays, stage: Stage, surfaces: Surfaces) -> tuple[FloatImage, FloatArray, Faces, Faces]:
        """Brightness (N,) 0 to 255, depth (N,) in lengths of the directions, face (N,) and sight (N,) of each ray.

        The sight is a number that differs where the face does, or what is mirrored in it or seen through it.
        """
        faces = self._first(self.targets, rays.apex, rays.direction, stage)
        gray, depth = self._shade(rays, faces, stage, surfaces)
        special = np.flatnonzero(self.is_special(faces))
        if len(special):
            some = Rays(*(np.ascontiguousarray(part[special]) for part in rays))
            sight = faces.copy()
            gray[special], sight[special] = self.bounce(some, faces[special], gray[special], (stage, surfaces))
            return gray, depth, faces, sight
        return gray, depth, faces, faces

    def is_special(self, faces: Faces) -> NDArray[np.bool_]:
        """Whether faces (...), -1 for none, show more than themselves."""
        special: NDArray[np.bool_] = np.append((self.gloss > 0) | self.clear, False)[faces]
        return special

    def bounce(
        self, rays: Rays, faces: Faces, gray: FloatImage, at: tuple[Stage, Surfaces]
    ) -> tuple[FloatImage, Faces]:
        """Brightness (N,) of special faces that rays meet, given their own: with what they mirror and let through.
        And the sight (N,), below -1; see trace.

        Of glass the texture is dirt: it shines by itself, and hides what is behind as far as it does.
        """
        stage, surfaces = at
        normals, offsets = self.planes(faces, stage)
        mirrored, start, share = mirror_rays(rays, normals, offsets, self.gloss[faces])
        clear = np.flatnonzero(self.clear[faces])
        own, sight = gray.astype(np.float64), PRIMES[0] * faces.astype(np.int64)
        if len(clear):
            through = Rays(*(np.ascontiguousarray(part[clear]) for part in rays))
            side = np.sign((normals[clear] * through.direction).sum(axis=1, keepdims=True))
            behind = start[clear] + 2 * OFF_M * side * normals[clear]
            second = self._first(self.opaque, behind, through.direction, stage)
            own[clear] += (1 - np.minimum(own[clear] / 255, 1)) * self._shade(through, second, stage, surfaces)[0]
            sight[clear] += PRIMES[1] * second
        second = self._first(self.opaque, start, mirrored.direction, stage)
        seen = self._shade(mirrored, second, stage, surfaces)[0].astype(np.float64)
        sight += PRIMES[2] * second
        # Light adds up as light; brightness is its square root.
        gray = np.sqrt((1 - share) * own**2 + share * seen**2).astype(np.float32)
        return gray, (-2 - sight % (1 << 30)).astype(np.int32)

    def planes(self, faces: Faces, stage: Stage) -> tuple[FloatArray, FloatArray]:
        """Normals (N, 3) and offsets (N,) of faces >= 0, in world."""
        normals, offsets = self.bodies.shapes.normals[faces], self.bodies.shapes.offsets[faces]
        for k, mine in self._moving(faces, stage):
            T = stage.poses[k]
            normals[mine] = turned(normals[mine], T)
            offsets[mine] += (normals[mine] * T[:3, 3]).sum(axis=1)
        return normals, offsets

    def _moving(self, faces: Faces, stage: Stage) -> list[tuple[int, NDArray[np.intp]]]:
        """The moving bodies that some of the faces (N,) belong to, with the places of these."""
        if len(stage.poses) == 1:
            return []
        starts = self.bodies.face_starts
        found = ((k, np.flatnonzero((faces >= starts[k]) & (faces < starts[k + 1]))) for k in stage.poses if k)
        return [(k, mine) for k, mine in found if len(mine)]

    def _first(self, targets: Sequence[Target], start: FloatArray, direction: FloatArray, stage: Stage) -> Faces:
        """The face (N,) that rays from `start` meet first, -1 for none."""
        faces = targets[0].first_faces(start, direction)
        for k, T_world_body in stage.poses.items():
            if k:
                hull = self.hulls[k - 1]
                near = rays_near(start, direction, np.append(placed(hull[None, :3], T_world_body)[0], hull[3]))
                T = inverse(T_world_body)
                origins, along = placed(start[near], T), turned(direction[near], T)
                found = targets[k].first_faces(origins, along)
                hit = np.flatnonzero(found >= 0)
                ray = near[hit]
                before = self._from(start[ray], direction[ray], faces[ray], stage)
                nearer = self._from(start[ray], direction[ray], found[hit], stage) < before
                faces[ray[nearer]] = found[hit[nearer]]
        return faces

    def _from(self, start: FloatArray, direction: FloatArray, faces: Faces, stage: Stage) -> FloatArray:
        """How far (N,) rays go to their faces, infinitely for -1."""
        distance = np.full(len(faces), np.inf)
        hit = np.flatnonzero(faces >= 0)
        normals, offsets = self.planes(faces[hit], stage)
        along = (normals * direction[hit]).sum(axis=1)
        distance[hit] = (offsets - (normals * start[hit]).sum(axis=1)) / along
        return distance

    def _shade(self, rays: Rays, faces: Faces, stage: Stage, surfaces: Surfaces) -> tuple[FloatImage, FloatArray]:
        moving = self._moving(faces, stage)
        if moving:
            rays = Rays(*(part.copy() for part in rays))
            for k, mine in moving:
                T = inverse(stage.poses[k])
                rays.apex[mine] = placed(rays.apex[mine], T)
                for part in rays[1:]:
                    part[mine] = turned(part[mine], T)
        gray, depth = shade_rays(rays, faces, self.bodies.shapes, surfaces)
        return gray, depth
