"""One step of the tyres: the minimum of a convex function, on ground whose height is that of the terrain."""

import numpy as np
import pytest
from scipy.optimize import minimize

pytest.importorskip("pybullet")

from sim.robot import footing, newton
from sim.robot.body import TRACK_M, WHEELBASE_M, Body
from sim.robot.chassis import Chassis
from sim.robot.ground import SURFACES, Surface, find_surface
from sim.scene.terrain import Terrain
from stereogrid.errors import InvalidInputError
from stereogrid.geometry import FloatArray


def problem(seed: int, still: float) -> newton.Step:
    """A step of a robot on some contacts, some of which slide and some of which hold."""
    rng = np.random.default_rng(seed)
    root = rng.standard_normal((8, 8))
    M = root @ root.T + 8 * np.eye(8)
    rows = rng.standard_normal((5, 3, 8))
    load = np.abs(rng.standard_normal((5, 3)))
    load[3, 1:] = 0.0
    spin = np.array([[1.0, 0.05, 0.4, 0.1, 0.01], [-1.0, 0.05, 0.4, 0.1, 0.01]])
    return newton.Step(rng.standard_normal(8), rng.standard_normal(8), M, rows, load, spin, still)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("still", [1e-3, 0.3])
def test_newton_finds_the_minimum_that_a_general_method_finds(seed: int, still: float) -> None:
    step = problem(seed, still)
    v = step.before.copy()
    assert newton.settle(v, step) < newton.MOST_ITERATIONS

    def energy(x: FloatArray) -> float:
        return newton.energy(x, step)

    best = min((minimize(energy, start, tol=1e-10) for start in (step.before, v)), key=lambda found: found.fun)
    assert energy(v) <= best.fun + 1e-9
    assert v == pytest.approx(best.x, abs=1e-3)


def test_the_slope_is_that_of_the_energy_and_the_curvature_that_of_the_slope() -> None:
    step = problem(1, 0.3)
    v = step.before + 0.1
    g, H, ahead, behind, scratch = np.empty(8), np.empty((8, 8)), np.empty(8), np.empty(8), np.empty((8, 8))
    newton.slope(v, step, g, H)
    for k in range(8):
        d = 1e-6 * np.eye(8)[k]
        rise = [newton.energy(v + s * d, step) for s in (1, -1)]
        assert g[k] == pytest.approx((rise[0] - rise[1]) / 2e-6, abs=1e-6)
        newton.slope(v + d, step, ahead, scratch)
        newton.slope(v - d, step, behind, scratch)
        assert H[k] == pytest.approx((ahead - behind) / 2e-6, abs=1e-5)


def test_the_ground_under_the_tyres_is_the_terrain() -> None:
    rng = np.random.default_rng(0)
    terrain = Terrain(rng.standard_normal((5, 7)), (-1.0, 2.0), 0.5, "any")
    origin = np.array([*terrain.origin_m, terrain.pitch_m])
    for x, y in rng.uniform([-1.5, 1.5], [2.5, 4.5], (200, 2)):
        corner = np.array([x, y, terrain.height_m([x, y]) - 0.1])
        foot = np.empty(footing.FOOTING_NUMBERS)
        assert footing.corner_footing(*corner, terrain.heights_m, origin, foot)
        n = foot[3:6]
        assert foot[6] == pytest.approx(0.1 * n[2]) and np.linalg.norm(n) == pytest.approx(1.0)
        assert not footing.corner_footing(x, y, corner[2] + 0.11, terrain.heights_m, origin, foot)


@pytest.mark.parametrize("degrees", [-20.0, 0.0, 3.0, 10.0])
def test_a_wheel_stands_on_a_slope_with_the_point_that_is_nearest_to_it(degrees: float) -> None:
    slope = np.tan(np.radians(degrees))
    heights, origin = slope * np.array([[-1.0, 1.0], [-1.0, 1.0]]), np.array([-1.0, -1.0, 2.0])
    normal = np.array([-slope, 0.0, 1.0]) / np.hypot(slope, 1.0)
    middle = (0.11 - 0.004) * normal
    foot = np.empty(footing.FOOTING_NUMBERS)
    assert footing.tyre_footing(middle, np.array([0.0, 1.0, 0.0]), 0.11, heights, origin, foot)
    assert foot[3:6] == pytest.approx(normal)
    assert foot[6] == pytest.approx(0.004, abs=1e-4)
    assert foot[:3] == pytest.approx(middle - 0.11 * normal, abs=2e-3)
    assert not footing.tyre_footing(0.115 * normal, np.array([0.0, 1.0, 0.0]), 0.11, heights, origin, foot)


def test_a_wheel_that_lies_on_its_side_has_no_footing() -> None:
    flat, foot = np.zeros((2, 2)), np.empty(footing.FOOTING_NUMBERS)
    axle = np.array([0.0, 0.1, 0.995])
    assert not footing.tyre_footing(np.zeros(3), axle, 0.11, flat, np.array([-1.0, -1.0, 2.0]), foot)


def test_the_robot_that_stands_is_borne_by_its_wheels_alone() -> None:
    body = Body(None, Chassis(), SURFACES["vinyl"])
    try:
        loads = body._tyres.loads_n
        assert loads[:4] == pytest.approx(21 * 9.81 / 4, rel=1e-3) and not loads[4:].any()
        assert body._wheels[:, :2] == pytest.approx(
            np.array([(x, y) for y in (1, -1) for x in (1, -1)]) * [WHEELBASE_M / 2, TRACK_M / 2]
        )
    finally:
        body.close()


def test_an_unknown_surface_is_refused_with_the_choices() -> None:
    with pytest.raises(InvalidInputError, match="no surface named 'lava'; choose from: asphalt, carpet"):
        find_surface("lava")
    with pytest.raises(InvalidInputError, match="friction"):
        Surface(friction=0.0, rolling=0.1, creep=0.1)
