"""People in a world: closed bodies, ways free of what stands, and no meeting with a robot that keeps to its plan."""

import numpy as np
import pytest

from sim.scene.movers import Mover
from sim.scene.scene import World
from sim.scene.solids import Paint, box
from sim.scene.textures import Texture
from sim.worlds.bodies import person, trolley
from sim.worlds.clearance import Clearance
from sim.worlds.people import APART_M, SPEEDS_MPS, START_APART_M, with_people
from stereogrid.errors import InvalidInputError
from stereogrid.geometry import FloatArray, transform

SEEDS = range(10)


def room(*obstacles: tuple[str, tuple[float, float, float], tuple[float, float, float]]) -> World:
    """A room of 16 x 10 m with a path of two legs, and boxes in it."""
    walls = [
        ("south", (-3.0, -3.2, 0.0), (13.0, -3.0, 2.6)),
        ("north", (-3.0, 7.0, 0.0), (13.0, 7.2, 2.6)),
        ("west", (-3.2, -3.2, 0.0), (-3.0, 7.2, 2.6)),
        ("east", (13.0, -3.2, 0.0), (13.2, 7.2, 2.6)),
    ]
    solids = [box(name, low, high, Paint("grey")) for name, low, high in (*walls, *obstacles)]
    solids.append(box("floor", (-4.0, -4.0, -0.1), (14.0, 8.0, 0.0), Paint("grey")))
    textures = {"grey": Texture(np.full((2, 2), 128, np.uint8))}
    return World("room", 3, tuple(solids), textures, (), np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 5.0]]))


CROWDED = (("desk", (2.0, 1.2, 0.7), (5.0, 2.4, 0.75)), ("lamp", (6.0, 1.0, 2.2), (7.0, 2.0, 2.4)))


@pytest.fixture(scope="module", params=SEEDS)
def crowd(request: pytest.FixtureRequest) -> World:
    return with_people(room(*CROWDED), 4, request.param)


@pytest.mark.parametrize("seed", SEEDS)
def test_bodies_are_closed_and_as_large_as_people_are(seed: int) -> None:
    for body in (person(np.random.default_rng(seed)), trolley(np.random.default_rng(seed))):
        for solid in body:
            mesh = solid.mesh()
            assert mesh.is_watertight and mesh.volume > 0, solid.name
            assert len(mesh.split()) == 1
        points = np.concatenate([solid.vertices_m for solid in body])
        assert -0.005 <= points[:, 2].min() <= 0.02 and 1.5 <= points[:, 2].max() <= 2.0
        assert 0.4 <= np.ptp(points[:, 1]) <= 0.75
    volume = sum(solid.mesh().volume for solid in person(np.random.default_rng(seed)))
    assert 0.04 <= volume <= 0.16


@pytest.mark.parametrize("seed", SEEDS)
def test_faces_of_bodies_are_flat(seed: int) -> None:
    for solid in trolley(np.random.default_rng(seed)):
        for face in solid.faces:
            points = solid.vertices_m[list(face.corners)]
            normal = np.cross(face.t_axis, face.s_axis)
            assert np.ptp(points @ normal) <= 1e-6, solid.name


def test_nobody_walks_through_what_stands(crowd: World) -> None:
    for mover in crowd.movers:
        outline = np.concatenate([solid.vertices_m for solid in mover.solids])
        for time_s in np.linspace(0, 60, 200):
            points = transform(crowd.T_world_mover(mover, float(time_s)), outline)
            for solid in crowd.solids[:-1]:
                low, high = solid.vertices_m.min(axis=0), solid.vertices_m.max(axis=0)
                assert not ((points > low) & (points < high)).all(axis=1).any(), (mover.name, solid.name)


def test_who_drives_as_planned_meets_nobody(crowd: World) -> None:
    # 0.4 m/s along the path, as the follower does but for starts and turns, which the plan allows for.
    for time_s in np.linspace(0.5, 24.0, 95):
        robot = np.array([0.4 * time_s, 0.0])
        for mover in crowd.movers:
            assert np.linalg.norm(crowd.T_world_mover(mover, float(time_s))[:2, 3] - robot) >= APART_M - 0.3


def test_people_start_away_from_the_robot_and_walk_at_a_walking_pace(crowd: World) -> None:
    assert len(crowd.movers) == 4 and len({mover.name for mover in crowd.movers}) == 4
    for mover in crowd.movers:
        assert np.linalg.norm(crowd.T_world_mover(mover, 0.0)[:2, 3]) >= START_APART_M
        assert SPEEDS_MPS[0] <= mover.speed_mps <= SPEEDS_MPS[1]


def test_people_keep_apart_from_each_other(crowd: World) -> None:
    for time_s in np.linspace(0, 30, 100):
        at = np.array([crowd.T_world_mover(mover, float(time_s))[:2, 3] for mover in crowd.movers])
        gaps = np.linalg.norm(at[:, None] - at[None], axis=2) + 9 * np.eye(len(at))
        assert gaps.min() >= APART_M - 0.15


def test_what_people_wear_is_in_the_world_and_the_rest_is_as_it_was(crowd: World) -> None:
    alone = room(*CROWDED)
    assert all(face.texture in crowd.textures for m in crowd.movers for solid in m.solids for face in solid.faces)
    assert np.array_equal(crowd.vertices_m, alone.vertices_m)
    assert crowd.textures["grey"] is not None and alone.movers == ()


def test_the_same_seed_gives_the_same_people_and_another_seed_others() -> None:
    first, again, other = (with_people(room(), 3, seed) for seed in (5, 5, 6))
    assert ways(first) == ways(again) != ways(other)
    for a, b in zip(first.movers, again.movers, strict=True):
        assert all(np.array_equal(s.vertices_m, t.vertices_m) for s, t in zip(a.solids, b.solids, strict=True))


def test_people_are_added_to_those_already_there() -> None:
    some = with_people(room(), 2, 0)
    more = with_people(some, 2, 1)
    assert more.movers[:2] == some.movers and len({mover.name for mover in more.movers}) == 4


def test_too_many_people_and_negative_numbers_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sim.worlds.people.TRIES", 40)
    with pytest.raises(InvalidInputError, match=r"'room' has no room for 500 people, only for \d+"):
        with_people(room(), 500, 0)
    with pytest.raises(InvalidInputError, match="must be >= 0"):
        with_people(room(), -1, 0)


def test_clearance_is_the_distance_from_what_is_in_the_way_and_nothing_from_what_hangs_or_lies() -> None:
    clearance = Clearance(room(("crate", (4.0, 1.0, 0.0), (5.0, 2.0, 0.5)), *CROWDED[1:]))
    assert clearance.at([4.5, 0.0]) == pytest.approx(1.0, abs=0.08)
    assert clearance.at([4.5, 1.5]) == 0.0
    # The lamp hangs too high, so that the crate is the nearest.
    assert clearance.at([6.5, 1.5]) == pytest.approx(1.5, abs=0.08)
    # Outside of the room nobody gets.
    assert clearance.at([[4.5, -5.0], [500.0, 0.0]]).tolist() == [0.0, 0.0]


def ways(world: World) -> list[tuple[FloatArray, ...]]:
    return [(m.waypoints_m.tobytes(), m.speed_mps, m.start_m) for m in world.movers]


def test_a_mover_of_several_legs_is_kept_away_from_too() -> None:
    corners = np.array([[3.0, 3.0], [6.0, 3.0], [6.0, 5.0]])
    guard = Mover("guard", person(np.random.default_rng(0)), corners, 0.8)
    alone = room()
    world = World(**{**{f: getattr(alone, f) for f in alone.__dataclass_fields__}, "movers": (guard,)})
    crowd = with_people(world, 3, 2)
    for time_s in np.linspace(0, 30, 100):
        guard_at = crowd.T_world_mover(guard, float(time_s))[:2, 3]
        for mover in crowd.movers[1:]:
            assert np.linalg.norm(crowd.T_world_mover(mover, float(time_s))[:2, 3] - guard_at) >= APART_M - 0.15
