"""Graph cuts on census costs, semi-globally aggregated; both images are labelled, and compared for what is hidden."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from ...errors import InvalidInputError
from ...observation import Disparity, FloatImage, Image
from ..census import Side, shares_around, side_of
from ..correlation import error_correlation_px
from ..images import check_images, check_num_disparities, grey_of, is_blank, nothing_known, toned_as
from ..meter import Meter, check_time_budget
from ..sigma import disparity_sigma_px
from .aggregation import SCALE, line_means, weight_tables
from .cost import cost_table, match_costs
from .expansion import edge_weights, expand
from .median import straighten
from .paths import PATHS, sweep
from .subpixel import fit, smoothed
from .visibility import agreement, constrain, fill_from_farther, hidden_pixels

Mask = NDArray[np.bool_]
Labels = NDArray[np.int32]
Costs = NDArray[np.uint16]

CENSUS_BITS, GREY_LEVELS = 15.0, 13.0
"""Scales on which the two terms of the cost saturate."""
BEYOND = 150
"""The cost of what the other image does not show, of 254: worse than most matches, better than a wrong one."""
REACH_PX, LIKE_GREY, NEAR_PX = 12, 12.0, 8.0
"""The windows of the means: how far they reach, and the scales on which their weights fall."""
PENALTIES = (1000, 4500, 7, 5)
"""Of the paths: a step of one label, a larger one, the intensity step that makes both cheaper, how many times."""
EDGE = (10, 8)
"""The same two of the cuts."""
LARGEST_SMOOTHNESS = 100_000
"""Keeps sums of capacities within int32."""
STEP_CUT = 6
"""Labels that differ by more do not cost more: an edge of depth."""
SLACK = 300
"""A label is offered where it costs at most so much more than the label of now."""
HIDDEN_SLACK = -1500
"""The same where the images do not agree: mostly to neighbours, for most labels cost the same there."""
HIDDEN, SEEN_THROUGH = 1500, 3000
"""The cost of a label that the right image would hide, and the least cost of one that it sees through."""
TOLERANCE = 1
"""Labels that differ by so much are of one surface."""
AROUND_PX, LIKE_SHARE, AGREED_SHARE = 31, 0.25, 0.85
"""In a window so large, so many pixels must agree and be alike, or just agree."""


class GraphCutMatcher:
    """`gc`. Disparities 0 .. num_disparities - 1 by alpha-expansion; NaN where the right image does not show it.

    smoothness: the energy of a step of one label between neighbours, the costs of a match being 0 to 2032.
    time_budget_s: after it no more labels are tried, so that what is found depends on the machine. progress: called
    with the share done, 0 to 1, from any thread.
    """

    def __init__(
        self,
        *,
        num_disparities: int = 64,
        smoothness: int = 150,
        time_budget_s: float | None = None,
        progress: Callable[[float], None] | None = None,
    ) -> None:
        check_num_disparities(num_disparities)
        if not 0 <= smoothness <= LARGEST_SMOOTHNESS:
            raise InvalidInputError(f"smoothness must be 0 to {LARGEST_SMOOTHNESS}, not {smoothness}")
        check_time_budget(time_budget_s)
        self.num_disparities, self.smoothness = num_disparities, smoothness
        self.time_budget_s, self.progress = time_budget_s, progress

    def __repr__(self) -> str:
        return f"GraphCutMatcher(num_disparities={self.num_disparities}, smoothness={self.smoothness})"

    def match(self, left: Image, right: Image) -> Disparity:
        """Disparity of each pixel of the left image, (H, W) or (H, W, 3) uint8; NaN where the right one hides it."""
        first, second = check_images(left, right, self.num_disparities)
        if is_blank(first, second):
            return nothing_known(first, matcher="gc")
        # In the tones of the left image; the census and sigma do not mind which.
        sides = [side_of(first), side_of(toned_as(first, second))]
        meter = Meter(3 * self.num_disparities, self.time_budget_s, self.progress)
        with ThreadPoolExecutor(2) as threads:
            costs = self._match_costs(sides, threads)
            tasks = [threads.submit(self._label, costs, side, meter, mirrored=side is sides[1]) for side in sides]
            (path_costs, labels), (_, right_labels) = (task.result() for task in tasks)
        agreed = self._compare(path_costs, (labels, right_labels), sides[0].image, meter)
        disparity_px = between_labels(path_costs, labels, agreed, sides[0].grey)
        disparity_px[~supported(sides, labels, agreed)] = np.nan
        sigma_px = disparity_sigma_px(sides[0].grey, sides[1].grey, disparity_px, matcher="gc")
        return Disparity(disparity_px, sigma_px, error_correlation_px("gc"))

    def _match_costs(self, sides: list[Side], threads: ThreadPoolExecutor) -> NDArray[np.uint8]:
        """Costs (H, W, D) of single pixels, half of the rows on each thread."""
        height, width = sides[0].grey.shape
        costs, table = np.empty((height, width, self.num_disparities), np.uint8), cost_table(CENSUS_BITS, GREY_LEVELS)
        tasks = []
        for rows in (slice(0, height // 2), slice(height // 2, height)):
            left, right = ((side.image[rows], side.census[rows]) for side in sides)
            tasks.append(threads.submit(match_costs, left, right, table, BEYOND, costs[rows]))
        for task in tasks:
            task.result()
        return costs

    def _label(self, costs: NDArray[np.uint8], side: Side, meter: Meter, *, mirrored: bool) -> tuple[Costs, Labels]:
        """Mean path costs (H, W, D) and the labels (H, W) of least energy of one image."""
        means = np.empty(costs.shape, np.uint16)
        tables = weight_tables(REACH_PX, LIKE_GREY, NEAR_PX)
        line_means(costs, side.image, tables, (mirrored, BEYOND, float(SCALE)), means)
        path_costs = np.zeros(costs.shape, np.uint16)
        for forward in (True, False):
            sweep(means, side.image, PENALTIES, forward, path_costs)
        path_costs //= PATHS
        labels = path_costs.argmin(axis=2).astype(np.int32)
        weights = edge_weights(side.image, self.smoothness, EDGE)
        self._cut(path_costs, weights, labels, meter)
        return path_costs, labels

    def _compare(self, path_costs: Costs, labels: tuple[Labels, Labels], image: Image, meter: Meter) -> Mask:
        """Label anew, in place, the left pixels that do not agree with the right image; returns those that do."""
        left, right = labels
        agreed = np.empty(left.shape, bool)
        agreement(left, right, TOLERANCE, agreed)
        fill_from_farther(agreed, left)
        constrain(path_costs, right, agreed, (TOLERANCE, HIDDEN, SEEN_THROUGH))
        weights = edge_weights(image, self.smoothness, EDGE)
        self._cut(path_costs, weights, left, meter, agreed=agreed)
        agreed &= ~straighten(left, grey_of(image), self.num_disparities, TOLERANCE)
        return agreed

    def _cut(
        self, costs: Costs, weights: NDArray[np.int32], labels: Labels, meter: Meter, *, agreed: Mask | None = None
    ) -> None:
        """Offer each label once, except to pixels that agree; labels are improved in place."""
        movable = np.ones(labels.shape, bool) if agreed is None else ~agreed
        rule = (STEP_CUT, SLACK if agreed is None else HIDDEN_SLACK)
        for alpha in range(self.num_disparities):
            if not meter.late:
                expand(costs, weights, rule, alpha, labels, movable)
            meter.step()


def between_labels(path_costs: Costs, labels: Labels, agreed: Mask, grey: Image) -> FloatImage:
    """The disparity (H, W) [px] from labels (H, W); NaN where hidden in, or outside, the right image."""
    hidden = np.empty(labels.shape, bool)
    hidden_pixels(labels, TOLERANCE, hidden)
    disparity_px = np.empty(labels.shape, np.float32)
    fit(path_costs, labels, agreed, disparity_px)
    disparity_px = smoothed(disparity_px, grey)
    column = np.arange(labels.shape[1], dtype=np.float32)
    disparity_px[hidden | (disparity_px <= 0) | (disparity_px > column)] = np.nan
    return disparity_px


def supported(sides: list[Side], labels: Labels, agreed: Mask) -> Mask:
    """(H, W) whether what is around matches: unlike images agree by chance here and there, and are seldom alike.

    Where grains of noise are all the texture there is, right labels are not alike either, but agree nearly all.
    """
    like_share, agreed_share = shares_around(sides, labels, agreed, AROUND_PX)
    enough: Mask = (like_share >= LIKE_SHARE) | (agreed_share >= AGREED_SHARE)
    return enough
