"""A recording of any kind as a file or folder of another kind: one function a kind, looked up in CONVERSIONS."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..errors import InvalidInputError, RecordingError, unknown_name
from ..files import folder_beside, written_beside
from .file_recording import FileRecording
from .kitti_writer import write_kitti
from .mcap_writer import McapWriter
from .raw_copy import Numbers, copy_raw
from .raw_recording import RawRecording
from .ros2_file import OWN_METADATA
from .ros2_raw import KIND
from .rosbag2 import bag_file_name, metadata_yaml
from .selection import Selection

ORIGIN = "converted_from"
"""In the metadata: where a recording came from, the last first."""
Progress = Callable[[float], None]
LEVEL_DEG = 0.5
"""A camera that is less off level than that is taken to be level."""


@dataclass(frozen=True)
class Conversion:
    """write(source, place, name): fills the file or empty folder `place`, which will be called `name`.

    is_folder: what the outcome is.
    """

    write: "Callable[[Source, Path, Path], None]"
    is_folder: bool


@dataclass(frozen=True)
class Source:
    """What is converted. raw: its pictures as they were sent, with all else that the robot told."""

    recording: FileRecording
    metadata: dict[str, str]
    raw: bool
    progress: Progress


def convert(
    recording: FileRecording,
    out: str | Path,
    to: str | None = None,
    *,
    raw: bool = False,
    origin: str = "",
    progress: Progress = lambda _: None,
) -> Path:
    """Write a recording, or a part of one (Selection), as another kind to `out`, whole or not at all; returns its path.

    to: a name in CONVERSIONS; None: from `out`: *.mcap, or, where it ends with /, a ROS 2 bag. raw: keep the pictures
    and all else as they were sent. origin: where it comes from, for the metadata; the name of its file by default.
    progress is called with the share that is done. What the recording cannot give (`damage`, `left_out`) is not in it.
    Raises InvalidInputError when `out` exists, lies in the recording, cannot be written or cannot be what is asked for,
    RecordingError when the recording cannot be read on.
    """
    conversion, place = CONVERSIONS[check_target(recording.path, out, to)], Path(out)
    if raw:
        _check_raw(recording, conversion)
    texts = {key: text for key, text in recording.metadata.items() if key not in (*OWN_METADATA, KIND, ORIGIN)}
    texts[ORIGIN] = "; ".join(filter(None, (origin or recording.path.name, recording.metadata.get(ORIGIN))))
    with folder_beside(place) if conversion.is_folder else written_beside(place) as partial:
        try:
            conversion.write(Source(recording, texts, raw, progress), partial, place)
        except (RecordingError, InvalidInputError) as error:
            # Of the place that is to be, not of the one it is made in.
            raise type(error)(str(error).replace(str(partial), str(place))) from error
    return place


def check_target(source: Path, out: str | Path, to: str | None = None) -> str:
    """The kind, a name in CONVERSIONS, as which a recording at `source` would be written to `out`.

    Raises InvalidInputError when it cannot be.
    """
    place = Path(out)
    if to is None:
        to = "ros2" if str(out).endswith("/") else "mcap" if place.suffix.lower() == ".mcap" else None
    if to is None:
        raise InvalidInputError(
            f"{out}: what shall it be? a name that ends with .mcap is an MCAP file, one with / a ROS 2 bag; or say "
            f"--to {', '.join(CONVERSIONS)}"
        )
    if to not in CONVERSIONS:
        raise unknown_name("conversion", to, CONVERSIONS)
    if to == "mcap" and place.suffix.lower() != ".mcap":
        raise InvalidInputError(f"{out}: an MCAP file's name must end with .mcap")
    if place.exists():
        raise InvalidInputError(f"{out}: exists already; choose another path")
    check_outside(source, out)
    return to


def lost_gravity(recording: FileRecording, to: str) -> str | None:
    """What of a recording's world whoever reads the conversion cannot know, in a line; None where nothing is lost.

    A KITTI folder's world is its first camera, which every reader takes to be level.
    """
    tilt_deg = float(np.degrees(np.arccos(np.clip(-recording.poses[0, 2, 1], -1, 1))))
    if CONVERSIONS[to].write is not _write_kitti or tilt_deg < LEVEL_DEG:
        return None
    return (
        f"the first camera is {tilt_deg:.1f} degrees off level, and a KITTI folder's world is that camera: whoever "
        "reads it finds the world turned by that"
    )


def check_outside(source: Path, out: str | Path) -> None:
    """Raise InvalidInputError when `out` is a recording at `source`, or lies in it."""
    inner, outer = Path(out).resolve(), source.resolve()
    if inner == outer:
        raise InvalidInputError(f"{out}: is the recording, and would be written over")
    if outer in inner.parents:
        raise InvalidInputError(f"{out}: lies in the recording {source} itself; choose another path")


def _check_raw(recording: FileRecording, conversion: Conversion) -> None:
    whole, _, thinned = _raw_part(recording)
    if not isinstance(whole, RawRecording):
        raise InvalidInputError(f"{recording.path}: is of rectified pictures: --raw needs a recording of raw ones")
    if conversion.write is _write_kitti:
        raise InvalidInputError("a KITTI folder is of rectified pictures: it cannot be raw")
    if thinned:
        raise InvalidInputError("raw pictures are kept all or none: --raw takes no --stride")


def _raw_part(recording: FileRecording) -> tuple[FileRecording, Numbers | None, bool]:
    """The whole of which it is a part, or a part of a part; which of its observations, None for all; whether these are
    thinned out."""
    if not isinstance(recording, Selection):
        return recording, None, False
    whole, numbers, thinned = _raw_part(recording.whole)
    chosen = recording.numbers if numbers is None else numbers[recording.numbers]
    return whole, chosen, thinned or recording.stride != 1


def _write_mcap(source: Source, place: Path, _: Path) -> None:
    if source.raw:
        _write_raw(source, place)
        return
    recording = source.recording
    meshes = {name: recording.mover_mesh_ply(name) or b"" for name in recording.mover_names()}
    with McapWriter(
        place,
        recording.camera,
        recording.T_base_cam,
        metadata=source.metadata,
        truth_mesh_ply=recording.truth_mesh_ply(),
        mover_meshes_ply=meshes,
        overwrite=True,
    ) as writer:
        _write_observations(source, writer)


def _write_observations(source: Source, writer: McapWriter) -> None:
    recording = source.recording
    ticks, n_ticks = recording.ticks(), 0

    def tick_until(stamp_s: float) -> None:
        nonlocal n_ticks
        while ticks is not None and n_ticks < len(ticks) and ticks.stamp_s[n_ticks] <= stamp_s:
            writer.write_tick(float(ticks.stamp_s[n_ticks]), ticks.T_world_base[n_ticks], ticks.wheels_rad[n_ticks])
            n_ticks += 1

    for number, observation in enumerate(recording):
        tick_until(observation.stamp_s)
        writer.write(observation)
        source.progress((number + 1) / len(recording))
    tick_until(float("inf"))


def _write_raw(source: Source, place: Path) -> None:
    whole, numbers, _ = _raw_part(source.recording)
    if not isinstance(whole, RawRecording):
        raise AssertionError("checked before")
    copy_raw(whole, place, source.metadata, numbers, source.progress)


def _write_bag(source: Source, place: Path, name: Path) -> None:
    file = place / bag_file_name(name)
    _write_mcap(source, file, file)
    (place / "metadata.yaml").write_text(metadata_yaml(file))


def _write_kitti(source: Source, place: Path, _: Path) -> None:
    write_kitti(source.recording, place, source.progress)


CONVERSIONS = {
    "mcap": Conversion(_write_mcap, is_folder=False),
    "ros2": Conversion(_write_bag, is_folder=True),
    "kitti": Conversion(_write_kitti, is_folder=True),
}
