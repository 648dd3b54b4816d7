"""What a pinhole camera sees of a world at one moment, by filling polygons."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from stereogrid.camera import StereoCamera
from stereogrid.geometry import FloatArray, inverse
from stereogrid.observation import FloatImage

from .rays import edge_pixels, pixel_rays
from .shading import Surfaces, shade, shade_some
from .stage import Stage
from .tracing import Faces, Tracer
from .visibility import Outlines, fill, survey

EDGE_CONTRAST = 8.0
"""Fainter edges [gray levels] are left alone: softening them costs time and shows nothing."""

CENTRE = (0.0, 0.0)

Shift = tuple[float, float]


@dataclass(frozen=True)
class Pinhole:
    """A camera at T_world_cam (4, 4); margin_px: how far beside the pixels' centres it will look."""

    camera: StereoCamera
    T_world_cam: FloatArray
    margin_px: float
    stage: Stage
    tracer: Tracer
    surfaces: Surfaces

    @cached_property
    def rays(self) -> FloatArray:
        """(4, 3), see camera_rays."""
        return camera_rays(self.camera, self.T_world_cam)

    @cached_property
    def outlines(self) -> Outlines:
        """What may be seen of all bodies."""
        parts, bodies = [], self.tracer.bodies
        for k, T_world_body in self.stage.poses.items():
            rays = camera_rays(self.camera, inverse(T_world_body) @ self.T_world_cam) if k else self.rays
            span = (bodies.face_starts[k], bodies.face_starts[k + 1])
            image = (*self.camera.shape, self.margin_px)
            parts.append(survey(bodies.shapes, span, (rays, np.linalg.inv(rays[1:])), image))
        return _joined(parts)

    def seen(self, shift: Shift = CENTRE) -> NDArray[np.int32]:
        """The outlined face (H, W) that each pixel sees, looking beside its centre; -1 for none."""
        seen: NDArray[np.int32] = fill(self.outlines, self.camera.shape, shift)
        return seen

    def faces(self, seen: NDArray[np.int32]) -> Faces:
        """The face (H, W) of each outlined one, -1 for none."""
        return np.append(self.outlines.faces, np.int32(-1))[seen]

    def shade(self, seen: NDArray[np.int32], shift: Shift = CENTRE) -> tuple[FloatImage, FloatImage, NDArray[np.int32]]:
        """Brightness (H, W), 0 to 255, depth (H, W) [m] and sight (H, W) of what is seen; see Tracer.trace."""
        shown = (self.outlines.faces, self.outlines.planes)
        gray, depth_m = shade(seen, shown, self.surfaces, self.rays, shift)
        if not self._special.any():
            return gray, depth_m, seen
        row, column = np.nonzero(np.append(self._special, False)[seen])
        bounced, sight = self._bounced((row, column), seen[row, column], gray[row, column], shift), seen.copy()
        gray[row, column], sight[row, column] = bounced
        return gray, depth_m, sight

    def mean(self, shifts: Sequence[Shift]) -> FloatImage:
        """The mean brightness (H, W) of several looks."""
        total: FloatImage = np.zeros(self.camera.shape, np.float32)
        for shift in shifts:
            total += self.shade(self.seen(shift), shift)[0]
        return total / np.float32(len(shifts))

    def soften_edges(self, gray: FloatImage, sight: NDArray[np.int32], shifts: Sequence[Shift]) -> None:
        """Make edges in a picture (H, W) the mean of several looks; those that meet the same face show it as before."""
        row, column = np.nonzero(edge_pixels(sight, gray, EDGE_CONTRAST))
        # The sight of what mirrors is no outlined face: it is looked at again.
        centre, before = sight[row, column], gray[row, column]
        total = np.zeros_like(before)
        for shift in shifts:
            now = self.seen(shift)[row, column]
            other = np.flatnonzero(now != centre)
            total += before
            total[other] += self._shade_some(row[other], column[other], now[other], shift) - before[other]
        gray[row, column] = total / np.float32(len(shifts))

    def _shade_some(
        self, row: NDArray[np.intp], column: NDArray[np.intp], seen: NDArray[np.int32], shift: Shift
    ) -> FloatImage:
        """Brightness (N,) at N pixels, given the outlined face (N,) that each sees."""
        shown = (seen, self.outlines.faces, self.outlines.planes)
        gray: FloatImage = shade_some((row, column), shown, self.surfaces, self.rays, shift)
        if self._special.any():
            some = np.flatnonzero(np.append(self._special, False)[seen])
            gray[some] = self._bounced((row[some], column[some]), seen[some], gray[some], shift)[0]
        return gray

    def _bounced(
        self, places: tuple[NDArray[np.intp], NDArray[np.intp]], seen: NDArray[np.int32], gray: FloatImage, shift: Shift
    ) -> tuple[FloatImage, NDArray[np.int32]]:
        row, column = places
        rays = pixel_rays(self.rays, column, row, shift)
        return self.tracer.bounce(rays, self.outlines.faces[seen], gray, (self.stage, self.surfaces))

    @cached_property
    def _special(self) -> NDArray[np.bool_]:
        return self.tracer.is_special(self.outlines.faces)


def camera_rays(camera: StereoCamera, T_world_cam: FloatArray) -> FloatArray:
    """(4, 3): the eye, then the rows whose sum x * row + y * row + row is the ray of unit depth at pixel (x, y)."""
    right, down, forward = T_world_cam[:3, :3].T
    corner = forward - (camera.cx_px * right + camera.cy_px * down) / camera.focal_px
    return np.array([T_world_cam[:3, 3], right / camera.focal_px, down / camera.focal_px, corner])


def _joined(parts: list[Outlines]) -> Outlines:
    """The outlines of several bodies as one."""
    if len(parts) == 1:
        return parts[0]
    shifts = np.cumsum([0, *(len(part.points) for part in parts)])
    starts = [part.starts[:-1] + shift for part, shift in zip(parts, shifts, strict=False)]
    faces, planes, points = (np.concatenate([part[k] for part in parts]) for k in range(3))
    return Outlines(faces, planes, points, np.append(np.concatenate(starts), shifts[-1]))
