"""A calibration from pairs of pictures in files."""

from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any

from stereogrid.calibration import CameraNames, Chessboard, find_views

from .outcome import Outcome
from .picture_files import PicturePairs

Track = Callable[[Iterable[Any], str, int], Iterable[Any]]
"""Shows how far a loop is: stereogrid.screen.track."""


def calibrate_pairs(
    found: PicturePairs, board: Chessboard, *, swap: bool = False, drop_far: bool = False, track: Track | None = None
) -> Outcome:
    """Calibrate from pairs of pictures; swap: what is called left is the right camera.

    drop_far: leave out pairs that are far worse than the others. Raises InvalidInputError or RecordingError.
    """
    pairs = [pair.swapped() if swap else pair for pair in found.pairs]
    shown = pairs if track is None else track(pairs, "finding boards", len(pairs))
    views = find_views(((pair.name, pair.read()) for pair in shown), board)
    views = replace(views, left_out=(*found.alone, *views.left_out))
    cameras = CameraNames("", swap, str(pairs[0].left), str(pairs[0].right))
    outcome = Outcome.of(views, cameras, drop_far=drop_far)
    example = next(pair for pair in pairs if pair.name == outcome.views.names[0])
    return replace(outcome, example=example.read())
