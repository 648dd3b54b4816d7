"""Twenty greens: nothing on the path, no slope too steep, roots in the ground, no world too large."""

import gc
import re
from collections.abc import Iterator

import numpy as np
import pytest
from numpy.typing import NDArray

from sim.scene.route import SAMPLE_M, Route
from sim.scene.solids import Solid, fan
from sim.worlds.outdoor import Site, furnished
from stereogrid.geometry import FloatArray

CLEARANCE_M = 0.6
LOW_M, HIGH_M = 0.05, 0.6
"""What is lower a wheel rolls over, what is higher the robot passes under."""

STEEPEST_RAD = np.deg2rad(10.0)
ROOTED = r"trunk$|bush \d+ core|lamp post \d foot|leg|stem|shaft|slat|fence post|low wall \d|hall|wall$"


@pytest.fixture(scope="module", params=range(20))
def green(request: pytest.FixtureRequest) -> Iterator[tuple[Site, tuple[Solid, ...]]]:
    # A hundred thousand small objects that are all kept: looking for garbage among them doubles the time.
    gc.disable()
    yield furnished(request.param)
    gc.enable()


def test_nothing_stands_on_the_path_for_any_seed(green: tuple[Site, tuple[Solid, ...]]) -> None:
    site, solids = green
    obstacles = [s for s in solids[1:] if not s.name.startswith("path") and _may_block(site, s)]
    corners = [_triangles(s) for s in obstacles]
    triangles = np.concatenate([s.vertices_m[c] for s, c in zip(obstacles, corners, strict=True)])
    owner = np.repeat(np.arange(len(obstacles)), [len(c) for c in corners])
    above = triangles[..., 2] - site.terrain.height_m(triangles[..., :2])
    reached = np.flatnonzero((above.max(axis=1) > LOW_M) & (above.min(axis=1) < HIGH_M))
    gap = _gap_m(site.route, triangles[reached, :, :2])
    assert CLEARANCE_M < gap.min() < 2.0, obstacles[owner[reached[gap.argmin()]]].name


def test_the_path_is_never_steeper_than_ten_degrees_and_nearly_so_on_the_mound(
    green: tuple[Site, tuple[Solid, ...]],
) -> None:
    site, _ = green
    heights_m = site.terrain.height_m(site.route.at(np.arange(0.0, site.route.length_m, 0.2)))
    slope = np.abs(np.arctan(np.diff(heights_m) / 0.2))
    assert np.deg2rad(8.0) < slope.max() < STEEPEST_RAD
    left, right = (site.terrain.height_m(site.route.at(np.arange(0.0, 62.0, 0.1), side)) for side in (0.3, -0.3))
    assert np.abs(np.arctan((left - right) / 0.6)).max() < np.deg2rad(4.0)


def test_what_stands_outdoors_has_its_feet_in_the_ground(green: tuple[Site, tuple[Solid, ...]]) -> None:
    site, solids = green
    standing = [s for s in solids if re.search(ROOTED, s.name) and "roof" not in s.name]
    assert len([s for s in standing if "trunk" in s.name]) >= 8
    for solid in standing:
        above = solid.vertices_m[:, 2] - site.terrain.height_m(solid.vertices_m[:, :2])
        assert above.min() < -0.02 and above.max() > 0, solid.name


def test_a_world_is_no_larger_than_its_budget(green: tuple[Site, tuple[Solid, ...]]) -> None:
    assert sum(len(solid.faces) for solid in green[1]) <= 130_000


def _may_block(site: Site, solid: Solid) -> bool:
    """Whether some of it is neither under the wheels nor overhead, and its bounds reach the path."""
    above = solid.vertices_m[:, 2] - site.terrain.height_m(solid.vertices_m[:, :2])
    low, high = solid.vertices_m[:, :2].min(axis=0), solid.vertices_m[:, :2].max(axis=0)
    reach = float(np.linalg.norm(high - low)) / 2 + 2 * CLEARANCE_M
    return bool(above.max() > LOW_M and above.min() < HIGH_M and site.route.nearest((low + high) / 2)[0] < reach)


def _triangles(solid: Solid) -> NDArray[np.int64]:
    corners = [face.corners for face in solid.faces]
    return np.array(corners) if all(len(c) == 3 for c in corners) else np.concatenate([fan(c) for c in corners])


def _gap_m(route: Route, triangles_m: FloatArray) -> FloatArray:
    """How far triangles (M, 3, 2) are from the route, both seen from above; infinite where it is more than enough."""
    middle = triangles_m.mean(axis=1)
    reach = np.linalg.norm(triangles_m - middle[:, None], axis=2).max(axis=1)
    gap = np.full(len(triangles_m), np.inf)
    near = np.flatnonzero(route.nearest(middle)[0] < reach + CLEARANCE_M + SAMPLE_M)
    for a, b in ((0, 1), (1, 2), (2, 0)):
        start, along = triangles_m[near, a], triangles_m[near, b] - triangles_m[near, a]
        away = route.samples_m[None] - start[:, None]
        share = (away * along[:, None]).sum(axis=2) / ((along**2).sum(axis=1)[:, None] + 1e-12)
        nearest = np.clip(share, 0, 1)[..., None] * along[:, None]
        gap[near] = np.minimum(gap[near], np.linalg.norm(away - nearest, axis=2).min(axis=1))
    return gap
