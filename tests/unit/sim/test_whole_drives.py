"""Every world can be driven from end to end, past its people, without a touch."""

import numpy as np
import pytest

pytest.importorskip("pybullet")
pytest.importorskip("embreex")

from sim import source
from sim.robot.pioneer import Pioneer
from sim.source import Drive
from sim.worlds.world import WORLDS, make_world

MOST_TILT_RAD = np.radians(12.0)
SLOW = {"outdoor"}


@pytest.mark.parametrize("name", [pytest.param(n, marks=[pytest.mark.slow] * (n in SLOW)) for n in WORLDS])
def test_the_robot_drives_the_whole_path_upright_and_touches_nobody(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    touched, stalled, upright = set(), set(), []

    class Watched(Pioneer):
        def drive(self, speed_mps: float, turn_radps: float) -> None:
            super().drive(speed_mps, turn_radps)
            touched.add(self.bumpers)
            stalled.add(self.stalled)
            upright.append(self.T_world_base[2, 2])

    monkeypatch.setattr(source, "Pioneer", Watched)
    world = make_world(name, 0, people=2)
    *_, last = Drive(world).moments()
    assert len(world.movers) >= 2
    assert np.linalg.norm(last.T_world_base[:2, 3] - world.waypoints_m[-1]) < 0.3
    assert touched == {(0, 0)} and stalled == {(False, False)}
    assert min(upright) >= np.cos(MOST_TILT_RAD)
