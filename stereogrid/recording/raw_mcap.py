"""Recordings of raw pictures and of the robot's odometry, each with stamps of its own."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ..calibration import StereoCalibration
from ..geometry import FloatArray
from . import ros2_messages as ros2
from .contents import Contents
from .mcap_base import McapBase
from .mcap_scan import messages_of
from .raw_recording import PairingLimits, RawDrive
from .raw_topics import RawTopics
from .told_recording import MessageAt, ToldRecording

__all__ = ["RawMcapRecording", "RawTopics"]


class RawMcapRecording(McapBase, ToldRecording):
    """The observations in a file of raw pictures: paired by their stamps, rectified while they are read (RawRecording).

    topics: where the file has what. rig and T_base_cam: in place of what the file says. standing: the rig stood still
    all the time, so that no odometry is needed. limits: of what makes a pair.
    Raises RecordingError when the file is missing, is no MCAP file or holds no pair with odometry and calibration.
    """

    def __init__(
        self,
        path: str | Path,
        topics: RawTopics | None = None,
        *,
        rig: StereoCalibration | None = None,
        T_base_cam: FloatArray | None = None,
        standing: bool = False,
        limits: PairingLimits | None = None,
        contents: Contents | None = None,
    ) -> None:
        topics = topics or RawTopics()
        super().__init__(path, topics.wanted(), contents)
        with self._opening():
            self._use(topics, standing=standing)
            rectification = rig.rectification() if rig is not None else self._own_rig()
            static = self._contents.static_transforms
            T = ros2.read_static_transform(static) if T_base_cam is None else T_base_cam
            path_told = None if standing else self._path()
            drive = RawDrive(self._picture_stamps(), rectification, T, path_told, topics.odometry)
            self._lay(drive, limits or PairingLimits())

    @contextmanager
    def _messages(self) -> Iterator[MessageAt]:
        with messages_of(self.path) as message_at:
            yield lambda topic, stamp_ns: self._message(topic, stamp_ns, message_at)
