"""RGB-D recordings in the layout of 7-Scenes and of tsdf-fusion: three files a frame."""

import re
from collections import Counter
from pathlib import Path

import numpy as np

from ..errors import RecordingError
from ..geometry import FloatArray
from ..textrows import floats, rows_of_words
from .images import picture_size
from .rgbd_files import RgbdFiles, RgbdFrame, find_lens, no_lens, read_pose_file

PATTERN = "frame-*.depth.png"
RATE_HZ = 30
PER_M = 1000.0
_NUMBER = re.compile(r"frame-(\d{1,9})\.depth\.png")
_COLOURS = ("color.png", "color.jpg")


def is_frames(folder: Path) -> bool:
    """Whether a folder holds depth images of this layout."""
    try:
        return next(folder.glob(PATTERN), None) is not None
    except OSError:  # a closed folder
        return False


def read_frames(folder: Path) -> RgbdFiles:
    """frame-XXXXXX.depth.png [mm], .color.png or .jpg, .pose.txt (camera to world) and camera-intrinsics.txt.

    The frames are numbered at RATE_HZ. Where some have colours, those without are left out; where none has, all stay.
    Raises RecordingError, naming the file, for a pose that is none, or when there is no frame with a pose.
    """
    depths = {int(found[1]): path for path in folder.glob(PATTERN) if (found := _NUMBER.fullmatch(path.name))}
    if not depths:
        raise RecordingError(f"{folder}: no frame-XXXXXX.depth.png")
    colours = {number: _colour(path) for number, path in depths.items()}
    without = not any(colours.values())
    left_out: Counter[str] = Counter()
    frames = []
    for number, depth in sorted(depths.items()):
        pose = _beside(depth, "pose.txt")
        if colours[number] is None and not without:
            left_out["depth images without a colour image"] += 1
        elif not pose.is_file():
            left_out["depth images without a pose"] += 1
        elif _is_lost(pose):
            left_out["depth images whose pose is not finite: the camera was lost"] += 1
        else:
            stamp_ns = number * 10**9 // RATE_HZ
            frames.append(RgbdFrame(stamp_ns, depth, colours[number], read_pose_file(pose)))
    left_out["colour images without a depth image"] += _lone_colours(folder)
    if not frames:
        raise RecordingError(f"{folder}: no frame has a depth image and a pose: " + _counted(left_out))
    lens = find_lens(folder)
    if lens is None:
        raise no_lens(folder)
    return RgbdFiles("7-Scenes", frames, PER_M, lens, picture_size(frames[0].depth), +left_out)


def upright(T_file_cam: FloatArray) -> FloatArray:
    """The rotation (3, 3) that makes z up of a world that is turned anyhow; T_file_cam (M, 4, 4) are the poses in it.

    Whoever carries a camera holds it level, sometimes better, sometimes worse, and turns about the vertical: up is the
    direction that the cameras' x axes come least near to. Where they turned by too little for that, it is the mean of
    their upward axes. x is the file's z, forward of the first camera, made level.
    """
    right, up = T_file_cam[:, :3, 0], -T_file_cam[:, :3, 1].mean(axis=0)
    spread, axes = np.linalg.eigh(right.T @ right / len(right))
    if spread[1] > max(4 * spread[0], LEAST_TURN**2):
        up = axes[:, 0] if axes[:, 0] @ up > 0 else -axes[:, 0]
    up /= np.linalg.norm(up)
    forward = T_file_cam[0, :3, 2] - (T_file_cam[0, :3, 2] @ up) * up
    if np.linalg.norm(forward) < 0.1:  # the first camera looked straight up or down
        forward = np.cross(T_file_cam[0, :3, 0], -up)
    forward /= np.linalg.norm(forward)
    return np.stack([forward, np.cross(up, forward), up])


LEAST_TURN = 0.1
"""Standard deviation of the turns about the vertical that tells it [rad]."""


def _colour(depth: Path) -> Path | None:
    return next((path for ending in _COLOURS if (path := _beside(depth, ending)).is_file()), None)


def _beside(depth: Path, ending: str) -> Path:
    return depth.with_name(depth.name.replace("depth.png", ending))


def _is_lost(pose: Path) -> bool:
    return not all(np.isfinite(floats(words, where)).all() for where, words in rows_of_words(pose))


def _lone_colours(folder: Path) -> int:
    names = [path.name for ending in _COLOURS for path in folder.glob(f"frame-*.{ending}")]
    return sum(not (folder / f"{name.split('.')[0]}.depth.png").is_file() for name in names)


def _counted(left_out: Counter[str]) -> str:
    return ", ".join(f"{count} {what}" for what, count in left_out.items() if count)
