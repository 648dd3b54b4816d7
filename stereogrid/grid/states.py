"""Free, occupied or unknown: what a cell's word says to those who must decide."""

from enum import IntEnum

import numpy as np

from ..errors import InvalidInputError
from ..geometry import Array
from .cells import LogOddsCells

Judge = tuple[int, int, int]
"""(bits of a word's update count, least word that is not free, least word that is occupied), as the kernels take it."""


class State(IntEnum):
    """What a cell is; arrays hold the codes as int8. str() gives the name in small letters."""

    UNKNOWN = -1
    FREE = 0
    OCCUPIED = 1

    def __str__(self) -> str:
        return self.name.lower()


def judge(rule: LogOddsCells, p_occupied: float, p_free: float | None = None) -> Judge:
    """The rule by which known cells are OCCUPIED above p_occupied, FREE up to p_free, and UNKNOWN between the two.

    p_free: p_occupied where None. Raises InvalidInputError unless 0 <= p_free <= p_occupied < 1.
    """
    free = p_occupied if p_free is None else p_free
    if not 0 <= p_occupied < 1:
        raise InvalidInputError(f"p_occupied must be a probability below 1, not {p_occupied}")
    if not 0 <= free <= p_occupied:
        raise InvalidInputError(f"p_free must be a probability up to p_occupied {p_occupied:g}, not {free}")
    return rule.count_mask, rule.least_word_above(free), rule.least_word_above(p_occupied)


def states_of(words: Array, judge: Judge) -> Array:
    """State codes int8 of words, any shape; a cell that was never updated is UNKNOWN."""
    count_mask, not_free, occupied = judge
    known = (words & count_mask) > 0
    states = np.full(words.shape, State.UNKNOWN, dtype=np.int8)
    states[known & (words < not_free)] = State.FREE
    states[known & (words >= occupied)] = State.OCCUPIED
    return states
