"""What a person who drives wants to see, as one line."""

import math

from stereogrid.geometry import yaw_rad

from ..cameras.pairs import StereoPairs
from ..clock import now_s
from ..pioneer.robot import RobotDriver
from ..recording import Rate
from .mapping import LiveMapper


class Status:
    """Composes the line; call `line` a few times a second."""

    def __init__(self, robot: RobotDriver, cameras: StereoPairs, mapper: LiveMapper) -> None:
        self._robot, self._cameras, self._mapper = robot, cameras, mapper
        self._camera_rate, self._map_rate = Rate(), Rate()

    def line(self, *, speed_mps: float | None, recorded: str) -> str:
        """speed_mps: what a held key asks for, None without keys; recorded: of the recording, "" for none."""
        parts = [*self._robots(speed_mps), self._seen(), self._mapped(), self._size(), recorded]
        return " | ".join(part for part in parts if part)

    def _seen(self) -> str:
        counts = self._cameras.counts
        rate = self._camera_rate.of(counts.pairs, now_s())
        left_out = f", {counts.skewed + counts.broken} bad" if counts.skewed + counts.broken else ""
        problem = self._cameras.problem()
        if problem:
            return f"NO PICTURES: {problem}"
        return f"{rate:.1f} pairs/s, skew {1000 * self._mapper.skew_s:.0f} ms{left_out}"

    def _mapped(self) -> str:
        mapper, counts = self._mapper, self._mapper.counts
        rate = self._map_rate.of(counts.mapped, now_s())
        if mapper.ended:
            return f"MAPPING ENDED: {mapper.ended}"
        if not mapper.warm.is_set():
            return "mapper warms up"
        skipped = mapper.dropped + counts.stale + counts.unplaced
        left_out = f", {skipped} skipped" if skipped else ""
        return f"mapped {rate:.1f}/s, {1000 * mapper.latency_s:.0f} ms late{left_out}"

    def _robots(self, speed_mps: float | None) -> list[str]:
        report, status = self._robot.latest(), self._robot.status()
        if report is None or not status.connected:
            return ["NO ROBOT: no reports" + (f" ({status.latched})" if status.latched else "")]
        state = f"STOPPED: {status.latched}" if status.latched else "ARMED" if status.armed else "motors off"
        if speed_mps is not None:
            state += f", {speed_mps:.2f} m/s"
        odometry = report.odometry
        x_m, y_m = odometry.T_odom_base[:2, 3]
        heading_deg = math.degrees(yaw_rad(odometry.T_odom_base))
        return [
            state,
            f"{report.battery_v:.1f} V",
            f"x {x_m:.2f} y {y_m:.2f} m {heading_deg:.0f} deg, {odometry.travelled_m:.2f} m driven",
        ]

    def _size(self) -> str:
        return f"map {self._mapper.grid.n_bytes / 1e6:.1f} MB"
