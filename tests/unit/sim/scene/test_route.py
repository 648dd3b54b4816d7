"""A rounded way: its stations, its sides and its distances are those of plain geometry."""

import numpy as np
import pytest

from sim.scene.route import SAMPLE_M, Route

CORNERS_M = ((0.0, 0.0), (10.0, 0.0), (10.0, 8.0))


@pytest.fixture
def route() -> Route:
    return Route.rounded(CORNERS_M, 2.0, arc_steps=3)


def test_a_rounded_way_keeps_its_ends_and_cuts_its_corner_by_the_arcs_length(route: Route) -> None:
    assert route.waypoints_m[0].tolist() == [0, 0] and route.waypoints_m[-1] == pytest.approx([10, 8])
    chords = 3 * 2 * 2.0 * np.sin(np.pi / 12)
    assert route.length_m == pytest.approx(8 + chords + 6)
    assert np.linalg.norm(route.waypoints_m[1:-1] - [8.0, 2.0], axis=1) == pytest.approx(2.0)


def test_left_is_left_on_every_leg(route: Route) -> None:
    assert route.at(3.0, 0.5) == pytest.approx([3.0, 0.5])
    assert route.at(route.length_m - 1.0, 0.5) == pytest.approx([9.5, 7.0])
    assert route.at(np.array([-1.0, 1.0])) == pytest.approx(np.array([[-1.0, 0.0], [1.0, 0.0]]))
    assert route.yaw_rad(1.0) == 0 and route.yaw_rad(route.length_m) == pytest.approx(np.pi / 2)


def test_a_parallel_line_is_as_far_from_every_leg_as_it_says(route: Route) -> None:
    for lateral in (-0.8, 0.8):
        side = route.offset(lateral)
        for k, (a, b) in enumerate(zip(route.waypoints_m, route.waypoints_m[1:], strict=False)):
            ahead = (b - a) / np.linalg.norm(b - a)
            for point in side[k : k + 2]:
                assert ahead[0] * (point - a)[1] - ahead[1] * (point - a)[0] == pytest.approx(lateral)


def test_the_nearest_sample_gives_back_station_and_distance(route: Route) -> None:
    stations = np.array([2.0, 7.0, 12.5])
    distance, station = route.nearest(route.at(stations, 0.4))
    assert distance == pytest.approx(0.4, abs=0.01)
    assert station == pytest.approx(stations, abs=2 * SAMPLE_M)
