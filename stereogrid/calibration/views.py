"""Where the corners of a board are in the pairs that a rig is calibrated from."""

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..errors import InvalidInputError
from ..observation import Image
from .chessboard import Chessboard, find_corners_of_pair
from .rig import Both

MIN_PAIRS = 5
"""Fewer views of a plane leave focal length and distortion open."""
NamedPair = tuple[str, tuple[Image, Image]]


@dataclass(frozen=True, eq=False)
class BoardViews:
    """names of the M pairs that show the board in both pictures; corners (left, right): (M, N, 2) each [px], N in the
    order of `Chessboard.corners_m`. left_out: the other pairs, and why they cannot be used."""

    board: Chessboard
    size_px: tuple[int, int]
    names: tuple[str, ...]
    corners: Both
    left_out: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        expected = (len(self.names), len(self.board.corners_m), 2)
        left, right = (corners.shape for corners in self.corners)
        if left != expected or right != expected:
            raise InvalidInputError(f"expected corners {expected} of both cameras, not {left} and {right}")

    def without(self, names: Collection[str], why: Iterable[str]) -> "BoardViews":
        """The same, but for the pairs of these names; why: a line for each of them."""
        keep = np.array([name not in names for name in self.names], bool)
        left, right = (corners[keep] for corners in self.corners)
        kept = tuple(name for name in self.names if name not in names)
        return replace(self, names=kept, corners=(left, right), left_out=(*self.left_out, *why))


def find_views(pairs: Iterable[NamedPair], board: Chessboard) -> BoardViews:
    """Find the board in raw pairs, each with its name: (left, right), (H, W) uint8, of the same moments.

    A pair in which the board is not found on both sides is left out, and named. Raises InvalidInputError when the
    pictures differ in size, or there are none.
    """
    names: list[str] = []
    corners: list[Both] = []
    left_out: list[str] = []
    first: tuple[str, Image] | None = None
    for name, pair in pairs:
        first = first or (name, pair[0])
        _check_pair(name, pair, first)
        left, right = find_corners_of_pair(pair, board)
        if left is None or right is None:
            missing = " and the ".join(side for side, found in (("left", left), ("right", right)) if found is None)
            left_out.append(f"{name}: no board of {board} in the {missing} image")
        else:
            names.append(name)
            corners.append((left, right))
    if first is None:
        raise InvalidInputError("there are no pairs to calibrate from")
    shape = (-1, len(board.corners_m), 2)
    lefts, rights = (np.array([pair[side] for pair in corners]).reshape(shape) for side in (0, 1))
    height, width = first[1].shape
    return BoardViews(board, (width, height), tuple(names), (lefts, rights), tuple(left_out))


def check_enough(views: BoardViews) -> None:
    """Raise InvalidInputError when too few pairs can be used, with what is wrong with the others."""
    n, asked = len(views.names), len(views.names) + len(views.left_out)
    if n >= MIN_PAIRS:
        return
    said = [f"only {n} of {asked} pairs can be used, {MIN_PAIRS} are needed"]
    if not n:
        said = [
            f"in none of {asked} pairs is there a board of {views.board} in both pictures (a corner is where four "
            "squares meet)"
        ]
    raise InvalidInputError("; ".join([*said, *_few(views.left_out)]))


def _few(lines: Sequence[str], most: int = 3) -> list[str]:
    return [*lines[:most], f"and {len(lines) - most} more"] if len(lines) > most else list(lines)


def _check_pair(name: str, pair: tuple[Image, Image], first: tuple[str, Image]) -> None:
    """Both are images of the size of the very first left one, which is given with its name."""
    for side, image in zip(("left", "right"), pair, strict=True):
        if image.ndim != 2 or image.dtype != np.uint8:
            raise InvalidInputError(f"{name}: the {side} image must be (H, W) uint8, not {image.shape} {image.dtype}")
        if image.shape != first[1].shape:
            (h, w), (h0, w0) = image.shape, first[1].shape
            raise InvalidInputError(f"{name}: the {side} image is {w}x{h} px, the left one of {first[0]} {w0}x{h0}")
