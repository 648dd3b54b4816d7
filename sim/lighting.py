"""Light baked once a world: on every face a grid of brightness from the lamps, their shadows and the corners' gloom."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stereogrid.geometry import FloatArray

from .scene import Lamp

TEXEL_M = 0.10
GLOOM_M = 0.5
"""How far a surface darkens its neighbours [m]."""
AMBIENT_RAYS = 32
LAMP_REACH_M = 7.0
EXPOSURE = 0.95


@dataclass(frozen=True)
class Sheets:
    """lights: flat float32 factors on the texture's brightness. sheets (F, 7): start, columns, rows, s0, t0 [m],
    texels per metre along s and t."""

    lights: NDArray[np.float32]
    sheets: FloatArray


@dataclass(frozen=True)
class FacePlanes:
    """The F faces as planes: normals (F, 3), offsets (F,), axes (F, 2, 3), bounds (F, 2, 2) [m]: low, high by s, t."""

    normals: FloatArray
    offsets: FloatArray
    axes: FloatArray
    bounds: FloatArray


def bake(
    embree_scene: Any, planes: FacePlanes, *, lamps: tuple[Lamp, ...], ambient: float, glows: FloatArray
) -> Sheets:
    """Light on every face: ambient light dimmed by what is near, and the lamps with their shadows.

    glows (F,) bool: faces that are lamps themselves. The directions are the same everywhere, so that the light
    is smooth and needs no random numbers.
    """
    sheets, points, normals, owner = _grid(planes)
    # Off the surface, or float32 rays would meet the face they start from.
    origins = (points + 2e-3 * normals).astype(np.float32)
    light = ambient * _openness(embree_scene, origins, normals)
    for lamp in lamps:
        light += _lamp_light(embree_scene, lamp, origins, normals)
    # Eyes and cameras compress: a soft shoulder, then the square root that textures are stored in.
    shown = EXPOSURE * np.sqrt(light / (0.75 + 0.25 * light))
    shown[glows[owner]] = 1.0
    return Sheets(shown.astype(np.float32), sheets)


def _grid(planes: FacePlanes) -> tuple[FloatArray, FloatArray, FloatArray, NDArray[np.intp]]:
    """The sheets, and for every texel its point (N, 3), normal (N, 3) and face (N,)."""
    low, size = planes.bounds[:, 0], planes.bounds[:, 1] - planes.bounds[:, 0]
    counts = np.maximum(np.ceil(size / TEXEL_M).astype(np.int64), 2)
    starts = np.concatenate([[0], np.cumsum(counts.prod(axis=1))])
    sheets = np.column_stack([starts[:-1], counts, low, counts / size])
    owner = np.repeat(np.arange(len(counts)), counts.prod(axis=1))
    k = np.arange(starts[-1]) - starts[owner]
    cell = np.stack([k % counts[owner, 0], k // counts[owner, 0]], axis=1)
    st = low[owner] + (cell + 0.5) * (size / counts)[owner]
    normals = planes.normals[owner]
    points = np.einsum("na,nak->nk", st, planes.axes[owner]) + planes.offsets[owner, None] * normals
    return sheets, points, normals, owner


def _openness(embree_scene: Any, origins: NDArray[np.float32], normals: FloatArray) -> FloatArray:
    """How little stands close by, 0 to 1, weighted by the cosine: smooth ambient occlusion."""
    tangent = np.cross(normals, np.where(np.abs(normals[:, 2:]) < 0.9, [[0.0, 0.0, 1.0]], [[0.0, 1.0, 0.0]]))
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    bitangent = np.cross(normals, tangent)
    total = np.zeros(len(origins))
    for k in range(AMBIENT_RAYS):
        # Fibonacci points on the disc, lifted to the sphere, are distributed as the cosine.
        radius, angle = np.sqrt((k + 0.5) / AMBIENT_RAYS), k * np.pi * (3 - np.sqrt(5))
        a, b, c = radius * np.cos(angle), radius * np.sin(angle), np.sqrt(1 - radius**2)
        ray = (a * tangent + b * bitangent + c * normals).astype(np.float32)
        distance = embree_scene.run(origins, ray, query="DISTANCE")
        total += 1 - np.exp(-distance.astype(np.float64) / GLOOM_M)
    return total / AMBIENT_RAYS


def _lamp_light(embree_scene: Any, lamp: Lamp, origins: NDArray[np.float32], normals: FloatArray) -> FloatArray:
    """The light of one lamp on every point, from the four quarters of its face, each with its shadow."""
    light = np.zeros(len(origins))
    center = np.array(lamp.center_m) - [0, 0, 0.01]
    for i, j in ((-1, -1), (-1, 1), (1, -1), (1, 1)):
        quarter = center + np.array([i * lamp.size_m[0] / 4, j * lamp.size_m[1] / 4, 0])
        away = quarter - origins
        distance = np.linalg.norm(away, axis=1)
        cosines = (away * normals).sum(axis=1) / distance * away[:, 2] / distance
        near = np.flatnonzero((cosines > 0) & (away[:, 2] > 0) & (distance < LAMP_REACH_M))
        ray = (away[near] / distance[near, None]).astype(np.float32)
        free = embree_scene.run(origins[near], ray, query="DISTANCE") > distance[near] - 0.02
        light[near] += lamp.power * free * cosines[near] / (0.3 + distance[near] ** 2)
    return light
