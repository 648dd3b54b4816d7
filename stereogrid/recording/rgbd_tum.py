"""RGB-D recordings in the layout of TUM's benchmark (and ETH3D's): lists of stamped pictures and a trajectory."""

import re
from collections import Counter
from pathlib import Path

import numpy as np

from ..errors import RecordingError
from ..places import is_file
from ..textrows import rows_of_words, stamp_ns
from ..trajectory import read_tum
from .images import picture_size
from .odometry_path import UNKNOWN, OdometryPath, Stamps
from .pairing import paired
from .raw_recording import MAX_GAP_S
from .rgbd_files import RgbdFiles, RgbdFrame, RgbdLens, find_lens, no_lens

LISTS = COLOUR, DEPTH = ("rgb.txt", "depth.txt")
TRUTH = "groundtruth.txt"
PER_M = 5000.0
KNOWN_LENSES = {
    "freiburg1": (517.3, 516.5, 318.6, 255.3, 0.2624, -0.9531, -0.0054, 0.0026, 1.1633),
    "freiburg2": (520.9, 521.0, 325.1, 249.7, 0.2312, -0.7849, -0.0033, -0.0001, 0.9172),
    "freiburg3": (535.4, 539.2, 320.1, 247.6),
}
"""fx, fy, cx, cy [px] and distortion of the benchmark's colour cameras, to which its depths are registered, as its page
of file formats gives them; those of freiburg3 are free of distortion."""


def is_tum(folder: Path) -> bool:
    """Whether a folder holds the benchmark's lists of pictures."""
    return any(is_file(folder / name) for name in LISTS)


def read_tum_folder(folder: Path) -> RgbdFiles:
    """rgb.txt and depth.txt (`stamp path` a row), groundtruth.txt and the pictures; a number of 5000 is a metre.

    A depth image belongs to the colour image nearest in time; its pose is that of the trajectory at its own stamp.
    Raises RecordingError, naming the file and line, for what is missing or wrong, or when no pair has a pose.
    """
    left_out: Counter[str] = Counter()
    colours, depths = (_listed(folder, name, left_out) for name in LISTS)
    told = read_tum(folder / TRUTH)
    path = OdometryPath.of(told.stamps_ns, told.poses, ["world"] * len(told.stamps_ns))
    pairs = _pairs(np.array(sorted(colours), np.int64), np.array(sorted(depths), np.int64), left_out)
    known = path.pieces_at(pairs[:, 1], MAX_GAP_S) != UNKNOWN
    left_out["pairs where the ground truth does not reach"] += int((~known).sum())
    if not known.any():
        raise RecordingError(f"{folder / TRUTH}: tells of no moment at which {DEPTH} and {COLOUR} both have a picture")
    poses = [each.T_odom_base for each in path.at(pairs[known, 1])]
    frames = [
        RgbdFrame(depth_ns, depths[depth_ns], colours[colour_ns], T_world_cam)
        for (colour_ns, depth_ns), T_world_cam in zip(pairs[known].tolist(), poses, strict=True)
    ]
    lens = find_lens(folder) or _known_lens(folder)
    return RgbdFiles("TUM", frames, PER_M, lens, picture_size(frames[0].depth), +left_out)


def _listed(folder: Path, name: str, left_out: Counter[str]) -> dict[int, Path]:
    """The pictures of a list by their stamps; those that are not there are counted."""
    found: dict[int, Path] = {}
    for where, words in rows_of_words(folder / name):
        if len(words) != 2:
            raise RecordingError(f"{where}: {len(words)} words, expected two: a stamp and the path of a picture")
        stamp, path = stamp_ns(words[0], where), Path(words[1])
        if path.is_absolute() or ".." in path.parts:
            raise RecordingError(f"{where}: {words[1][:80]} is outside of the recording")
        if not is_file(folder / path):
            left_out[f"pictures of {name} that are not there"] += 1
        elif stamp in found:
            left_out[f"pictures of {name} with the stamp of an earlier one"] += 1
        else:
            found[stamp] = folder / path
    if not found:
        raise RecordingError(f"{folder / name}: none of its pictures is there")
    return found


def _pairs(colour_ns: Stamps, depth_ns: Stamps, left_out: Counter[str]) -> Stamps:
    """Stamps (M, 2) of colour and depth images that are each other's nearest."""
    numbers = paired(colour_ns, depth_ns)
    left_out["colour images without a depth image"] += len(colour_ns) - len(numbers)
    left_out["depth images without a colour image"] += len(depth_ns) - len(numbers)
    pairs: Stamps = np.stack([colour_ns[numbers[:, 0]], depth_ns[numbers[:, 1]]], axis=1)
    return pairs


def _known_lens(folder: Path) -> RgbdLens:
    named = re.search("|".join(KNOWN_LENSES), folder.resolve().name)
    if named is None:
        raise no_lens(folder)
    fx, fy, cx, cy, *distortion = KNOWN_LENSES[named[0]]
    return RgbdLens(np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]]), tuple(distortion), f"TUM's {named[0]}")
