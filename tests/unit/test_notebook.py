"""What a notebook shows of our objects, asked by IPython itself."""

import base64
import re

import cv2
import numpy as np
import pytest

import stereogrid as sg
from stereogrid.geometry import R_BASE_OPTICAL, from_rotation, from_yaw
from stereogrid.thumbnails import LARGEST_PX, UNKNOWN_RGB, disparity_picture, layer_picture

CAMERA = sg.StereoCamera(focal_px=40, cx_px=15.5, cy_px=11.5, baseline_m=0.06, width_px=32, height_px=24)
IMAGE = np.arange(24 * 32, dtype=np.uint8).reshape(24, 32)
POSE = from_rotation(R_BASE_OPTICAL, [0.1, 0.03, 0.4])


def disparity() -> sg.Disparity:
    disparity_px = np.full((24, 32), 2.0, np.float32)
    disparity_px[:12] = np.nan
    return sg.Disparity(disparity_px, np.where(np.isnan(disparity_px), np.nan, 0.25))


def observation() -> sg.Observation:
    return sg.Observation(1.5, IMAGE, IMAGE, sg.Odometry(from_yaw(0.5, [1, 2, 0]), 3.0, 0.7), POSE, sg.Truth(POSE))


def grid() -> sg.OccupancyGrid:
    made = sg.OccupancyGrid(cell_m=0.1)
    made.integrate(CAMERA, disparity(), POSE)
    return made


SHOWN = {
    "camera": (CAMERA, r"StereoCamera\(32 x 24 px, focal 40\.00 px, .* baseline 0\.0600 m\)"),
    "disparity": (disparity(), r"Disparity\(32 x 24 px, 50 % matched: 2\.00 to 2\.00 px, median sigma 0\.25 px\)"),
    "observation": (observation(), r"Observation\(at 1\.500 s, pair of 32 x 24 px, camera at \(0\.100, .*with truth\)"),
    "odometry": (observation().odometry, r"Odometry\(\(1\.000, 2\.000, 0\.000\) m, heading 28\.6 deg; travelled .*\)"),
    "truth": (observation().truth, r"Truth\(camera at \(0\.100, 0\.030, 0\.400\) m\)"),
    "grid": (grid(), r"OccupancyGrid\(cell_m=0\.1, \d+ blocks, [\d,]+ known cells, \d\.\d MB\)"),
    "empty": (sg.OccupancyGrid(cell_m=0.1), r"OccupancyGrid\(cell_m=0\.1, 0 blocks, 0 known cells, 0\.\d MB\)"),
    "nothing": (sg.Disparity(np.full((2, 3), np.nan), 1.0), r"Disparity\(3 x 2 px, nothing matched\)"),
}


@pytest.mark.parametrize("name", SHOWN)
def test_a_repr_is_one_short_line_with_shape_and_units(name: str) -> None:
    thing, pattern = SHOWN[name]
    assert re.fullmatch(pattern, repr(thing))
    assert len(repr(thing)) < 140


@pytest.mark.parametrize("name", ["disparity", "observation", "grid"])
def test_a_notebook_shows_a_picture_below_the_repr(name: str) -> None:
    formatters = pytest.importorskip("IPython.core.formatters", reason="needs ipython")
    bundle, _ = formatters.DisplayFormatter().format(SHOWN[name][0])
    assert bundle["text/plain"] == repr(SHOWN[name][0])
    html = bundle["text/html"]
    (data,) = re.findall(r"base64,([^\"]+)\"", html)
    picture = cv2.imdecode(np.frombuffer(base64.b64decode(data), np.uint8), cv2.IMREAD_COLOR)
    assert LARGEST_PX / 2 < max(picture.shape) <= LARGEST_PX and picture.std() > 0
    assert "<script" not in html and "http" not in html


def test_an_empty_map_is_shown_in_words() -> None:
    assert "<img" not in SHOWN["empty"][0]._repr_html_()


def test_a_figure_is_shown_without_pyplot() -> None:
    formatters = pytest.importorskip("IPython.core.formatters", reason="needs ipython")
    bundle, _ = formatters.DisplayFormatter().format(sg.slice_figure(grid(), 0.25))
    assert cv2.imdecode(np.frombuffer(bundle["image/png"], np.uint8), cv2.IMREAD_COLOR).std() > 0


def test_pixels_without_a_match_are_white_and_near_ones_are_warmer() -> None:
    picture = disparity_picture(np.array([[np.nan, 1.0, 20.0]]))
    assert picture[0, 0].tolist() == [255, 255, 255]
    far, near = picture[0, 1].astype(int), picture[0, 2].astype(int)
    assert far[0] > far[2] and near[2] > near[0]


def test_a_layer_has_x_to_the_right_y_upwards_and_unknown_in_its_own_colour() -> None:
    picture = layer_picture(np.array([[5, 7], [6, 8]]), np.array([1.0, 0.0]))
    assert picture[1, 0].tolist() == [0, 0, 0] and picture[0, 1].tolist() == [255, 255, 255]
    assert picture[0, 0].tolist() == picture[1, 1].tolist() == [*UNKNOWN_RGB][::-1]


def test_a_layer_of_any_size_is_a_small_picture_that_keeps_what_is_occupied() -> None:
    picture = layer_picture(np.array([[0, 0], [100_001, 50_000], [100_000, 50_001]]), np.array([0.1, 1.0, 0.1]))
    assert max(picture.shape) <= LARGEST_PX
    assert picture[0, -1].tolist() == [0, 0, 0]
