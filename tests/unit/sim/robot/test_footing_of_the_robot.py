"""The robot on uneven ground, with a load, on what stands there; and what happens when it falls."""

import numpy as np
import pytest

pytest.importorskip("pybullet")

from plain_worlds import GREY, block, world

from sim.robot import obstacles
from sim.robot.chassis import MASS_KG, Chassis
from sim.robot.pioneer import Pioneer, SimulationError
from sim.robot.turning import rough, slope
from sim.scene.solids import box
from sim.scene.terrain import Terrain
from stereogrid.errors import InvalidInputError
from stereogrid.geometry import yaw_rad


@pytest.mark.parametrize("seed", range(3))
def test_the_robot_starts_on_the_ground_at_the_origin(seed: int) -> None:
    bumpy = rough(seed)
    with Pioneer(bumpy) as robot:
        T = robot.T_world_base
    assert np.hypot(*T[:2, 3]) < 0.005 and abs(yaw_rad(T)) < 0.01
    wheels = T[:3, 3] + np.array([(x, y, 0.0) for x in (0.134, -0.134) for y in (0.199, -0.199)]) @ T[:3, :3].T
    above = wheels[:, 2] - bumpy.ground_height_m(wheels[:, :2])
    assert above.min() > -0.01 and above.max() < 0.03


def test_the_robot_starts_level_on_a_plane_with_its_base_on_the_ground() -> None:
    with Pioneer() as robot:
        assert robot.T_world_base == pytest.approx(np.eye(4), abs=2e-3)


def test_a_robot_that_starts_on_a_slab_stands_on_it() -> None:
    with Pioneer(world(block((-2.0, -2.0, 0.0), (5.0, 2.0, 0.06)))) as robot:
        for k in range(120):
            robot.drive(min(0.4, 0.02 * k), 0.0)
        assert robot.T_world_base[2, 3] == pytest.approx(0.06, abs=0.004)
        assert robot.T_world_base[0, 3] == pytest.approx(robot.odometry.travelled_m, rel=1e-3)


@pytest.mark.parametrize("payload_kg", [0.0, 12.0])
def test_a_parked_robot_stays_on_a_slope_of_ten_degrees(payload_kg: float) -> None:
    with Pioneer(slope(10), payload_kg=payload_kg) as robot:
        start = robot.T_world_base[:3, 3]
        for _ in range(150):
            robot.drive(0.0, 0.0)
        assert np.linalg.norm(robot.T_world_base[:3, 3] - start) < 5 * 1e-4


def test_the_robot_climbs_ten_degrees_with_little_slip() -> None:
    with Pioneer(slope(10)) as robot:
        for k in range(150):
            robot.drive(min(0.4, 0.02 * k), 0.0)
        way_m = np.linalg.norm(robot.T_world_base[:3, 3])
        assert 0.99 < way_m / robot.odometry.travelled_m < 1.0


def test_a_kerb_of_four_centimetres_is_climbed_and_one_of_twelve_is_not() -> None:
    heights = {}
    for kerb in (0.04, 0.12):
        with Pioneer(world(block((0.8, -5.0, 0.0), (9.0, 5.0, kerb)))) as robot:
            for k in range(180):
                robot.drive(min(0.4, 0.02 * k), 0.0)
            heights[kerb] = robot.T_world_base[2, 3]
    assert heights[0.04] == pytest.approx(0.04, abs=0.005) and heights[0.12] < 0.02


def test_what_is_soft_is_driven_through() -> None:
    hedge = box("hedge", (0.6, -1.0, 0.0), (0.8, 1.0, 1.0), GREY, soft=True)
    with Pioneer(world(hedge)) as robot:
        for _ in range(120):
            robot.drive(0.4, 0.0)
        assert robot.T_world_base[0, 3] > 1.4


def test_many_leaves_make_no_body_and_a_large_mesh_is_split(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(obstacles, "MOST_VERTICES", 100)
    made: list[tuple[int, int]] = []
    monkeypatch.setattr(obstacles, "_static", lambda v, t, client: made.append((len(v), int(t.max()))) or 0)
    posts = [block((k, 1.0, 0.0), (k + 0.1, 1.1, 1.0)) for k in range(30)]
    leaves = [box("leaf", (k, 2.0, 0.1), (k + 0.1, 2.01, 0.2), GREY, soft=True) for k in range(500)]
    rug = block((1.0, -1.0, -0.01), (2.0, 1.0, 0.004))
    obstacles.build_solids(world(*posts, *leaves, rug), 0)
    assert sum(count for count, _ in made) == 8 * 31
    assert all(count <= 100 and last == count - 1 for count, last in made)
    made.clear()
    obstacles.build_ground(Terrain(np.zeros((40, 10)), (0.0, 0.0), 1.0, "grey"), 0)
    assert len(made) > 1 and all(count <= 100 for count, _ in made)


def test_the_ground_of_the_sonars_is_the_terrain(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(obstacles, "MOST_VERTICES", 30)
    terrain = Terrain(np.random.default_rng(0).standard_normal((9, 7)), (-2.0, 1.0), 0.5, "grey")
    triangles = np.concatenate([v[t] for v, t in obstacles._bands(terrain)])
    assert len(triangles) == 2 * 8 * 6
    middles = triangles.mean(axis=1)
    assert middles[:, 2] == pytest.approx(terrain.height_m(middles[:, :2]))
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    assert (normals[:, 2] > 0).all() and normals[:, 2].sum() / 2 == pytest.approx(4.0 * 3.0)


def test_a_robot_that_drives_over_an_edge_tips_over_and_says_where() -> None:
    heights = np.tile(np.where(np.arange(81) <= 30, 1.0, 0.0), (81, 1))
    with (
        Pioneer(world(terrain=Terrain(heights, (-2.0, -4.0), 0.1, "grey"))) as robot,
        pytest.raises(SimulationError, match=r"tipped over at x = [01]\.\d\d m, y = -?0\.0\d m after \d\.\d s"),
    ):
        for _ in range(300):
            robot.drive(0.5, 0.0)


def test_a_robot_that_leaves_the_terrain_says_where() -> None:
    small = Terrain(np.zeros((3, 3)), (-1.0, -1.0), 1.0, "grey")
    with Pioneer(world(terrain=small)) as robot, pytest.raises(SimulationError, match=r"left the ground at x = 1\.0"):
        for _ in range(300):
            robot.drive(0.5, 0.0)


def test_a_payload_raises_the_centre_of_mass_and_its_sum() -> None:
    com_m, mass = Chassis().balance()
    assert mass[0] == pytest.approx(MASS_KG) and com_m[:2] == pytest.approx([0, 0])
    loaded_m, loaded = Chassis(payload_kg=12.0).balance()
    assert loaded[0] == pytest.approx(MASS_KG + 12) and (loaded[1:] > mass[1:]).all()
    assert loaded_m[2] == pytest.approx((MASS_KG * com_m[2] + 12 * 0.374) / (MASS_KG + 12))
    assert Chassis(mass_kg=12.0).balance()[1][0] == pytest.approx(12.0)


@pytest.mark.parametrize(("kind", "value"), [("payload_kg", -1.0), ("payload_kg", 12.5), ("mass_kg", 3.0)])
def test_a_load_out_of_range_is_refused(kind: str, value: float) -> None:
    with pytest.raises(InvalidInputError, match=kind):
        Pioneer(**{kind: value})  # type: ignore[arg-type]
    with pytest.raises(InvalidInputError, match=kind):
        Pioneer(**{kind: np.nan})  # type: ignore[arg-type]
