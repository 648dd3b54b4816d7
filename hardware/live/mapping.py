"""The mapper in a thread of its own: the newest pair, where the robot was when it was taken, into the map."""

import threading
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from stereogrid.calibration import Rig
from stereogrid.config import MappingConfig
from stereogrid.errors import InvalidInputError, MapTooLargeError
from stereogrid.geometry import FloatArray
from stereogrid.grid import OccupancyGrid
from stereogrid.mapping_run import Mapped
from stereogrid.observation import Disparity, Image, Observation, Odometry

from ..cameras.pairs import RawPair
from ..clock import now_s
from ..mailbox import Mailbox
from ..pioneer.robot import RobotDriver

STALE_PAIR_S = 0.4
"""A pair that is older than this tells nothing of now: it is not mapped, and nothing moves."""
REPORT_WAIT_S = 0.2
"""Reports of the robot come every .1 s: the one after a pair must come within this."""
LOST = "the odometry lost the robot's way: what comes after does not fit to the map so far"


@dataclass
class MappingCounts:
    """Pairs so far, by what became of them. stale: too old. unplaced: no odometry of that moment."""

    mapped: int = 0
    stale: int = 0
    unplaced: int = 0


class LiveMapper:
    """Maps the pairs of a mailbox. Use `start`, then `finish`, which gives the map and how it came about.

    Before the first pair is mapped for good, one is mapped for nothing: that compiles the kernels, which holds the GIL
    for seconds. warm: set from then on. lock: held while the map changes. shown: told of each image and pose fused.
    ended: why no more is mapped ("" while it goes on): a map that is full, odometry that is lost, or a fault.
    """

    def __init__(
        self,
        rig: Rig,
        config: MappingConfig,
        pairs: Mailbox[RawPair],
        robot: RobotDriver,
        *,
        shown: Callable[[Image, FloatArray], None] = lambda *_: None,
    ) -> None:
        self._rig, self._config, self._pairs, self._robot = rig, config, pairs, robot
        self._T_base_cam = _mounted(rig)
        self._shown = shown
        self._mapper = config.build_mapper(rig.camera)
        self.grid, self.camera = self._mapper.grid, rig.camera
        self.lock = threading.Lock()
        self.warm = threading.Event()
        self.counts = MappingCounts()
        self.latency_s = self.skew_s = 0.0
        self.ended = ""
        self.fault: BaseException | None = None
        self._memory = _Memory()
        self._lost: int | None = None
        self._dropped_cold = 0
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="mapper", daemon=True)

    @property
    def dropped(self) -> int:
        """Pairs that there was no time for, since it is warm."""
        return self._pairs.dropped - self._dropped_cold if self.warm.is_set() else 0

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def finish(self) -> Mapped | None:
        """End after the pair under way; the map and what is remembered of its making, None when nothing was mapped."""
        self._stop.set()
        self._pairs.close()
        if not self.warm.is_set():
            # What is compiled just now need not be waited for.
            return None
        self._thread.join()
        if self._memory.samples and self.fault is None:
            try:
                self._mapper.finish()
            except MapTooLargeError as error:
                self.fault = error
        return self._memory.mapped(self._mapper.grid, self.fault)

    def _run(self) -> None:
        try:
            self._warm_up()
            while not self._stop.is_set() and not self.ended:
                pair = self._pairs.newest(0.1)
                if pair is not None:
                    self._map(pair)
        except Exception as error:  # whatever fails here must leave robot and recording as they are
            self.fault, self.ended = error, str(error) or repr(error)
        self.warm.set()

    def _warm_up(self) -> None:
        mapper = self._config.build_mapper(self.camera)
        pair = None
        while pair is None:
            if self._stop.is_set():
                return
            pair = self._pairs.newest(0.1)
        for n in range(2):
            mapper.step(self._observation(pair, Odometry(np.eye(4), 0.1 * n)))
        mapper.finish()
        self._pairs.newest(0.0)
        self._dropped_cold = self._pairs.dropped
        self.warm.set()

    def _map(self, pair: RawPair) -> None:
        self.skew_s = pair.skew_s
        if now_s() - pair.stamp_s > STALE_PAIR_S:
            self.counts.stale += 1
            return
        odometry = self._odometry_of(pair)
        if self.ended:
            return
        if odometry is None:
            self.counts.unplaced += 1
        else:
            self._fuse(self._observation(pair, odometry))
            self.latency_s = now_s() - pair.stamp_s

    def _odometry_of(self, pair: RawPair) -> Odometry | None:
        """Where the robot was, once the report after the pair has come; `ended` where that cannot be known any more."""
        reports_s = now_s() + REPORT_WAIT_S
        while (odometry := self._robot.odometry_at(pair.stamp_s)) is None and now_s() < reports_s:
            if self._stop.wait(0.01):
                return None
        # Asked for afterwards: a gap that this pair lies behind has then been noticed.
        latest = self._robot.latest()
        if latest is None:
            return None
        if self._lost is None:
            self._lost = latest.odometry_lost
        if latest.odometry_lost != self._lost:
            self.ended = LOST
        return odometry

    def _observation(self, pair: RawPair, odometry: Odometry) -> Observation:
        left, right = self._rig.rectify(pair.left, pair.right)
        return Observation(pair.stamp_s, left, right, odometry, odometry.T_odom_base @ self._T_base_cam)

    def _fuse(self, observation: Observation) -> None:
        disparity = self._mapper.disparity(observation)
        with self.lock:
            self._mapper.fuse(observation, disparity)
        self._memory.add(observation, disparity)
        self.counts.mapped += 1
        self._shown(observation.left, observation.T_world_cam)


class _Memory:
    """What is remembered of the making of a map, for its figures."""

    def __init__(self) -> None:
        self.samples: list[tuple[Observation, Disparity]] = []
        self._poses: list[FloatArray] = []
        self._stamps_s: list[float] = []
        self._density = 0.0

    def add(self, observation: Observation, disparity: Disparity) -> None:
        self._poses.append(observation.T_world_cam)
        self._stamps_s.append(observation.stamp_s)
        self._density += disparity.density
        # Nobody knows how long the drive will be: of 1, 2, 4, 8, ... one lies near its quarter.
        if len(self._poses) & (len(self._poses) - 1) == 0:
            self.samples.append((observation, disparity))

    def mapped(self, grid: OccupancyGrid, fault: BaseException | None) -> Mapped | None:
        if not self.samples:
            return None
        stopped = fault if isinstance(fault, MapTooLargeError) else None
        sample = self.samples[max(0, len(self.samples) - 3)]
        density = self._density / len(self._poses)
        return Mapped(grid, np.array(self._poses), sample, density, stopped, np.array(self._stamps_s))


def _mounted(rig: Rig) -> FloatArray:
    if rig.T_base_cam is None:
        raise InvalidInputError("the rig does not say where it stands on the robot")
    return rig.T_base_cam
