"""The figures of the comparison of matchers."""

from collections.abc import Sequence
from itertools import groupby
from pathlib import Path

import numpy as np

from stereogrid.errors import InvalidInputError
from stereogrid.figures import TradeoffPoint, panels_figure, save_figure, slices_figure, tradeoff_figure
from stereogrid.report import ReportFigure

from .matched_maps import MapResult
from .matched_pairs import PairResult
from .matchers_tables import pair_name
from .pairs import Pair

MAP_QUALITY = "obstacle_occupied_f1"
CPU = "CPU time for one pair [s]"


def draw_pairs(results: Sequence[PairResult], folder: Path) -> list[ReportFigure]:
    """Quality against time over all pairs, then the panels of each pair."""
    if not results:
        return []
    points = [
        TradeoffPoint(r.contender, pair_name(r), r.score("cpu_s").value, r.score("bad_2_0_filled").value)
        for r in results
    ]
    figure = tradeoff_figure(points, cost=CPU, quality="pixels off by more than 2 px [%]")
    caption = (
        "Quality against time on the pairs: share of the non-occluded pixels off by more than 2 px, holes filled; "
        "better is lower and further left."
    )
    figures = [ReportFigure(save_figure(figure, folder / "pairs-quality-time.png"), caption)]
    by_pair = (list(group) for _, group in groupby(results, lambda r: r.pair.name))
    return [*figures, *(draw_panels(group, folder) for group in by_pair)]


def pair_slug(pair: Pair) -> str:
    """The pair's name as it stands in the names of files."""
    return pair.name.replace(" / ", "-by-")


def draw_panels(results: Sequence[PairResult], folder: Path) -> ReportFigure:
    """The disparities of one pair by each contender, with their error maps."""
    pair = results[0].pair
    found = {
        f"{r.contender}: {r.score('density').value:.0f} % matched,\n"
        f"{r.score('bad_2_0').value:.1f} % of them off by > 2 px": r.disparity.disparity_px
        for r in results
    }
    figure = panels_figure(pair.left, pair.truth_px, found, masks=(pair.visible, pair.hidden))
    path = save_figure(figure, folder / f"panels-{pair_slug(pair)}.png")
    return ReportFigure(
        path,
        f"{pair_name(results[0])}: disparities, and below each where it is wrong. Percentages are of the non-occluded "
        "pixels. White, in a disparity: no match, or no truth.",
    )


def draw_maps(result: MapResult, folder: Path) -> list[ReportFigure]:
    """The slices of the maps side by side, and the maps' quality against the matchers' time."""
    path_m = next(iter(result.maps.values())).path_m
    height_m = float(np.median(path_m[:, 2]))
    figures = []
    try:
        figure = slices_figure(
            {name: mapped.grid for name, mapped in result.maps.items()},
            height_m,
            path_m=path_m,
            truth_segments_m=result.truth.section_m(height_m),
        )
        caption = f"The maps of the first noise seed, cut at the camera's height, z = {height_m:.2f} m."
        figures.append(ReportFigure(save_figure(figure, folder / "slices.png"), caption))
    except InvalidInputError:  # a map without a cell at that height: a poor one, but no reason to lose the run
        pass
    figure = tradeoff_figure(
        [_map_point(result, name) for name in result.maps],
        cost=CPU,
        quality="F1 of occupied cells, obstacles",
        log_quality=False,
    )
    caption = (
        "The map's quality against the matcher's time: mean and range of the noise seeds; better is higher and "
        "further left."
    )
    figures.append(ReportFigure(save_figure(figure, folder / "maps-quality-time.png"), caption))
    return figures


def _map_point(result: MapResult, name: str) -> TradeoffPoint:
    values = result.values(name, MAP_QUALITY)
    cpu_s = next(score.value for score in result.times[name] if score.name == "cpu_s")
    return TradeoffPoint(name, "drive", cpu_s, float(np.mean(values)), min(values), max(values))
