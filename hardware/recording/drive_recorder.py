"""All that cameras and robot send goes into a recording, while others use the same cameras and robot."""

import json
import threading
from collections.abc import Callable
from types import TracebackType
from typing import TypeVar

from ..cameras.pairs import RawPair, StereoPairs
from ..clock import now_s
from ..mailbox import Mailbox
from ..pioneer.robot import RobotDriver
from .rate import Rate
from .recorder import RawRecorder, RecorderCounts

T = TypeVar("T")
LOOK_S = 0.2
"""How often a thread that waits for the next thing looks whether it should end."""
MOST_WAITING = 64


class DriveRecorder:
    """Feeds a recorder from cameras and, where there is one, a robot, until `close`; use it in a `with` block.

    Both stay their owner's to close. Nothing here makes them wait, or moves the robot. last_skew_s: of the newest pair.
    """

    def __init__(self, recorder: RawRecorder, cameras: StereoPairs, robot: RobotDriver | None = None) -> None:
        self.recorder = recorder
        self._stop = threading.Event()
        self._pairs = cameras.subscribe(MOST_WAITING)
        self.last_skew_s = 0.0
        self._reports = None if robot is None else robot.subscribe(MOST_WAITING)
        self._threads = [self._start("pairs", self._pairs, self._take_pair)]
        if self._reports is not None:
            self._threads.append(self._start("reports", self._reports, recorder.write_report))
        self._rate = Rate()

    @property
    def ended(self) -> bool:
        """No more pairs will come: the cameras were closed, or their files are at the end."""
        return not self._threads[0].is_alive()

    @property
    def counts(self) -> RecorderCounts:
        """Of the recorder; what the threads here were too late for counts as dropped too."""
        counts = self.recorder.counts
        counts.dropped_pairs += self._pairs.dropped
        counts.dropped_reports += 0 if self._reports is None else self._reports.dropped
        return counts

    def line(self) -> str:
        """How the recording stands, in few words; call it a few times a second."""
        problem = self.recorder.problem()
        if problem:
            return f"NOT RECORDED ANY MORE: {problem}"
        counts = self.counts
        dropped = [
            f"{count} {what} DROPPED"
            for count, what in ((counts.dropped_pairs, "pairs"), (counts.dropped_reports, "reports"))
            if count
        ]
        written = f"recorded {counts.n_bytes / 1e6:.1f} MB, {self._rate.of(counts.n_bytes, now_s()) / 1e6:.1f} MB/s"
        return ", ".join([written, *dropped])

    def close(self) -> None:
        """Take what has come so far, and finish the file (RawRecorder.close). Again: nothing."""
        self._stop.set()
        for thread in self._threads:
            thread.join()
        self.recorder.close()

    def __enter__(self) -> "DriveRecorder":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _take_pair(self, pair: RawPair) -> None:
        self.last_skew_s = pair.skew_s
        self.recorder.write_pair(pair)

    def _start(self, what: str, box: Mailbox[T], write: Callable[[T], None]) -> threading.Thread:
        def run() -> None:
            while True:
                ending = self._stop.is_set()
                thing = box.get(0.0 if ending else LOOK_S)
                if thing is not None:
                    write(thing)
                elif ending or box.closed:
                    return

        thread = threading.Thread(target=run, name=f"record {what}", daemon=True)
        thread.start()
        return thread


def about_drive(command: str, cameras: StereoPairs, robot: str = "", calibration_toml: str = "") -> dict[str, str]:
    """What a recording's metadata say: how it came about, what was plugged in. calibration_toml: that file's text."""
    about = {
        "command": command,
        "cameras": cameras.name,
        "cameras.json": json.dumps(cameras.about, default=str),
        "robot": robot,
        "calibration.toml": calibration_toml,
    }
    return {key: text for key, text in about.items() if text}
