"""Figures show what the map says: every pixel, face and line is checked against it."""

import cv2
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from stereogrid.errors import InvalidInputError
from stereogrid.figures import (
    cubes_figure,
    disparity_figure,
    figure_png,
    reliability_figure,
    save_figure,
    slice_figure,
    trajectory_figure,
)
from stereogrid.figures.colours import PATH_COLOUR
from stereogrid.figures.cubes import GROUND_COLOUR, eye_behind, frustum_lines_m, look_at
from stereogrid.figures.slices import UNKNOWN_COLOUR
from stereogrid.geometry import R_BASE_OPTICAL, as_pose, from_rotation, from_yaw, inverse, transform
from stereogrid.grid import OccupancyGrid
from stereogrid.observation import Disparity
from stereogrid.scoring.calibration import reliability_table
from stereogrid.sensor_model import SensorModel

from .grid.scenes import CAMERA, FORWARD, random_disparity, random_pose

PATH = np.array([[-1.0, 0, 0], [0, 0, 0], [1.0, 0, 0]])


def drawn_map(seed=3, cell_m=0.1):
    rng = np.random.default_rng(seed)
    grid = OccupancyGrid(cell_m, model=SensorModel(max_range_m=2.0))
    for _ in range(2):
        grid.integrate(CAMERA, random_disparity(rng), random_pose(rng, spread_m=0.3))
    return grid


def grid_of(cells, cell_m=0.1, value=2.0):
    """A map in which just these cells are occupied."""
    return OccupancyGrid.from_cells(cell_m, cells, np.full(len(cells), value))


def collection(figure, kind):
    return [each for each in figure.axes[0].collections if type(each) is kind]


# The slice


@given(seed=st.integers(0, 2**32 - 1), height_m=st.floats(-0.4, 0.4))
@settings(max_examples=8, deadline=None, derandomize=True)
def test_every_pixel_of_the_slice_is_the_maps_probability_at_its_place_in_metres(seed, height_m):
    grid = drawn_map(seed)
    assume((grid.known_cells()[0][:, 2] == np.floor(height_m / grid.cell_m)).any())
    figure = slice_figure(grid, height_m)
    (image,) = figure.axes[0].images
    drawn = np.ma.filled(np.ma.masked_invalid(image.get_array()), np.nan)
    x_low, x_high, y_low, y_high = image.get_extent()
    ny, nx = drawn.shape
    assert ((x_high - x_low) / nx, (y_high - y_low) / ny) == pytest.approx((grid.cell_m, grid.cell_m))
    assert image.origin == "lower"
    x = x_low + (np.arange(nx) + 0.5) * grid.cell_m
    y = y_low + (np.arange(ny) + 0.5) * grid.cell_m
    points = np.array([[a, b, height_m] for b in y for a in x])
    np.testing.assert_array_equal(drawn, grid.probability(points).reshape(ny, nx))
    # All that the map knows at this height is in the picture.
    cells, _ = grid.known_cells()
    assert np.isfinite(drawn).sum() == (cells[:, 2] == np.floor(height_m / grid.cell_m)).sum()


def test_what_is_unknown_is_not_drawn_and_shows_the_background():
    grid = grid_of([[0, 0, 0], [5, 3, 0]])
    figure = slice_figure(grid, 0.05)
    (image,) = figure.axes[0].images
    drawn = np.ma.masked_invalid(image.get_array())
    assert np.ma.count(drawn) == 2
    assert to_rgb(figure.axes[0].get_facecolor()) == to_rgb(UNKNOWN_COLOUR)
    assert image.cmap(np.ma.masked)[3] == 0
    assert image.get_clim() == (0, 1)
    assert [sum(image.cmap(image.norm(p))[:3]) for p in (0.0, 1.0)] == [3.0, 0.0]


def test_the_slices_axes_are_named_in_metres_and_the_path_is_drawn_where_it_lies():
    figure = slice_figure(drawn_map(), 0.0, path_m=PATH, truth_segments_m=np.array([[[0, 0, 0], [1, 1, 0]]]))
    axes = figure.axes[0]
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("x (world) [m]", "y (world) [m]")
    assert axes.get_aspect() == 1
    np.testing.assert_array_equal(axes.lines[0].get_xydata(), PATH[:, :2])
    (truth,) = collection(figure, LineCollection)
    np.testing.assert_array_equal(truth.get_segments(), [[[0, 0], [1, 1]]])
    assert "0.00 m" in axes.get_title()


@pytest.mark.parametrize("grid", [OccupancyGrid(0.1), grid_of([[0, 0, 5]])])
def test_a_slice_through_nothing_known_is_refused(grid):
    with pytest.raises(InvalidInputError, match=r"no cell at z = 0\.00 m"):
        slice_figure(grid, 0.0)


# The cubes


def faces(cells, **options):
    """Polygons of the cubes seen by a camera at the origin that looks along x, from behind and above it."""
    figure = cubes_figure(grid_of(cells), FORWARD, CAMERA, path_m=PATH, **options)
    (polygons,) = collection(figure, PolyCollection)
    return [path.vertices[:4] for path in polygons.get_paths()], polygons.get_facecolor()


def test_of_a_single_cube_the_faces_turned_to_the_eye_are_drawn():
    # The eye stands behind, above and, for this cube, to its left: it sees three faces.
    assert len(faces([[20, -10, 0]])[0]) == 3


@given(size=st.tuples(*[st.integers(1, 5)] * 3))
@settings(max_examples=10, deadline=None, derandomize=True)
def test_of_a_solid_only_the_outer_faces_are_drawn(size):
    nx, ny, nz = size
    cells = np.stack(np.meshgrid(*[np.arange(n) for n in size], indexing="ij"), -1).reshape(-1, 3)
    cells += np.array([20, -20, -3])
    # Its back, its underside and its far side are turned away.
    assert len(faces(cells)[0]) == ny * nz + nx * nz + nx * ny


def test_far_faces_are_drawn_before_near_ones():
    polygons, _ = faces([[20, 0, 0], [60, 0, 0], [10, 0, -5]])
    sizes = [np.ptp(polygon[:, 0]) for polygon in polygons]
    assert sizes[0] < sizes[-1]
    assert np.argmax(sizes) >= len(sizes) - 3
    assert np.argmin(sizes) < 3


def test_a_face_stands_in_the_picture_where_its_corners_project():
    polygons, _ = faces([[20, -10, 0]])
    T_eye_world = inverse(eye_behind(FORWARD, 4.0, 3.0))
    corners = np.array([[20, -10, 0]]) * 0.1 + 0.1 * np.array(
        [[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)]
    )
    seen = transform(T_eye_world, corners)
    expected = seen[:, :2] / seen[:, 2:] * [1, -1]
    for vertex in np.concatenate(polygons):
        assert np.abs(expected - vertex).max(axis=1).min() < 1e-9
    assert len(np.unique(np.concatenate(polygons).round(9), axis=0)) == 7


def test_obstacles_are_blue_the_ground_is_grey_and_what_is_too_high_is_left_out():
    cells = [[20, 0, 0], [22, 5, -10], [24, 0, 30]]
    (polygons, colours), (fewer, _) = faces(cells, ground_m=-0.8), faces(cells, heights_m=(-np.inf, 1.0))
    blue = colours[:, 2] > colours[:, 0] + 0.05
    grey = np.ptp(colours[:, :3] / np.array(GROUND_COLOUR), axis=1) < 0.1
    assert blue.any()
    assert grey.any()
    assert (blue ^ grey).all()
    assert 0 < len(fewer) < len(polygons)


def test_the_camera_is_a_red_frustum_at_its_pose():
    figure = cubes_figure(grid_of([[20, 0, 0]]), FORWARD, CAMERA, path_m=PATH)
    lines = collection(figure, LineCollection)
    assert all(to_rgb(each.get_color()[0][:3]) == to_rgb(PATH_COLOUR) for each in lines)
    T = from_yaw(0.3, [1, 2, 3]) @ FORWARD
    edges = frustum_lines_m(CAMERA, T, depth_m=0.5)
    in_cam = transform(inverse(T), edges)
    np.testing.assert_allclose(in_cam[:4, 0], 0, atol=1e-12)
    np.testing.assert_allclose(in_cam[:4, 1, 2], 0.5)
    corners = CAMERA.project(in_cam[:4, 1])[:, :2]
    np.testing.assert_allclose(corners, [[0, 0], [79, 0], [79, 59], [0, 59]], atol=1e-9)


@given(yaw=st.floats(-3, 3), pitch=st.floats(-1.57, 1.57), back_m=st.floats(0.5, 9), up_m=st.floats(0.5, 9))
@settings(max_examples=40, deadline=None, derandomize=True)
def test_the_viewer_stands_behind_and_above_the_camera_upright(yaw, pitch, back_m, up_m):
    c, s = np.cos(pitch), np.sin(pitch)
    tilt = from_rotation([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    T = from_yaw(yaw, [3, 4, 5]) @ tilt @ FORWARD
    eye = as_pose(eye_behind(T, back_m, up_m))
    offset = eye[:3, 3] - T[:3, 3]
    np.testing.assert_allclose(offset, [-back_m * np.cos(yaw), -back_m * np.sin(yaw), up_m], atol=1e-6 * back_m)
    assert eye[2, 0] == pytest.approx(0, abs=1e-9)
    assert eye[2, 1] < 0


def test_a_camera_that_looks_straight_down_has_a_viewer_too():
    down = from_rotation(R_BASE_OPTICAL @ np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]]))
    assert down[2, 2] == -1
    eye = as_pose(eye_behind(down, 4.0, 3.0))
    # Its image's upper edge looks forward, along x.
    np.testing.assert_allclose(eye[:3, 3], [-4, 0, 3], atol=1e-9)


def test_looking_at_a_point_puts_it_in_the_middle():
    T = as_pose(look_at(np.array([1.0, 2, 3]), np.array([4.0, -2, 1])))
    seen = transform(inverse(T), [[4.0, -2, 1]])[0]
    np.testing.assert_allclose(seen, [0, 0, np.sqrt(29)], atol=1e-9)


@pytest.mark.parametrize("grid", [OccupancyGrid(0.1), grid_of([[20, 0, 0]], value=-1.0), grid_of([[20, 0, 40]])])
def test_a_map_without_an_occupied_cell_to_draw_is_refused(grid):
    with pytest.raises(InvalidInputError, match="no occupied cell"):
        cubes_figure(grid, FORWARD, CAMERA, path_m=PATH, heights_m=(-np.inf, 1.0))


# Disparity and reliability


def test_the_disparity_stands_beside_its_image_with_holes_where_nothing_matched():
    rng = np.random.default_rng(2)
    left = rng.integers(0, 256, CAMERA.shape, dtype=np.uint8)
    disparity = random_disparity(rng, missing=0.25)
    figure = disparity_figure(left, disparity)
    photo, panel = figure.axes[:2]
    np.testing.assert_array_equal(photo.images[0].get_array(), left)
    drawn = np.ma.masked_invalid(panel.images[0].get_array())
    np.testing.assert_array_equal(drawn.mask, ~disparity.valid)
    np.testing.assert_array_equal(drawn.compressed(), disparity.disparity_px[disparity.valid])
    assert "75 %" in panel.get_title()
    assert "[px]" in figure.axes[2].get_ylabel()


def test_an_image_without_a_match_can_be_drawn():
    nothing = Disparity(np.full(CAMERA.shape, np.nan, np.float32), np.float32(0.3))
    figure = disparity_figure(np.zeros(CAMERA.shape, np.uint8), nothing)
    assert "0 %" in figure.axes[1].get_title()
    figure_png(figure, 30)


def test_the_reliability_diagram_draws_the_table_bin_by_bin():
    rng = np.random.default_rng(7)
    p = rng.uniform(0, 1, 500)
    p[p > 0.9] = 0.85
    table = reliability_table(p, rng.random(500) < p)
    figure = reliability_figure(table)
    full = table.count > 0
    assert not full.all()
    np.testing.assert_array_equal(figure.axes[0].lines[1].get_xdata(), table.mean_p[full])
    np.testing.assert_array_equal(figure.axes[0].lines[1].get_ydata(), table.frequency[full])
    assert [bar.get_height() for bar in figure.axes[1].patches] == table.count.tolist()
    assert sum(table.count) == 500


# Files

MAKERS = {
    "slice": lambda: slice_figure(drawn_map(), 0.0, path_m=PATH),
    "cubes": lambda: cubes_figure(drawn_map(), FORWARD, CAMERA, path_m=PATH),
    "disparity": lambda: disparity_figure(np.zeros(CAMERA.shape, np.uint8), random_disparity(np.random.default_rng(2))),
}


@pytest.mark.parametrize("name", MAKERS)
def test_the_same_map_gives_the_same_png_bytes(name, tmp_path):
    figure = MAKERS[name]()
    assert isinstance(figure, Figure)
    png = figure_png(figure, 50)
    assert png == figure_png(MAKERS[name](), 50)
    path = save_figure(MAKERS[name](), tmp_path / "figure.png", 50)
    assert path.read_bytes() == png
    picture = cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_GRAYSCALE)
    assert min(picture.shape) > 50
    assert np.ptp(picture) > 100


def test_a_figure_for_a_folder_that_does_not_exist_is_refused(tmp_path):
    with pytest.raises(InvalidInputError, match="nowhere"):
        save_figure(MAKERS["disparity"](), tmp_path / "nowhere" / "figure.png")


def test_the_trajectory_shows_the_claimed_way_beside_the_true_one_in_metres() -> None:
    path_m = np.stack([np.linspace(0, 4, 9), np.zeros(9), np.full(9, 0.4)], axis=1)
    true_m = path_m + np.array([0.0, 0.3, 0.4])
    true_m[4] = np.nan
    above, height, error = trajectory_figure(path_m, true_path_m=true_m).axes
    lines = {line.get_label(): np.asarray(line.get_xydata()) for line in above.lines}
    assert np.array_equal(lines["claimed"], path_m[:, :2]) and np.array_equal(lines["start"], path_m[:1, :2])
    assert above.get_aspect() == 1
    assert [axes.get_xlabel() for axes in (above, error)] == ["x (world) [m]", "way [m]"]
    way_m, off_m = np.asarray(error.lines[0].get_xydata()).T
    assert way_m[-1] == pytest.approx(4.0)
    assert off_m[~np.isnan(off_m)] == pytest.approx(0.5) and np.isnan(off_m[4])
    assert len(height.lines) == 2


def test_a_level_way_is_no_mountain_and_without_a_truth_no_error_is_drawn() -> None:
    path_m = np.stack([np.linspace(0, 4, 9), np.zeros(9), 0.4 + 1e-4 * np.arange(9)], axis=1)
    for true_m in (None, np.full((9, 3), np.nan)):
        _, height = trajectory_figure(path_m, true_path_m=true_m).axes
        assert np.ptp(height.get_ylim()) >= 0.2
    with pytest.raises(InvalidInputError, match="no way"):
        trajectory_figure(path_m[:1])
