"""Who takes part, what is shown to them, and how their time is taken."""

import time
from dataclasses import replace

import cv2
import numpy as np
import pytest

from experiments.contenders import CONTENDERS, Contender, default_table, read_contenders
from experiments.matched_pairs import REPEATS, WARM_UP_ROWS, at_most, match_pairs, score_pair, timed
from experiments.pairs import Pair, seen_by_both
from stereogrid.errors import ConfigError, StereogridError
from stereogrid.matching import MATCHERS
from stereogrid.observation import Disparity

HEIGHT, WIDTH, SHIFT_PX = 80, 160, 6


@pytest.fixture(scope="module")
def pair():
    """A wall in colour, 6 px of disparity."""
    rng = np.random.default_rng(0)
    wall = cv2.GaussianBlur(rng.integers(0, 256, (HEIGHT, WIDTH + SHIFT_PX, 3), dtype=np.uint8), (0, 0), 1.0)
    truth_px = np.full((HEIGHT, WIDTH), float(SHIFT_PX))
    left, right = np.ascontiguousarray(wall[:, :WIDTH]), np.ascontiguousarray(wall[:, SHIFT_PX:])
    return Pair("wall", left, right, truth_px, *seen_by_both(truth_px), 20, 1.0)


class Witness:
    """A matcher that remembers what it was shown and takes its time: 30 ms of the CPU, 30 ms of sleep."""

    def __init__(self):
        self.shown = []

    def match(self, left, right):
        self.shown.append((left, right))
        end = time.process_time() + 0.03
        while time.process_time() < end:
            pass
        time.sleep(0.03)
        return Disparity(np.full(left.shape[:2], len(self.shown), np.float32), 1.0)


def test_time_is_taken_after_a_warm_up_and_cpu_time_does_not_count_waiting(pair):
    witness = Witness()
    found, (cpu_s, wall_s) = timed(witness, pair.grey)
    assert [left.shape[0] for left, _ in witness.shown] == [WARM_UP_ROWS] + [HEIGHT] * REPEATS
    assert (cpu_s.name, wall_s.name, cpu_s.unit, cpu_s.n) == ("cpu_s", "wall_s", "s", REPEATS)
    assert cpu_s.value == pytest.approx(0.03, abs=0.025)
    assert wall_s.value >= 0.055
    assert found.disparity_px.shape == (HEIGHT, WIDTH)


def test_colour_is_shown_to_who_wants_it_and_grey_to_the_others(pair):
    left, right = Contender("kz2", colour=True).images(pair)
    assert left is pair.left and right is pair.right
    assert [image.ndim for image in Contender("gc").images(pair)] == [2, 2]


@pytest.mark.parametrize(
    ("step", "wanted", "given"), [(16, 60, 64), (16, 64, 64), (16, 1, 16), (1, 60, 60), (4, 61, 64), (0, 60, 0)]
)
def test_the_labels_are_rounded_up_to_the_step(step, wanted, given):
    assert Contender("bm", labels_step=step).labels(wanted) == given


def test_a_matcher_is_made_with_its_labels_and_options():
    made = Contender("bm", labels_step=16, options={"block_px": 7}).make(60)
    assert (made.num_disparities, made.block_px) == (64, 7)
    assert Contender("bm", labels_step=0).make(60).num_disparities == MATCHERS["bm"]().num_disparities


def test_every_contender_that_is_a_matcher_finds_the_wall(pair):
    contenders = read_contenders(default_table())
    assert {"bm", "sgbm"} <= set(contenders) <= set(CONTENDERS)
    steps = []
    results = match_pairs([pair, replace(pair, name="again")], contenders, lambda: steps.append(1))
    assert [(r.pair.name, r.contender) for r in results] == [(n, c) for n in ("wall", "again") for c in contenders]
    assert len(steps) == len(results)
    for result in results:
        assert result.score("bad_1_0").value < 5 and result.score("density").value > 80, result.contender


def test_a_section_without_a_matcher_means_the_known_one_and_may_change_a_part_of_it():
    read = read_contenders({"bm": {}, "wide": {"matcher": "bm", "labels_step": 16, "options": {"block_px": 15}}})
    assert read["bm"] == CONTENDERS["bm"]
    assert read["wide"] == Contender("bm", labels_step=16, options={"block_px": 15})
    assert read_contenders({"kz2": {"colour": False}})["kz2"] == replace(CONTENDERS["kz2"], colour=False)


@pytest.mark.parametrize(
    ("table", "reason"),
    [
        ({"bm": {"color": True}}, "'contenders.bm.color'; did you mean 'colour'"),
        ({"bm": {"colour": 1}}, "'contenders.bm.colour' must be bool"),
        ({"bm": 3}, "'contenders.bm' must be a section"),
        ({"../bm": {}}, "a name must be of letters"),
        ({"bm": {"labels_step": -16}}, "labels_step must be >= 0"),
    ],
)
def test_a_wrong_section_is_named(table, reason):
    with pytest.raises(ConfigError, match=reason):
        read_contenders(table)


def test_an_unknown_matcher_is_refused_when_it_is_made():
    with pytest.raises(StereogridError, match="no matcher named 'sgmb'"):
        read_contenders({"sgmb": {}})["sgmb"].make(64)


@pytest.mark.parametrize(("pixels", "times"), [(HEIGHT * WIDTH, 1), (HEIGHT * WIDTH - 1, 2), (HEIGHT * WIDTH // 5, 3)])
def test_a_pair_is_shrunk_by_the_smallest_whole_factor_that_fits(pair, pixels, times):
    fitted = at_most(pair, pixels)
    assert fitted.truth_px.shape == (HEIGHT // times, WIDTH // times)
    assert fitted.truth_px.size <= pixels


def test_a_perfect_disparity_has_no_bad_pixel_and_knows_its_occlusions(pair):
    found_px = np.where(pair.visible, pair.truth_px, np.nan)
    scores = {score.name: score.value for score in score_pair(Disparity(found_px, 0.1), pair)}
    assert all(scores[name] == 0 for name in scores if name.startswith(("bad", "mae")))
    assert scores["density"] == 100
    assert scores["density_all"] == pytest.approx(100 * (WIDTH - SHIFT_PX) / WIDTH)
    assert scores["occlusion_f1"] == scores["within_1_sigma"] == 1
