"""Copies raw recordings: our own message by message, so that nothing that a robot told is lost."""

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from mcap.records import Channel, McapRecord, Message, Schema
from numpy.typing import NDArray

from . import ros2_messages as ros2
from . import ros2_raw as raw
from .mcap_file import ClippedFile, Records
from .odometry_path import Stamps
from .raw_mcap import RawMcapRecording
from .raw_recording import LEFT, MAX_GAP_S, RIGHT, RawDrive, RawRecording
from .raw_writer import RawReport, RawWriter, camera_matrices
from .ros2_file import Ros2File

Numbers: TypeAlias = NDArray[np.int64]
Progress: TypeAlias = Callable[[float], None]

_MADE_ANEW = (ros2.TF, ros2.TF_STATIC, ros2.LEFT_INFO, ros2.RIGHT_INFO)
"""So that files from before they were complete have all frames, and all the calibration that a user may have given."""
_SIDES = {raw.LEFT_IMAGE: LEFT, raw.RIGHT_IMAGE: RIGHT}
_INFOS = (ros2.LEFT_INFO, ros2.RIGHT_INFO)


def copy_raw(
    recording: RawRecording, out: Path, metadata: Mapping[str, str], numbers: Numbers | None, progress: Progress
) -> None:
    """Write the raw pairs of these observations (of all when None) and what the robot told around them to a file.

    Raises RecordingError when the recording cannot be read on or the file not written.
    """
    if isinstance(recording, RawMcapRecording) and recording.metadata.get(raw.KIND) == raw.RAW:
        _copy_messages(recording, out, metadata, numbers, progress)
    else:
        _copy_pairs(recording, out, metadata, numbers, progress)


def _copy_pairs(
    recording: RawRecording, out: Path, metadata: Mapping[str, str], numbers: Numbers | None, progress: Progress
) -> None:
    """The pairs, and as much of the odometry as they need."""
    drive = recording.drive
    chosen = np.arange(len(recording)) if numbers is None else numbers
    pairs_ns = recording.pairs_ns[chosen]
    pictures = zip(pairs_ns.tolist(), recording.raw_pairs(chosen.tolist()), strict=True)
    with RawWriter(out, drive.rig, drive.T_base_cam, metadata=metadata, overwrite=True) as writer:
        reports = _reports(drive, pairs_ns)
        report = next(reports, None)
        for done, (stamps_ns, pair) in enumerate(pictures, 1):
            left_s, right_s = (stamp_ns / 10**9 for stamp_ns in stamps_ns)
            while report is not None and report.stamp_s <= left_s:
                writer.write_report(report)
                report = next(reports, None)
            writer.write_pair(*pair, left_s, right_s)
            progress(done / len(chosen))
        for after in filter(None, (report, *reports)):
            writer.write_report(after)


def _reports(drive: RawDrive, pairs_ns: Stamps) -> Iterator[RawReport]:
    """From the last one before the pairs to the first one after them."""
    path = drive.path
    if path is None:
        return
    first = max(int(np.searchsorted(path.stamps_ns, pairs_ns.min(), side="right")) - 1, 0)
    last = int(np.searchsorted(path.stamps_ns, pairs_ns.max()))
    for number in range(first, min(last + 1, len(path.stamps_ns))):
        stamp_s = int(path.stamps_ns[number]) / 10**9
        yield RawReport(stamp_s, path.T_odom_base[number], odometry_lost=int(path.piece[number]))


def _copy_messages(
    recording: RawMcapRecording, out: Path, metadata: Mapping[str, str], numbers: Numbers | None, progress: Progress
) -> None:
    """Of the pictures those from the first to the last observation; of the rest what is no further from them than
    reports may be apart; and the frames that they tell of."""
    span_ns = None if numbers is None else (recording.pairs_ns[numbers].min(), recording.pairs_ns[numbers].max())
    texts = {raw.KIND: raw.RAW, **metadata}
    margin_ns = int(MAX_GAP_S * 1e9)
    with (
        ClippedFile(recording.path) as source,
        Ros2File(out, raw.TOPICS, metadata=texts, grouped=True, overwrite=True) as file,
    ):
        baseline = ros2.right_camera(recording.camera.baseline_m)
        cameras = camera_matrices(recording.drive.rig)
        is_placed = False
        for topic, message in _messages(source, recording.path):
            stamp_ns, wider_ns = message.log_time, 0 if topic in _SIDES else margin_ns
            if span_ns is not None and not span_ns[0] - wider_ns <= stamp_ns <= span_ns[1] + wider_ns:
                continue
            if not is_placed:
                static = ros2.static_transform_message(stamp_ns, recording.T_base_cam, baseline)
                file.write(ros2.TF_STATIC, stamp_ns, static)
                is_placed = True
            _copy(file, topic, message, cameras)
            progress(source.tell() / source.size)


def _copy(file: Ros2File, topic: str, message: Message, cameras: tuple[raw.CameraMatrices, ...]) -> None:
    stamp_ns = message.log_time
    if topic in _SIDES:
        side = _SIDES[topic]
        told = ros2.decoder(raw.TOPICS[topic])(message.data)
        told.header.frame_id = ros2.camera_frame(right=side == RIGHT)
        told.format = ros2.image_format(told.data)
        file.write(_INFOS[side], stamp_ns, raw.camera_info_message(stamp_ns, cameras[side], right=side == RIGHT))
        file.write(topic, stamp_ns, told)
    else:
        file.write_encoded(topic, stamp_ns, message.data)
    if topic == ros2.ODOMETRY:
        odometry = ros2.decoder(raw.TOPICS[topic])(message.data)
        _, wrong = ros2.read_poses([odometry.pose.pose])
        # A report that is none is kept as it was told; no frame can be where it says.
        if not wrong[0]:
            file.write(ros2.TF, stamp_ns, _frame(stamp_ns, odometry))
    if topic in (ros2.ODOMETRY, raw.RIGHT_IMAGE):
        file.flush()


def _frame(stamp_ns: int, odometry: Any) -> ros2.Message:
    T_odom_base = ros2.read_pose(odometry.pose.pose, ros2.ODOMETRY)
    return ros2.transforms_message(stamp_ns, [(odometry.header.frame_id, ros2.BASE_FRAME, T_odom_base)])


def _messages(source: ClippedFile, path: Path) -> Iterator[tuple[str, Message]]:
    """Those on our own topics and of our own types, in the order of the file."""
    types: dict[int, str] = {}
    topics: dict[int, str] = {}
    for _, records in Records(source, path):
        for record in records:
            _learn(record, types, topics)
            if isinstance(record, Message) and record.channel_id in topics:
                yield topics[record.channel_id], record


def _learn(record: McapRecord, types: dict[int, str], topics: dict[int, str]) -> None:
    if isinstance(record, Schema):
        types[record.id] = record.name
    elif isinstance(record, Channel) and record.topic not in _MADE_ANEW:
        ours = record.message_encoding == "cdr" and raw.TOPICS.get(record.topic) == types.get(record.schema_id, "")
        if ours:
            topics[record.id] = record.topic
