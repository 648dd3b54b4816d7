"""Pairs and odometry that come one by one, and the map that is made of them."""

import time
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from live_rig import DISPARITY_PX
from recorded_rig import CAMERA, RIG
from robot_reports import report

from hardware.cameras.pairs import RawPair
from hardware.clock import now_s
from hardware.live.mapping import LOST, LiveMapper
from hardware.mailbox import Mailbox
from hardware.pioneer.robot import RobotReport
from stereogrid.calibration import RectifiedRig
from stereogrid.config import GridConfig, MappingConfig, MatcherConfig
from stereogrid.errors import InvalidInputError
from stereogrid.geometry import from_yaw
from stereogrid.observation import Observation, Odometry
from stereogrid.sensor_model import SensorModel

CONFIG = MappingConfig(
    matcher=MatcherConfig(num_disparities=32), model=SensorModel(max_range_m=2.5), grid=GridConfig(cell_m=0.1)
)


def wall_pair(stamp_s: float) -> RawPair:
    height, width = CAMERA.shape
    texture = np.kron(np.random.default_rng(5).integers(20, 236, (height // 4, width)), np.ones((4, 4)))
    left, right = (np.ascontiguousarray(texture[:, at : at + width].astype(np.uint8)) for at in (0, DISPARITY_PX))
    return RawPair(left, right, stamp_s, stamp_s)


class Ahead:
    """A robot whose odometry the test knows: along x at .2 m/s, from the moment it was made. known: reports come."""

    def __init__(self) -> None:
        self.start_s, self.known, self.lost = now_s(), True, 0

    def at(self, stamp_s: float) -> Odometry:
        along_m = max(0.2 * (stamp_s - self.start_s), 0.0)
        return Odometry(from_yaw(0.0, [along_m, 0, 0]), along_m)

    def odometry_at(self, stamp_s: float) -> Odometry | None:
        return self.at(stamp_s) if self.known else None

    def latest(self) -> RobotReport:
        return report(stamp_s=now_s(), odometry=self.at(now_s()), odometry_lost=self.lost)


class Live:
    def __init__(self, config: MappingConfig = CONFIG) -> None:
        self.robot, self.pairs = Ahead(), Mailbox[RawPair](2)
        self.shown: list[float] = []
        self.mapper = LiveMapper(
            RIG,
            config,
            self.pairs,
            self.robot,
            shown=lambda _, T_world_cam: self.shown.append(T_world_cam[0, 3]),  # type: ignore[arg-type]
        )

    def warm_up(self) -> None:
        self.mapper.start()
        self.give()
        self.until(self.mapper.warm.is_set, 120)

    def give(self, age_s: float = 0.0) -> RawPair:
        pair = wall_pair(now_s() - age_s)
        self.pairs.put(pair)
        return pair

    def until(self, true: "object", within_s: float = 20) -> None:
        end_s = time.monotonic() + within_s
        while not true():  # type: ignore[operator]
            assert time.monotonic() < end_s, (self.mapper.counts, self.mapper.ended)
            time.sleep(0.005)


@pytest.fixture
def live() -> Iterator[Live]:
    live = Live()
    live.warm_up()
    yield live
    live.mapper.finish()


def test_the_map_is_the_mappers_own_of_the_pairs_at_the_odometry_of_their_moments(live: Live) -> None:
    by_hand = CONFIG.build_mapper(CAMERA)
    for n in range(1, 4):
        pair = live.give()
        live.until(lambda n=n: live.mapper.counts.mapped == n)
        odometry = live.robot.at(pair.stamp_s)
        T_world_cam = odometry.T_odom_base @ RIG.T_base_cam
        by_hand.step(Observation(pair.stamp_s, pair.left, pair.right, odometry, T_world_cam))
    mapped = live.mapper.finish()
    assert mapped is not None and mapped.grid.n_known > 1000
    assert mapped.grid.sha256() == by_hand.grid.sha256()
    assert mapped.path_m[:, 0] == pytest.approx(live.shown)
    assert mapped.density > 0.5 and mapped.sample[1].valid.any() and mapped.stopped is None


def test_the_pair_that_warms_up_is_not_in_the_map(live: Live) -> None:
    assert live.mapper.grid.n_known == 0 and live.mapper.finish() is None


def test_who_cannot_keep_up_takes_the_newest_pair_and_counts_the_others(live: Live) -> None:
    with live.mapper.lock:
        live.give()
        live.until(lambda: len(live.pairs) == 0)
        late = [live.give() for _ in range(5)]
    live.until(lambda: live.mapper.counts.mapped == 2)
    assert live.mapper.dropped == 4
    assert live.shown[-1] == pytest.approx((live.robot.at(late[-1].stamp_s).T_odom_base @ RIG.T_base_cam)[0, 3])


def test_a_pair_waits_for_the_report_after_it(live: Live) -> None:
    live.robot.known = False
    live.give()
    time.sleep(0.05)
    live.robot.known = True
    live.until(lambda: live.mapper.counts.mapped == 1)
    assert live.mapper.counts.unplaced == 0


def test_without_odometry_or_with_an_old_pair_nothing_is_mapped(live: Live) -> None:
    live.robot.known = False
    live.give()
    live.until(lambda: live.mapper.counts.unplaced == 1)
    live.robot.known = True
    live.give(age_s=0.6)
    live.until(lambda: live.mapper.counts.stale == 1)
    assert live.mapper.grid.n_known == 0 and not live.mapper.ended


def test_nothing_is_mapped_across_a_gap_of_the_odometry(live: Live) -> None:
    live.give()
    live.until(lambda: live.mapper.counts.mapped == 1)
    before = live.mapper.grid.sha256()
    live.robot.lost += 1
    live.give()
    live.until(lambda: live.mapper.ended)
    mapped = live.mapper.finish()
    assert live.mapper.ended == LOST
    assert mapped is not None and mapped.grid.sha256() == before and len(mapped.path_m) == 1


def test_a_map_that_outgrows_its_memory_is_kept_as_far_as_it_goes() -> None:
    live = Live(replace(CONFIG, grid=GridConfig(cell_m=0.1, memory_limit_gb=0.0006)))
    live.warm_up()
    for _ in range(40):
        live.robot.start_s -= 5.0
        live.give()
        time.sleep(0.05)
        if live.mapper.ended:
            break
    mapped = live.mapper.finish()
    assert "its limit is 0.0006 GB" in live.mapper.ended
    assert mapped is not None and mapped.stopped is not None and mapped.grid.n_known > 1000


def test_who_ends_before_it_is_warm_does_not_wait_for_it() -> None:
    live = Live()
    live.mapper.start()
    start_s = time.monotonic()
    assert live.mapper.finish() is None
    assert time.monotonic() - start_s < 2.0


def test_a_rig_that_hangs_in_the_air_is_refused() -> None:
    with pytest.raises(InvalidInputError, match="where it stands"):
        LiveMapper(RectifiedRig(CAMERA), CONFIG, Mailbox(1), Ahead())  # type: ignore[arg-type]
