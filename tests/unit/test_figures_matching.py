"""Figures that compare matchers show what the numbers say."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as nps
from matplotlib.colors import to_hex

from stereogrid.errors import InvalidInputError
from stereogrid.figures import TradeoffPoint, figure_png, panels_figure, slices_figure, tradeoff_figure
from stereogrid.figures.panels import ERROR_CLASSES, error_classes
from stereogrid.grid import OccupancyGrid

NAN = np.nan
NAMES = [name for name, _ in ERROR_CLASSES]


def classes(found, truth, visible, hidden):
    numbers = error_classes(
        np.array([found], np.float32), np.array([truth], float), np.array([visible]), np.array([hidden])
    )
    return [NAMES[n] for n in numbers[0]]


def test_every_kind_of_pixel_has_its_name():
    found = [10, 10.5, 10.6, 11.0, 11.1, 12.0, 13, 14.5, 6.5, NAN, 10, NAN, 10, NAN]
    visible = [True] * 10 + [False] * 4
    hidden = [False] * 10 + [True, True, False, False]
    assert classes(found, [10.0] * 12 + [NAN] * 2, visible, hidden) == [
        *["off by up to 0.5 px"] * 2,
        *["0.5 to 1 px"] * 2,
        *["1 to 2 px"] * 2,
        "2 to 4 px",
        "more than 4 px",
        "2 to 4 px",
        "no match",
        "occluded, matched",
        "occluded, no match",
        *["not judged"] * 2,
    ]


images = nps.arrays(np.float32, (4, 6), elements=st.one_of(st.just(NAN), st.floats(1, 20, width=32)))


@given(images, nps.arrays(np.int8, (4, 6), elements=st.integers(0, 2)))
def test_pixels_that_are_bad_by_2_px_are_those_of_the_two_darkest_classes(found, kind):
    truth = np.full(found.shape, 10.0)
    numbers = error_classes(found, truth, kind == 1, kind == 2)
    with np.errstate(invalid="ignore"):
        np.testing.assert_array_equal((numbers == 3) | (numbers == 4), (kind == 1) & (np.abs(found - truth) > 2))
    np.testing.assert_array_equal(numbers == NAMES.index("not judged"), kind == 0)


def panels(n=3):
    rng = np.random.default_rng(0)
    left = rng.integers(0, 256, (30, 50, 3), dtype=np.uint8)
    truth = rng.uniform(1, 20, (30, 50))
    found = {f"m{k}": np.where(rng.random((30, 50)) < 0.1, NAN, truth + 0.3 * k).astype(np.float32) for k in range(n)}
    visible = rng.random((30, 50)) < 0.8
    return left, truth, found, panels_figure(left, truth, found, masks=(visible, ~visible))


def test_panels_show_the_image_in_its_colours_and_all_disparities_to_one_scale():
    left, truth, found, figure = panels()
    drawn = [axes.images[0] for axes in figure.axes[:8]]
    np.testing.assert_array_equal(drawn[0].get_array(), left[..., ::-1])
    disparities = [drawn[4], *drawn[1:4]]
    for image, expected in zip(disparities, [truth, *found.values()], strict=True):
        np.testing.assert_array_equal(np.ma.filled(image.get_array(), NAN), expected)
        assert image.get_clim() == (0, truth.max())
    assert [axes.get_title() for axes in figure.axes[1:4]] == list(found)


def test_the_legend_of_the_panels_has_the_colours_that_are_drawn():
    *_, figure = panels(1)
    error = figure.axes[3].images[0]
    assert [to_hex(error.to_rgba(n)) for n in range(len(ERROR_CLASSES))] == [colour for _, colour in ERROR_CLASSES]
    assert [text.get_text() for text in figure.legends[0].get_texts()] == NAMES


@pytest.mark.parametrize("n", [1, 4])
def test_nothing_overlaps_in_the_panels(n):
    *_, figure = panels(n)
    figure_png(figure)
    renderer = figure.canvas.get_renderer()
    boxes = [axes.get_tightbbox(renderer) for axes in figure.axes] + [figure.legends[0].get_window_extent(renderer)]
    for k, box in enumerate(boxes):
        assert not any(box.shrunk(0.99, 0.99).overlaps(other.shrunk(0.99, 0.99)) for other in boxes[k + 1 :])


POINTS = [
    TradeoffPoint("bm", "teddy", 0.01, 10.0),
    TradeoffPoint("gc", "teddy", 0.7, 3.0),
    TradeoffPoint("bm", "venus", 0.02, 2.0, 1.5, 3.0),
    TradeoffPoint("gc", "venus", 0.8, 0.3),
]


def drawn_points(figure):
    """(marker, colour, x, y) of each point."""
    (axes,) = figure.axes
    lines = [line for line in axes.lines if line.get_marker() in "os"]
    return [(line.get_marker(), to_hex(line.get_color()), *line.get_xdata(), *line.get_ydata()) for line in lines]


def test_each_point_stands_at_its_cost_and_quality_with_a_marker_a_method_and_a_colour_a_scene():
    drawn = drawn_points(tradeoff_figure(POINTS, cost="s", quality="%"))
    assert [(x, y) for *_, x, y in drawn] == [(p.cost, p.quality) for p in POINTS]
    marker, colour = ([d[k] for d in drawn] for k in (0, 1))
    assert marker[0] == marker[2] != marker[1] == marker[3]
    assert colour[0] == colour[1] != colour[2] == colour[3]


def test_the_legend_names_every_method_and_every_scene_and_the_axes_their_units():
    figure = tradeoff_figure(POINTS, cost="CPU time [s]", quality="bad pixels [%]")
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["bm", "gc", "teddy", "venus"]
    (axes,) = figure.axes
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("CPU time [s]", "bad pixels [%]")
    assert (axes.get_xscale(), axes.get_yscale()) == ("log", "log")
    linear = tradeoff_figure(POINTS, cost="s", quality="F1", log_quality=False)
    assert linear.axes[0].get_yscale() == "linear"


def test_a_point_without_any_error_is_shown_too():
    perfect = TradeoffPoint("kz2", "venus", 3.0, 0.0)
    figure = tradeoff_figure([*POINTS, perfect], cost="s", quality="%")
    (axes,) = figure.axes
    assert axes.get_ylim()[0] <= 0 and axes.get_xlim()[1] > 3


def test_the_numbers_along_the_axes_are_plain_and_apart():
    figure = tradeoff_figure(POINTS, cost="s", quality="%")
    figure_png(figure)
    (axes,) = figure.axes
    labels = [tick.label1 for tick in axes.xaxis.get_major_ticks() if tick.label1.get_text() and tick.get_visible()]
    inside = [text for text in labels if 0.01 <= float(text.get_text()) <= 0.8]
    assert {text.get_text() for text in inside} >= {"0.01", "0.1", "0.5"}
    boxes = [text.get_window_extent() for text in inside]
    assert not any(a.overlaps(b) for a, b in pairwise(boxes))


def test_an_interval_is_drawn_from_its_low_to_its_high_end():
    figure = tradeoff_figure(POINTS, cost="s", quality="%")
    spans = [c.get_segments()[0][:, 1].tolist() for c in figure.axes[0].collections if len(c.get_segments())]
    assert spans == [[1.5, 3.0]]


def grid_of(cells):
    return OccupancyGrid.from_cells(0.1, cells, np.full(len(cells), 2.0))


@pytest.mark.parametrize(("end", "shape"), [((30, 3, 0), (2, 1)), ((3, 30, 0), (1, 2))])
def test_slices_of_several_maps_share_their_limits_and_stand_as_there_is_room(end, shape):
    grids = {"short": grid_of([[0, 0, 0], [1, 1, 0]]), "long": grid_of([[0, 0, 0], end])}
    figure = slices_figure(grids, 0.05, path_m=np.array([[-1.0, 0, 0], [0.5, 0, 0]]))
    first, second = figure.axes[:2]
    assert [first.get_title(), second.get_title()] == ["short", "long"]
    assert first.get_subplotspec().get_gridspec().get_geometry() == shape
    assert first.get_xlim() == second.get_xlim() and first.get_ylim() == second.get_ylim()
    assert first.get_xlim()[0] < -1.0 and first.get_xlim()[1] > 0.1 * end[0] and first.get_ylim()[1] > 0.1 * end[1]


def test_a_map_without_a_cell_in_the_slice_is_refused():
    with pytest.raises(InvalidInputError, match=r"no cell at z = 5\.00 m"):
        slices_figure({"map": grid_of([[0, 0, 0]])}, 5.0)
