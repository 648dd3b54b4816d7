"""Records what cameras and robot send while they are used; nothing that they do waits for the disk."""

import threading
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from stereogrid.calibration import CalibrationFile, Rig
from stereogrid.errors import InvalidInputError, StereogridError
from stereogrid.recording import RawReport, RawWriter

from ..cameras.pairs import RawPair
from ..clock import now_s, to_epoch_s
from ..pioneer.robot import RobotReport

PAIRS_BYTES = 64_000_000
"""Of pairs that wait for the disk: seven seconds of 640 x 480 pixels at 15 a second."""
MOST_REPORTS = 20_000
"""Of reports that wait: half an hour of them."""
LAST_WRITE_S = 1.0
SYNC_EVERY_S = 2.0
"""A power cut takes no more of a recording, but what the disk was too slow for."""


@dataclass
class RecorderCounts:
    """So far: pairs and reports written; those that were not, for the disk was too slow or full; the file's size."""

    pairs: int = 0
    reports: int = 0
    dropped_pairs: int = 0
    dropped_reports: int = 0
    n_bytes: int = 0


class RawRecorder:
    """A recording of raw pairs and of the robot's reports, written by a thread; use it in a `with` block.

    What is given to it waits in memory, within bounds: pairs of no more than pairs_bytes. Where the disk is slower than
    the cameras, pairs are dropped and counted; reports are small and have room long after. A disk that is full, or any
    other failure, ends the recording (`problem`); what was written can be read, and the caller goes on.

    rig: which the cameras are, None where nobody knows (such a file cannot be mapped from until a calibration is
    given). metadata: text kept in the file.
    Raises RecordingError when the file exists (unless overwrite) or cannot be written, InvalidInputError when the
    metadata are wrong.
    """

    def __init__(
        self,
        path: str | Path,
        rig: Rig | None,
        *,
        metadata: Mapping[str, str] | None = None,
        pairs_bytes: int = PAIRS_BYTES,
        overwrite: bool = False,
    ) -> None:
        if pairs_bytes < 1:
            raise InvalidInputError(f"pairs_bytes must be at least 1, not {pairs_bytes}")
        cameras = rig.calibration if isinstance(rig, CalibrationFile) else rig.camera if rig is not None else None
        T_base_cam = None if rig is None else rig.T_base_cam
        self.path = Path(path)
        self._writer = RawWriter(path, cameras, T_base_cam, metadata=metadata, overwrite=overwrite)
        self._changed = threading.Condition()
        self._waiting: deque[RawPair | RobotReport] = deque()
        self._pairs_bytes, self._most_bytes = 0, pairs_bytes
        self._counts = RecorderCounts(n_bytes=self._writer.n_bytes)
        self._odometry_lost: int | None = None
        self._problem = ""
        self._closing = self._hurried = False
        self._synced_s = now_s()
        self._thread = threading.Thread(target=self._run, name="recorder", daemon=True)
        self._thread.start()

    def write_pair(self, pair: RawPair) -> None:
        """Take a pair, which nobody may change from now on. Returns at once."""
        with self._changed:
            if self._full() or self._pairs_bytes + _size(pair) > self._most_bytes:
                self._counts.dropped_pairs += 1
            else:
                self._pairs_bytes += _size(pair)
                self._waiting.append(pair)
                self._changed.notify()

    def write_report(self, report: RobotReport) -> None:
        """Take a report. Returns at once."""
        with self._changed:
            if self._full():
                self._counts.dropped_reports += 1
            else:
                self._waiting.append(report)
                self._changed.notify()

    @property
    def counts(self) -> RecorderCounts:
        """The counts as they are now."""
        with self._changed:
            return replace(self._counts)

    def problem(self) -> str:
        """Why nothing is recorded any more, "" while all is well."""
        return self._problem

    def close(self, timeout_s: float = 5.0) -> None:
        """Write what still waits, as far as the disk takes it within timeout_s, and finish the file.

        Returns a second after that at the latest; `counts` and `problem` tell what became of it. Again: nothing.
        """
        with self._changed:
            self._closing = True
            self._changed.notify()
        self._thread.join(timeout_s)
        if self._thread.is_alive():
            self._hurried = True
            self._thread.join(LAST_WRITE_S)
        if self._thread.is_alive():
            self._end(f"{self.path}: the disk took nothing for {timeout_s + LAST_WRITE_S:g} s; the file has no index")

    def __enter__(self) -> "RawRecorder":
        return self

    def __exit__(self, *exc_info: object) -> None:
        self.close()

    def _full(self) -> bool:
        return bool(self._problem) or self._closing or len(self._waiting) >= MOST_REPORTS

    def _run(self) -> None:
        try:
            while (thing := self._next()) is not None:
                self._write(thing)
                self._written(thing)
                self._sync()
        except StereogridError as error:
            self._end(str(error))
        except Exception as error:
            # Whatever it is: driving and mapping go on, and it is told.
            self._end(f"{self.path}: {error!r}")
        self._finish()

    def _next(self) -> RawPair | RobotReport | None:
        """What to write next; None when there is nothing more."""
        with self._changed:
            self._changed.wait_for(lambda: self._waiting or self._closing)
            if not self._waiting:
                return None
            if self._hurried:
                self._end(f"{self.path}: the disk was too slow for the end of the drive")
                return None
            # It stays there until it is written.
            return self._waiting[0]

    def _write(self, thing: RawPair | RobotReport) -> None:
        if isinstance(thing, RawPair):
            stamps_s = (to_epoch_s(thing.left_stamp_s), to_epoch_s(thing.right_stamp_s))
            self._writer.write_pair(thing.left, thing.right, *stamps_s)
            return
        self._writer.write_report(raw_report(thing))
        if self._odometry_lost not in (None, thing.odometry_lost):
            when = f"{to_epoch_s(thing.stamp_s):.3f} s"
            self._writer.write_note(f"odometry lost {thing.odometry_lost}", f"before the report at {when}")
        self._odometry_lost = thing.odometry_lost

    def _sync(self) -> None:
        if now_s() - self._synced_s >= SYNC_EVERY_S:
            self._writer.sync()
            self._synced_s = now_s()

    def _written(self, thing: RawPair | RobotReport) -> None:
        with self._changed:
            self._counts.n_bytes = self._writer.n_bytes
            if not self._waiting:  # given up meanwhile, and counted
                return
            self._waiting.popleft()
            if isinstance(thing, RawPair):
                self._counts.pairs += 1
                self._pairs_bytes -= _size(thing)
            else:
                self._counts.reports += 1

    def _end(self, problem: str) -> None:
        """Give up: the first reason stays."""
        with self._changed:
            self._problem = self._problem or problem
            for thing in self._waiting:
                if isinstance(thing, RawPair):
                    self._counts.dropped_pairs += 1
                else:
                    self._counts.dropped_reports += 1
            self._waiting.clear()
            self._pairs_bytes = 0

    def _finish(self) -> None:
        counts = self.counts
        try:
            with self._writer:
                if counts.dropped_pairs or counts.dropped_reports:
                    told = f"{counts.dropped_pairs} pairs, {counts.dropped_reports} reports"
                    self._writer.write_note("dropped", told)
                self._writer.sync()
        except StereogridError as error:
            self._end(str(error))
        with self._changed:
            self._counts.n_bytes = self._writer.n_bytes


def raw_report(report: RobotReport) -> RawReport:
    """A report as recordings hold it: its stamp since 1970, the state as text."""
    values = {
        "motors": "on" if report.motors_on else "off",
        "e-stop": "pressed" if report.e_stopped else "",
        "stalled": " ".join(side for side, stalls in zip(("left", "right"), report.stalled, strict=True) if stalls),
        "front bumpers": _bits(report.front_bumpers),
        "rear bumpers": _bits(report.rear_bumpers),
        "odometry lost": str(report.odometry_lost),
    }
    return RawReport(
        to_epoch_s(report.stamp_s),
        report.odometry.T_odom_base,
        report.speed_mps,
        report.turn_radps,
        report.odometry_lost,
        report.battery_v,
        report.sonar_m,
        report.fault,
        values,
    )


def _bits(mask: int) -> str:
    """Numbers of the bumpers that are pressed, from 1 on."""
    return " ".join(str(bit + 1) for bit in range(mask.bit_length()) if mask >> bit & 1)


def _size(pair: RawPair) -> int:
    return pair.left.nbytes + pair.right.nbytes
