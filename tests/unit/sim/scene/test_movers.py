"""Movers: where they are follows from the time, without a leap in place or heading."""

from dataclasses import replace

import numpy as np
import pytest
from plain_worlds import block, world

from sim.robot.body import STEP_S, STEPS_A_TICK
from sim.robot.obstacles import place
from sim.robot.pioneer import Pioneer
from sim.scene.movers import TURN_RADPS, Mover
from stereogrid.geometry import FloatArray, yaw_rad

BODY = (block((-0.1, -0.1, 0.0), (0.1, 0.1, 1.0)),)
WAYS = {
    "straight": [[1.0, 2.0], [4.0, 2.0]],
    "bends both ways": [[0.0, 0.0], [2.0, 0.0], [2.0, 1.5], [4.0, 2.0], [1.0, 5.0]],
    "there and back on itself": [[0.0, 0.0], [3.0, 0.0], [1.0, 0.0]],
    "a needless point": [[0.0, 0.0], [0.0, 1.0], [0.0, 2.0]],
}


def mover(name: str, *, speed_mps: float = 1.25, start_m: float = 0.4) -> Mover:
    return Mover(name, BODY, np.array(WAYS[name]), speed_mps, start_m)


def wrapped(angle_rad: FloatArray) -> FloatArray:
    return np.remainder(angle_rad + np.pi, 2 * np.pi) - np.pi


def round_s(walker: Mover) -> float:
    """How long it takes to be back: the way twice, and every turn."""
    legs = np.diff(walker.waypoints_m, axis=0)
    headings = np.arctan2(legs[:, 1], legs[:, 0])
    turns_rad = 2 * np.abs(wrapped(np.diff(headings))).sum() + 2 * np.pi
    return float(2 * np.linalg.norm(legs, axis=1).sum() / walker.speed_mps + turns_rad / TURN_RADPS)


@pytest.mark.parametrize("name", WAYS)
def test_place_and_heading_never_change_faster_than_walking_and_turning(name: str) -> None:
    walker, step_s = mover(name), 0.004
    times_s = np.arange(0.0, 2.2 * round_s(walker), step_s)
    poses = np.array([walker.T_world_mover(float(t)) for t in times_s[::7]])
    steps = np.linalg.norm(np.diff(poses[:, :2, 3], axis=0), axis=1) / (7 * step_s)
    turns = wrapped(np.diff([yaw_rad(T) for T in poses])) / (7 * step_s)
    assert steps.max() == pytest.approx(walker.speed_mps, abs=1e-6)
    assert np.abs(turns).max() == pytest.approx(TURN_RADPS, abs=1e-6)


@pytest.mark.parametrize("name", WAYS)
def test_it_looks_where_it_walks_and_turns_on_the_spot(name: str) -> None:
    walker, step_s = mover(name), 0.004
    # Within a round: at its end whole turns are taken off the heading.
    start_s = 0.4 / walker.speed_mps
    places = walker.places(np.arange(0.0, round_s(walker) - start_s, step_s))
    steps = np.diff(places, axis=0)
    walked = np.linalg.norm(steps[:, :2], axis=1) / step_s
    walks, turns = walked > walker.speed_mps - 1e-6, np.abs(steps[:, 2]) / step_s > TURN_RADPS - 1e-6
    assert not (walks & turns).any() and (walks | turns).mean() > 0.98
    ahead = np.arctan2(steps[walks, 1], steps[walks, 0])
    assert np.abs(wrapped(ahead - places[1:][walks, 2])).max() < 1e-6
    assert walked[turns].max() < 1e-9


@pytest.mark.parametrize("name", WAYS)
def test_it_comes_by_every_point_of_its_way_and_is_back_after_a_round(name: str) -> None:
    walker = mover(name)
    times_s = np.linspace(0.0, round_s(walker), 4001)
    places = walker.places(times_s)[:, :2]
    for point in walker.waypoints_m:
        assert np.linalg.norm(places - point, axis=1).min() < 0.01
    for time_s in (0.0, 1.7, 4.4):
        after = walker.T_world_mover(time_s + round_s(walker))
        np.testing.assert_allclose(after, walker.T_world_mover(time_s), atol=1e-9)


def test_it_starts_where_it_is_told_on_its_way_there_or_back() -> None:
    walker = mover("straight")
    there, back = walker.T_world_mover(0.0), replace(walker, start_m=5.0).T_world_mover(0.0)
    assert there[:2, 3] == pytest.approx([1.4, 2.0]) and yaw_rad(there) == pytest.approx(0.0)
    assert back[:2, 3] == pytest.approx([2.0, 2.0]) and abs(yaw_rad(back)) == pytest.approx(np.pi)
    assert replace(walker, start_m=11.0).T_world_mover(0.3) == pytest.approx(
        replace(walker, start_m=5.0).T_world_mover(0.3)
    )


def test_one_without_speed_stands_still() -> None:
    stands = mover("bends both ways", speed_mps=0.0, start_m=2.5)
    assert np.ptp(stands.places(np.linspace(0.0, 100.0, 50)), axis=0).tolist() == [0.0, 0.0, 0.0]
    assert stands.T_world_mover(7.0)[:2, 3] == pytest.approx([2.0, 0.5])


def test_the_physics_turns_and_moves_it_evenly_in_every_step(monkeypatch: pytest.MonkeyPatch) -> None:
    placed = []

    def watch(body: int, T_world_body: FloatArray, client: int) -> None:
        place(body, T_world_body, client)
        placed.append(T_world_body)

    monkeypatch.setattr("sim.robot.body.place", watch)
    walker = Mover("walker", BODY, np.array([[3.0, 0.8], [3.0, 1.6]]), 1.0, start_m=0.6)
    with Pioneer(world(movers=(walker,))) as robot:
        placed.clear()
        for _ in range(60):
            robot.coast()
    assert len(placed) == 60 * STEPS_A_TICK
    turns = wrapped(np.diff([yaw_rad(T) for T in placed]))
    steps = np.diff([T[:2, 3] for T in placed], axis=0)
    assert np.abs(turns).max() == pytest.approx(TURN_RADPS * STEP_S, rel=1e-6)
    assert np.linalg.norm(steps, axis=1).max() == pytest.approx(1.0 * STEP_S, rel=1e-6)
