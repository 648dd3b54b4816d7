"""How a recording goes, as a line."""

import shutil
from pathlib import Path

from ..cameras.pairs import StereoPairs
from ..clock import now_s
from ..pioneer.robot import RobotDriver
from .drive_recorder import DriveRecorder
from .rate import Rate


class RecordStatus:
    """Composes the line; call `line` a few times a second."""

    def __init__(self, drive: DriveRecorder, cameras: StereoPairs, robot: RobotDriver | None) -> None:
        self._drive, self._cameras, self._robot = drive, cameras, robot
        self._pair_rate, self._report_rate = Rate(), Rate()

    def line(self) -> str:
        """Rates, skew, battery, the file and the room that is left for it."""
        counts = self._drive.counts
        pair_rate = self._pair_rate.of(counts.pairs, now_s())
        report_rate = self._report_rate.of(counts.reports, now_s())
        return " | ".join([self._pictures(pair_rate), *self._reports(report_rate), self._drive.line(), self._room()])

    def summary(self) -> str:
        """What became of it in the end."""
        counts = self._drive.counts
        parts = [f"{counts.pairs} pairs", f"{counts.reports} reports" if self._robot is not None else "no robot"]
        if counts.dropped_pairs or counts.dropped_reports:
            parts.append(f"DROPPED: {counts.dropped_pairs} pairs, {counts.dropped_reports} reports")
        return f"{self._drive.recorder.path}: {counts.n_bytes / 1e6:.1f} MB, {', '.join(parts)}"

    def _pictures(self, rate: float) -> str:
        problem = self._cameras.problem()
        if problem:
            return f"NO PICTURES: {problem}"
        counts = self._cameras.counts
        bad = f", {counts.skewed} too far apart" if counts.skewed else ""
        bad += f", {counts.broken} without a partner" if counts.broken else ""
        return f"{rate:.1f} pairs/s, skew {1000 * abs(self._drive.last_skew_s):.0f} ms{bad}"

    def _reports(self, rate: float) -> list[str]:
        if self._robot is None:
            return []
        report = self._robot.latest()
        if report is None or not self._robot.status().connected:
            return [f"NO ROBOT: {self._robot.status().latched or 'no reports'}"]
        lost = f", ODOMETRY LOST {report.odometry_lost} times" if report.odometry_lost else ""
        fault = f", {report.fault}" if report.fault else ""
        return [
            f"{rate:.1f} reports/s, {report.battery_v:.1f} V, {report.odometry.travelled_m:.2f} m driven{lost}{fault}"
        ]

    def _room(self) -> str:
        try:
            free = shutil.disk_usage(Path(self._drive.recorder.path).resolve().parent).free
        except OSError:
            return "disk unknown"
        return f"{free / 1e9:.1f} GB free"
