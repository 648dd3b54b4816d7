"""The calibration's figures show what was measured: arrows, counts, bars, and rows that agree."""

import numpy as np
import pytest
from matplotlib.quiver import Quiver

from stereogrid.calibration import BoardViews, Chessboard, Residuals, StereoCalibration
from stereogrid.figures import calibration_figure, figure_png, rectified_figure
from stereogrid.geometry import from_rotation

BOARD = Chessboard(5, 4, 0.03)
SIZE_PX = (320, 240)
NAMES = tuple("abcdef")


@pytest.fixture(scope="module")
def drawn():
    rng = np.random.default_rng(0)
    corners = tuple(rng.uniform(20, 220, (6, 20, 2)) for _ in "lr")
    off_px = tuple(rng.normal(0, 0.1, (6, 20, 2)) for _ in "lr")
    off_px[0][2] += 3
    found = Residuals(off_px, rng.normal(0, 0.1, (6, 20)), np.ones((6, 31)))
    views = BoardViews(BOARD, SIZE_PX, NAMES, corners, ())
    return calibration_figure(views, found, {"c"}), views, found


def test_each_corner_has_its_arrow_as_many_times_as_long_as_the_title_says(drawn):
    figure, views, found = drawn
    for side, axes in enumerate(figure.axes[:2]):
        (arrows,) = [each for each in axes.collections if isinstance(each, Quiver)]
        times = float(axes.get_title().split(" and ")[1].split()[0])
        np.testing.assert_allclose(arrows.XY, views.corners[side].reshape(-1, 2))
        shown = np.column_stack([arrows.U, arrows.V])
        np.testing.assert_allclose(shown, times * found.off_px[side].reshape(-1, 2))
        # Rows count downwards, as in the picture.
        assert axes.get_ylim() == (239, 0) and len(axes.patches) == len(NAMES)


def test_every_corner_is_counted_and_the_mean_is_told(drawn):
    figure, _, found = drawn
    axes = figure.axes[2]
    assert sum(bar.get_height() for bar in axes.patches) == found.rows_px.size
    assert f"mean {np.abs(found.rows_px).mean():.3f} px" in axes.get_title()


def test_each_pair_has_a_bar_and_the_far_one_stands_out(drawn):
    figure, _, found = drawn
    bars = figure.axes[3].patches
    np.testing.assert_allclose([bar.get_height() for bar in bars], found.rms_px)
    colours = [bar.get_facecolor() for bar in bars]
    assert [colour != colours[0] for colour in colours] == [name == "c" for name in NAMES]
    assert [label.get_text() for label in figure.axes[3].get_xticklabels()] == list(NAMES)
    assert figure_png(figure, 50).startswith(b"\x89PNG")


def test_marks_of_the_right_picture_stand_beside_those_of_the_left_in_the_same_rows():
    K = np.array([[330.0, 0, 159.5], [0, 330.0, 119.5], [0, 0, 1]])
    T = from_rotation(np.eye(3), [-0.06, 0, 0])
    rig = StereoCalibration((K, K), (np.zeros(5),) * 2, T, SIZE_PX)
    points = np.random.default_rng(1).uniform([-0.1, -0.1, 0.6], [0.1, 0.1, 0.9], (20, 3))
    seen = [((points + shift) @ K.T) for shift in ([0, 0, 0], [-0.06, 0, 0])]
    corners = tuple(each[:, :2] / each[:, 2:] for each in seen)
    pair = tuple(np.full((240, 320), gray, np.uint8) for gray in (50, 200))
    (axes,) = rectified_figure(rig, pair, corners).axes
    (picture,) = axes.images
    assert picture.get_array().shape == (240, 640)
    assert picture.get_array()[120, 100] == 50 and picture.get_array()[120, 500] == 200
    left, right = (np.array(line.get_data()) for line in axes.lines[:2])
    np.testing.assert_allclose(left[1], right[1], atol=1e-6)
    assert (right[0] - 320 < left[0]).all() and (right[0] > 320).all()
