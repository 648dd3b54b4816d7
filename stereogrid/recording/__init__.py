"""Recorded drives: one file a format, looked up in RECORDINGS."""

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from ..errors import RecordingError
from ..places import is_there
from .bag import BagRecording
from .bag_folder import is_bag, lone_mcap
from .contents import Contents
from .conversions import CONVERSIONS, check_outside, check_target, convert, lost_gravity
from .euroc import EurocRecording
from .euroc_files import is_euroc
from .file_recording import FileRecording
from .folder import FolderRecording
from .folder_files import is_folder
from .kitti import KittiRecording, is_kitti
from .kitti_raw import KittiRawRecording, is_kitti_raw
from .mcap import RECTIFIED, WANTED, McapRecording, McapWriter
from .mcap_file import is_mcap
from .mcap_scan import scan
from .raw_mcap import RawMcapRecording
from .raw_recording import PairingLimits, RawRecording
from .raw_topics import BY_TYPE, GIVEN, Given, MissingTopicsError, RawTopics, UnusableBagError
from .raw_writer import RawReport, RawWriter
from .rgbd import RgbdRecording, is_rgbd
from .ros2_file import METADATA_NAME
from .ros2_messages import has_static_transform
from .ros2_raw import KIND, RAW
from .selection import Selection
from .ticks import KnowsMotion, Ticks
from .views import ShuffledPoses, Subset, TruePoses, TrueTilt, poses, stamps_s

__all__ = [
    "CONVERSIONS",
    "RECORDINGS",
    "BagRecording",
    "EurocRecording",
    "FileRecording",
    "FolderRecording",
    "Given",
    "KittiRawRecording",
    "KittiRecording",
    "KnowsMotion",
    "McapRecording",
    "McapWriter",
    "MissingTopicsError",
    "PairingLimits",
    "RawMcapRecording",
    "RawRecording",
    "RawReport",
    "RawTopics",
    "RawWriter",
    "RecordingKind",
    "RgbdRecording",
    "Selection",
    "ShuffledPoses",
    "Subset",
    "Ticks",
    "TruePoses",
    "TrueTilt",
    "UnusableBagError",
    "check_outside",
    "check_target",
    "convert",
    "kind_of",
    "lost_gravity",
    "open_recording",
    "poses",
    "stamps_s",
]


@dataclass(frozen=True)
class RecordingKind:
    """How a kind of recording is known from its path, how it is opened, and what it needs, in words.

    open_given: how it is opened with what a user says in its place; takes: what of a Given it can do with.
    """

    recognises: Callable[[Path], bool]
    open: Callable[[Path], FileRecording]
    needs: str
    open_given: Callable[[Path, Given], FileRecording] | None = None
    takes: tuple[str, ...] = ()


def _open_mcap(path: Path, given: Given | None = None) -> FileRecording:
    """Of rectified observations, of what a robot and its cameras sent, or of topics that are to be found."""
    given = given or Given()
    contents = scan(path, {**RawTopics().wanted(), **WANTED}, BY_TYPE)
    kind = _mcap_kind(contents)
    if kind is McapRecording:
        if given.said:
            raise RecordingError(f"{path}: has rectified pictures, calibration and poses of its own; none can be given")
        return McapRecording(path, contents)
    if kind is BagRecording or given.names_topics:
        return BagRecording(path, given, contents=contents)
    return RawMcapRecording(
        path, rig=given.calibration, T_base_cam=given.T_base_cam, standing=given.standing, contents=contents
    )


def _mcap_kind(contents: Contents) -> type[FileRecording]:
    """By what the file says of itself, or whether it has pictures and frames that are named as in our own files."""
    ours = contents.metadata.get(METADATA_NAME)
    if ours is not None:
        return RawMcapRecording if ours.get(KIND) == RAW else McapRecording
    if not has_static_transform(contents.static_transforms):
        return BagRecording
    if contents.messages.keys() & set(RECTIFIED):
        return McapRecording
    return RawMcapRecording if contents.messages.keys() & set(RawTopics().images) else BagRecording


def _open_bag(path: Path, given: Given | None = None) -> FileRecording:
    """A folder may hold a file of ours, which `_open_mcap` knows."""
    alone = lone_mcap(path)
    return BagRecording(path, given) if alone is None else _open_mcap(alone, given)


RECORDINGS = {
    "mcap": RecordingKind(is_mcap, _open_mcap, "a file of ROS 2 messages, *.mcap", _open_mcap, GIVEN),
    "bag": RecordingKind(is_bag, _open_bag, "a ROS bag: *.bag, or a folder with metadata.yaml", _open_bag, GIVEN),
    "kitti": RecordingKind(
        is_kitti,
        KittiRecording,
        "a folder with image_0 and image_1 (or image_l and image_r), calib.txt, poses.txt",
    ),
    "kitti_raw": RecordingKind(
        is_kitti_raw,
        KittiRawRecording,
        "a drive's folder with image_00/data, image_01/data, oxts/data, timestamps.txt, and its date's calib_*.txt",
    ),
    "euroc": RecordingKind(
        is_euroc,
        EurocRecording,
        "a folder with mav0/cam0 and mav0/cam1 (data, sensor.yaml) and a ground truth",
        lambda path, given: EurocRecording(path, standing=given.standing),
        ("standing",),
    ),
    "folder": RecordingKind(
        is_folder,
        FolderRecording,
        "a folder with left and right (or left_*.png and right_*.png), rig.toml or camera.toml, and trajectory.txt",
        lambda path, given: FolderRecording(path, standing=given.standing),
        ("standing",),
    ),
    "rgbd": RecordingKind(
        is_rgbd,
        RgbdRecording,
        "a folder with rgb.txt, depth.txt, groundtruth.txt, or with frame-XXXXXX.depth.png, .color.png, .pose.txt",
    ),
}


_SHOWN = 300
"""Letters of a path."""


def kind_of(path: str | Path) -> str:
    """The name in RECORDINGS of what is at `path`. Raises RecordingError when nothing is there, or no known kind."""
    place = Path(path)
    found = next((name for name in RECORDINGS if is_there(place) and _recognised(name, place)), None)
    if found is not None:
        return found
    fault = "no such file or folder"
    if is_there(place):
        fault = "no known kind of recording" if _may_read(place) else "you may not read it"
    kinds = "; ".join(f"{name}: {kind.needs}" for name, kind in RECORDINGS.items())
    raise RecordingError(f"{str(place)[:_SHOWN]}: {fault}; choose from {kinds}")


def _may_read(place: Path) -> bool:
    return os.access(place, os.R_OK, effective_ids=os.access in os.supports_effective_ids)


def _recognised(name: str, place: Path) -> bool:
    try:
        return RECORDINGS[name].recognises(place)
    except OSError:  # a folder or file that is closed
        return False


def open_recording(
    path: str | Path, *, start_s: float = 0.0, end_s: float | None = None, stride: int = 1, given: Given | None = None
) -> FileRecording:
    """The recording at `path`, its kind found from what is there; or a part of it (Selection).

    given: what the user says of it in its place: topics, calibration, mount, that it stood still.
    Raises RecordingError when nothing is there, it is of no known kind, it is wrong in itself, or takes nothing given.
    """
    whole = _opened(kind_of(path), Path(path), given or Given())
    return whole if (start_s, end_s, stride) == (0.0, None, 1) else Selection(whole, start_s, end_s, stride)


def _opened(name: str, path: Path, given: Given) -> FileRecording:
    kind = RECORDINGS[name]
    wrong = [each for each in given.said if each not in kind.takes]
    if wrong:
        takers = ", ".join(other for other in RECORDINGS if wrong[0] in RECORDINGS[other].takes)
        raise RecordingError(
            f"{path}: a recording of the kind {name} takes no {wrong[0]} from outside; these do: {takers}"
        )
    try:
        return kind.open(path) if kind.open_given is None or not given.said else kind.open_given(path, given)
    except OSError as error:
        where = "" if error.filename is None else f"{error.filename}: "
        raise RecordingError(f"{path}: cannot be read: {where}{error.strerror or error}") from error
