"""From the blocks of a map and what was chosen to what the scene draws, and the words that go with it."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..geometry import Array
from .beside_truth import MISSED, TRUE, UNJUDGED, BesideTruth
from .cell_blocks import CellBlocks, Selected, in_box
from .colours import MEANING_RGB, MEANINGS, PALETTES, bar_legend, named_legend, ramp, shaded
from .controls import WHOLE, Choices
from .scene import MOST_CELLS, MapScene


@dataclass(frozen=True)
class Shown:
    """count: cells drawn; words: how many of which size; kinds: of cells beside the truth, how many of each class."""

    count: int
    words: str
    kinds: tuple[int, ...] = ()


@dataclass(frozen=True)
class Ages:
    """How to colour by age: observations that a count of CellBlocks.changed stands for, and the latest count."""

    unit: int = 1
    latest: int = 1


def draw_map(
    scene: MapScene,
    blocks: CellBlocks,
    choices: Choices,
    *,
    dragged: Callable[[float], None],
    ages: Ages | None = None,
    beside: BesideTruth | None = None,
) -> Shown:
    """Draw cells and slice as they are chosen. ages: for the colour "age"; beside: for "errors"."""
    if beside is not None and choices.colour == "errors":
        return _draw_errors(scene, blocks, choices, beside, dragged)
    blocks = blocks.fitting(MOST_CELLS)
    found = blocks.select(choices.threshold, choices.box(blocks.cell_m))
    scene.draw_cells(found.cells, blocks.cell_m, shaded(_colours(blocks, found, choices, ages), found.cells))
    _draw_slice(scene, blocks, choices, dragged)
    return Shown(len(found.cells), _words(blocks, len(found.cells)))


def legend_of(choices: Choices, ages: Ages | None = None) -> str:
    """HTML of what the colours mean."""
    low, high = choices.heights_m
    if choices.colour == "height":
        return bar_legend("height of the cell", PALETTES["height"], (f"{low:.1f} m", f"{high:.1f} m"))
    if choices.colour == "probability":
        ends = f"p = {choices.threshold:.2f}", "1"
        return bar_legend("probability that it is occupied", PALETTES["probability"], ends)
    if choices.colour == "age" and ages is not None:
        ends = "observation 1", f"{ages.latest * ages.unit + 1}"
        return bar_legend("last changed by", PALETTES["age"], ends)
    return ""


def legend_of_errors(kinds: tuple[int, ...], range_m: float) -> str:
    """HTML of the classes, with how many cells are of each."""
    rows = [(colour.tolist(), f"{words}: {n:,}") for colour, words, n in zip(MEANING_RGB, MEANINGS, kinds, strict=True)]
    about = f"of what the whole drive could see within {range_m:g} m"
    return named_legend(rows) + f'<div style="font-size:0.8em;padding:0 0.75em 0.4em">{about}</div>'


def _colours(blocks: CellBlocks, found: Selected, choices: Choices, ages: Ages | None) -> Array:
    if choices.colour == "probability":
        return ramp(blocks.probability(found.values), (choices.threshold, 1.0), PALETTES["probability"])
    if choices.colour == "age" and ages is not None and found.changed is not None:
        return ramp(found.changed.astype(float), (0.0, float(max(ages.latest, 1))), PALETTES["age"])
    return ramp((found.cells[:, 2] + 0.5) * blocks.cell_m, choices.heights_m, PALETTES["height"])


def _draw_errors(
    scene: MapScene, blocks: CellBlocks, choices: Choices, beside: BesideTruth, dragged: Callable[[float], None]
) -> Shown:
    cells, kinds = beside.judge(blocks.select(choices.threshold))
    counts = tuple(np.bincount(kinds, minlength=len(MEANINGS)).tolist())
    kept = in_box(cells, choices.box(blocks.cell_m))
    cells, kinds = cells[kept], kinds[kept]
    # Too many: first what is right goes.
    for dull in (UNJUDGED, TRUE, MISSED):
        if len(cells) > MOST_CELLS:
            cells, kinds = cells[kinds != dull], kinds[kinds != dull]
    scene.draw_cells(cells, blocks.cell_m, shaded(MEANING_RGB[kinds], cells))
    _draw_slice(scene, blocks, choices, dragged)
    return Shown(len(cells), _words(blocks, len(cells)), counts)


def _draw_slice(scene: MapScene, blocks: CellBlocks, choices: Choices, dragged: Callable[[float], None]) -> None:
    if choices.slice_axis == WHOLE:
        scene.hide_slice()
    else:
        scene.draw_slice(blocks, choices.slice_axis, choices.slice_index(blocks.cell_m), dragged)


def _words(drawn: CellBlocks, count: int) -> str:
    words = f"{count:,} cells of {100 * drawn.cell_m:g} cm"
    if drawn.coarser > 1:
        finer = f"{drawn.coarser**3} of {100 * drawn.cell_m / drawn.coarser:g} cm"
        words += f" (the map's are more than {MOST_CELLS:,}: each drawn one stands for up to {finer})"
    return words
