"""How a page begins: what it offers, and from where one looks."""

from typing import Any

import numpy as np

from ..geometry import FloatArray
from ..mapped import ABOVE_CAMERA_M
from .cell_blocks import CellBlocks
from .controls import Offers
from .scene import MapScene
from .subject import Subject

REPLAY_S = 15.0
"""A replay takes so long at first."""
CAMERAS = 12
"""Frustums along the path, at most."""
AROUND_M = 3.0
"""Heights offered above and below the path while the map is not yet made."""


def lay_out(server: Any, subject: Subject, cells: CellBlocks | None) -> tuple[MapScene, Offers]:
    """The scene, without cells yet, and what the controls offer. cells: of the first map, None while there is none."""
    path_m = subject.poses[np.isfinite(subject.poses).all(axis=(1, 2)), :3, 3]
    ends_m = _ends_m(subject, path_m, cells)
    camera = subject.recording.camera if subject.recording is not None else None
    size_m = float(np.linalg.norm(ends_m[1, :2] - ends_m[0, :2]))
    scene = MapScene(server, camera, fade_m=max(20.0, 4 * size_m))
    scene.look_from(*_first_look(subject.poses, ends_m))
    highest_m = float(np.median(path_m[:, 2])) + ABOVE_CAMERA_M if len(path_m) else float(ends_m[1, 2])
    return scene, Offers(
        colours=_colours(subject),
        ends_m=ends_m.tolist(),
        heights_m=(float(ends_m[0, 2]), min(highest_m, float(ends_m[1, 2]))),
        maps=tuple(subject.maps),
        observations=len(subject.poses),
        rate=max(1.0, len(subject.poses) / REPLAY_S) if subject.replays else None,
        truth=subject.knows_truth,
    )


def _colours(subject: Subject) -> tuple[str, ...]:
    age, errors = ("age",) if subject.replays else (), ("errors",) if subject.judges else ()
    return ("height", "probability", *age, *errors)


def _ends_m(subject: Subject, path_m: FloatArray, cells: CellBlocks | None) -> FloatArray:
    """Lower and upper corner (2, 3) [m] of what there is, or will be."""
    if cells is not None and len(cells.indices):
        ends_m = cells.ends_m()
        if len(path_m):
            ends_m = np.stack([np.minimum(ends_m[0], path_m.min(axis=0)), np.maximum(ends_m[1], path_m.max(axis=0))])
        return ends_m
    range_m = subject.config.model.max_range_m if subject.config is not None else AROUND_M
    if not len(path_m):
        return np.array([[-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]]) * AROUND_M
    reach = np.array([range_m, range_m, AROUND_M])
    return np.stack([path_m.min(axis=0) - reach, path_m.max(axis=0) + reach])


def _first_look(poses: FloatArray, ends_m: FloatArray) -> tuple[list[float], list[float]]:
    """From behind where the camera began, or from a corner, above; the whole map in sight."""
    middle = ends_m.mean(axis=0)
    size_m = max(float(np.linalg.norm(ends_m[1, :2] - ends_m[0, :2])), 1.0)
    ahead = np.array([1.0, 0.45])
    if len(poses) and np.isfinite(poses[0]).all() and np.linalg.norm(poses[0, :2, 2]) > 0.1:
        forward = poses[0, :2, 2] / np.linalg.norm(poses[0, :2, 2])
        ahead = forward + 0.45 * np.array([-forward[1], forward[0]])
    ahead /= np.linalg.norm(ahead)
    position = middle + np.array([*(-0.55 * size_m * ahead), 0.55 * size_m])
    return position.tolist(), middle.tolist()
