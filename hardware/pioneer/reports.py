"""The newest reports, for all who want them."""

import bisect
import threading
from collections import deque

from stereogrid.observation import Odometry

from ..mailbox import Mailbox
from .odometry import between
from .robot import RobotReport

KEPT = 100
"""Ten seconds of reports."""
GAP_S = 0.5
"""Reports further apart say nothing of what was between them."""


class Reports:
    """Takes reports from one thread and gives them to any."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._kept: deque[RobotReport] = deque(maxlen=KEPT)
        self._boxes: list[Mailbox[RobotReport]] = []
        self._closed = False

    def put(self, report: RobotReport) -> None:
        """The next one."""
        with self._lock:
            self._kept.append(report)
            boxes = list(self._boxes)
        for box in boxes:
            box.put(report)

    def latest(self) -> RobotReport | None:
        """See RobotDriver."""
        with self._lock:
            return self._kept[-1] if self._kept else None

    def subscribe(self, most: int) -> Mailbox[RobotReport]:
        """See RobotDriver."""
        box: Mailbox[RobotReport] = Mailbox(most)
        with self._lock:
            self._boxes.append(box)
            if self._closed:
                box.close()
        return box

    def odometry_at(self, stamp_s: float) -> Odometry | None:
        """See RobotDriver."""
        with self._lock:
            kept = list(self._kept)
        at = bisect.bisect_left(kept, stamp_s, key=lambda report: report.stamp_s)
        if at < len(kept) and kept[at].stamp_s == stamp_s:
            return kept[at].odometry
        if at == 0 or at == len(kept):
            return None
        a, b = kept[at - 1], kept[at]
        if b.odometry_lost != a.odometry_lost or b.stamp_s - a.stamp_s > GAP_S:
            return None
        return between(a, b, stamp_s)

    def close(self) -> None:
        """No more will come."""
        with self._lock:
            self._closed = True
            boxes = list(self._boxes)
        for box in boxes:
            box.close()
