import numpy as np
import pytest

from experiments.compared import Compared, difference_table, mean_table
from experiments.fusion_figures import arms_figure
from stereogrid.scoring import Score
from stereogrid.scoring.paired import paired_difference

VALUES = {"one": [0.5, 0.6, 0.7], "two": [0.6, 0.7, 0.8], "three": [np.nan, 0.6, 0.7]}


@pytest.fixture
def compared():
    scores = {
        arm: {
            seed: [Score("auc", value, "1", 9), Score("log_loss", 1 - value, "nat", 9)] for seed, value in enumerate(v)
        }
        for arm, v in VALUES.items()
    }
    return Compared("World", scores, "one", ("auc", "log_loss"), "seeds")


def test_the_means_have_a_row_a_score_and_a_column_an_arm(compared):
    table = mean_table(compared, "A note.")
    assert table.header == ["score", "one", "two", "three"]
    assert table.rows == [["auc", "0.600", "0.700", "0.650"], ["log_loss [nat]", "0.400", "0.300", "0.350"]]
    assert table.note == "Means over 3 seeds. A note."


def test_differences_are_paired_and_say_from_what(compared):
    table = difference_table(compared)
    assert table.header == ["score", "two - one", "three - one"]
    assert table.caption == "World: differences from one"
    assert table.rows[0][1] == "+0.1000 [+0.1000, +0.1000]"  # the same in each seed, whatever the seeds do
    expected = paired_difference(VALUES["three"], VALUES["one"], rng=np.random.default_rng(0))
    assert compared.difference("three", "auc") == expected
    assert expected.n == 2


def test_the_interval_of_a_mean_holds_it(compared):
    found = compared.mean("two", "auc")
    assert found.mean == pytest.approx(0.7) and found.low < 0.7 < found.high


def test_the_figure_has_a_panel_a_score_a_row_a_world_and_a_dot_an_arm(compared):
    figure = arms_figure([compared, compared], ("auc", "log_loss"))
    panels = figure.axes
    assert [axes.get_xlabel() for axes in panels] == ["auc", "log_loss [nat]"]
    assert [label.get_text() for label in panels[0].get_yticklabels()] == ["World", "World"]
    dots = [line for line in panels[0].lines if line.get_marker() not in ("", "None")]
    assert [line.get_xdata()[0] for line in dots] == pytest.approx(2 * [0.6, 0.7, 0.65])
    assert [line.get_markeredgecolor() == "black" for line in dots] == 2 * [True, False, False]
