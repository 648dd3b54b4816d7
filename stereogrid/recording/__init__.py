"""Recorded drives: one file a format, looked up in RECORDINGS."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from ..errors import RecordingError
from ..observation import Recording
from .kitti import KittiRecording, is_kitti
from .mcap import RECTIFIED, WANTED, McapRecording, McapWriter
from .mcap_scan import is_mcap, scan
from .raw_mcap import RawMcapRecording, RawTopics
from .raw_writer import RawReport, RawWriter
from .ros2_file import METADATA_NAME
from .ros2_raw import KIND, RAW
from .ticks import KnowsMotion, Ticks
from .views import ShuffledPoses, Subset, TruePoses, TrueTilt, poses, stamps_s

__all__ = [
    "RECORDINGS",
    "KittiRecording",
    "KnowsMotion",
    "McapRecording",
    "McapWriter",
    "RawMcapRecording",
    "RawReport",
    "RawTopics",
    "RawWriter",
    "RecordingKind",
    "ShuffledPoses",
    "Subset",
    "Ticks",
    "TruePoses",
    "TrueTilt",
    "open_recording",
    "poses",
    "stamps_s",
]


@dataclass(frozen=True)
class RecordingKind:
    """How a kind of recording is known from its path, how it is opened, and what it needs, in words."""

    recognises: Callable[[Path], bool]
    open: Callable[[Path], Recording]
    needs: str


def _open_mcap(path: Path) -> McapRecording | RawMcapRecording:
    """Of rectified observations, or of what a robot and its cameras sent."""
    topics = RawTopics()
    contents = scan(path, {**topics.wanted(), **WANTED})
    ours = contents.metadata.get(METADATA_NAME, {}).get(KIND) == RAW
    if ours or (contents.messages.keys() & set(topics.images) and not contents.messages.keys() & set(RECTIFIED)):
        return RawMcapRecording(path, topics, contents=contents)
    return McapRecording(path, contents)


RECORDINGS = {
    "mcap": RecordingKind(is_mcap, _open_mcap, "a file written by stereogrid, *.mcap"),
    "kitti": RecordingKind(
        is_kitti,
        KittiRecording,
        "a folder with image_0 and image_1 (or image_l and image_r), calib.txt, poses.txt",
    ),
}


def open_recording(path: str | Path) -> Recording:
    """The recording at `path`, its kind found from what is there.

    Raises RecordingError when nothing is there, it is of no known kind, or it is wrong in itself.
    """
    place = Path(path)
    for kind in RECORDINGS.values():
        if place.exists() and kind.recognises(place):
            return kind.open(place)
    fault = "no known kind of recording" if place.exists() else "no such file or folder"
    kinds = "; ".join(f"{name}: {kind.needs}" for name, kind in RECORDINGS.items())
    raise RecordingError(f"{place}: {fault}; choose from {kinds}")
