"""The state of a cell and its update rule: fixed-point log-odds and an update count, packed into one word.

This is the one place that knows what a cell holds. The kernels that judge an observation hand over evidence (int16
log-odds in ONE-ths of a nat, NOTHING = not seen) and know no cell; a store keeps words and does not know what they
mean. Another rule (evidence masses, hit counts) is another class with the members of LogOddsCells.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numba import njit

from ..errors import InvalidInputError
from ..geometry import Array
from ..sensor_model import log_odds

ONE = 256
"""Units of fixed-point log-odds in one nat."""
NOTHING = -32768
"""Evidence (int16) for a cell of which an observation says nothing."""
LARGEST_EVIDENCE = 32767
"""What one observation may add to a cell at most, either way: 128 nat."""
OCTOMAP_CLAMP = (-2.0, 3.511)
"""Limits of OctoMap's log-odds (p = .12 and .971), to compare with it on equal terms."""
DEFAULT_CLAMP = (-6.0, 6.0)


@dataclass(frozen=True)
class LogOddsCells:
    """Words of log-odds (less the prior's) and update count. prior: p of a cell never updated.

    clamp: lowest and highest log-odds that a cell may reach (int32 words), or None for no limit: the sum then does
    not depend on the order of the observations, in int64 words, since nothing bounds it.
    """

    prior: float
    clamp: tuple[float, float] | None = DEFAULT_CLAMP

    def __post_init__(self) -> None:
        if self.clamp is None:
            return
        low, high = self.clamp
        if not low < self.prior_log_odds < high or not max(abs(low), abs(high)) <= 1000:
            raise InvalidInputError(
                f"clamp must be a lowest and a highest log-odds, within +-1000, around the prior's "
                f"{self.prior_log_odds:.3g}, or None; not {low}, {high}"
            )

    @cached_property
    def prior_log_odds(self) -> float:
        """logit of the prior."""
        return float(log_odds(self.prior))

    @property
    def dtype(self) -> np.dtype:
        """Of a word; 0 is the cell that was never updated."""
        return np.dtype(np.int64 if self.clamp is None else np.int32)

    @property
    def count_bits(self) -> int:
        """The lowest bits of a word hold the update count, which stops at its largest value."""
        return 16 if self.clamp is None else 12

    @cached_property
    def _rule(self) -> tuple[int, int, int]:
        """Count bits, lowest and highest value, as the kernels take them."""
        if self.clamp is None:
            return self.count_bits, -(2**46), 2**46
        low, high = (round((limit - self.prior_log_odds) * ONE) for limit in self.clamp)
        return self.count_bits, low, high

    def fuse(self, words: Array, rows: Array, evidence: Array) -> None:
        """Eq. 3: add evidence[b] (512,) int16 to block words[rows[b]]; row -1: to none.

        words (capacity, 512); rows (B,) int64, those of a block all different; evidence (B, 512).
        """
        _fuse(words, rows, evidence, self._rule)

    def fuse_whole(self, words: Array, rows: Array, evidence: Array) -> None:
        """Add evidence[b], one int16, to all the cells of block words[rows[b]]; rows (B,) int64 all different."""
        _fuse_whole(words, rows, evidence, self._rule)

    def merged(self, words: Array, others: Array) -> Array:
        """Words that hold what two have seen: log-odds and counts add up. Any shape."""
        bits, low, high = self._rule
        value = (words >> bits).astype(np.int64) + (others >> bits)
        count = np.minimum(self.n_updates(words).astype(np.int64) + self.n_updates(others), (1 << bits) - 1)
        return ((np.clip(value, low, high) << bits) | count).astype(self.dtype)

    def pack(self, log_odds_values: Array, n_updates: Array) -> Array:
        """Words from log-odds and update counts, any shape; rounded to 1 / ONE nat and clamped."""
        bits, low, high = self._rule
        relative = np.rint((np.asarray(log_odds_values, np.float64) - self.prior_log_odds) * ONE).astype(np.int64)
        count = np.minimum(n_updates, (1 << bits) - 1).astype(np.int64)
        return np.where(count > 0, (np.clip(relative, low, high) << bits) | count, 0).astype(self.dtype)

    def log_odds(self, words: Array) -> Array:
        """float32 log-odds of words, any shape; the prior's where never updated."""
        return ((words >> self.count_bits) / ONE + self.prior_log_odds).astype(np.float32)

    def n_updates(self, words: Array) -> Array:
        """Update counts uint16 of words, any shape."""
        return (words & self.count_mask).astype(np.uint16)

    @property
    def count_mask(self) -> int:
        """The bits of a word that hold the update count; all 0: unknown."""
        return (1 << self.count_bits) - 1

    def least_word_above(self, p: float) -> int:
        """The least word of a cell with probability above p in [0, 1): words sort as their log-odds do."""
        _, low, _ = self._rule
        value = low if p == 0 else np.floor((log_odds(p) - self.prior_log_odds) * ONE) + 1
        return int(value) << self.count_bits

    def highest(self, words: Array, others: Array) -> Array:
        """Words, any shape, with the larger log-odds and the larger update count of two; unknown gives way."""
        top = np.maximum(np.where(words, words, others), np.where(others, others, words))
        counts = np.maximum(words & self.count_mask, others & self.count_mask)
        highest: Array = (top & ~self.count_mask) | counts
        return highest

    def highest_by(self, groups: Array, words: Array, n_groups: int) -> Array:
        """As highest, over all the words (N,) of each of n_groups, groups (N,) int64; 0 where a group has none."""
        top = np.full(n_groups, np.iinfo(self.dtype).min, dtype=self.dtype)
        counts = np.zeros(n_groups, dtype=np.uint16)
        known = (words & self.count_mask) > 0
        np.maximum.at(top, groups[known], words[known])
        np.maximum.at(counts, groups[known], self.n_updates(words[known]))
        return np.where(counts > 0, (top & ~self.count_mask) | counts.astype(self.dtype), 0).astype(self.dtype)


def to_evidence(gain: Array) -> Array:
    """int16 evidence from log-odds [nat] of any shape, NaN = nothing."""
    fixed = np.clip(np.rint(np.nan_to_num(gain) * ONE), -LARGEST_EVIDENCE, LARGEST_EVIDENCE)
    return np.where(np.isnan(gain), NOTHING, fixed).astype(np.int16)


@njit(cache=True, nogil=True, error_model="numpy")
def _fuse(words: Array, rows: Array, evidence: Array, rule: tuple[int, int, int]) -> None:
    # All in the word's own type and without a branch: the compiler makes vector instructions of it.
    kind = words.dtype.type
    one, full = kind(1), kind((1 << rule[0]) - 1)
    bits, least, most = kind(rule[0]), kind(rule[1]), kind(rule[2])
    for b in range(len(rows)):
        if rows[b] < 0:
            continue
        block, new = words[rows[b]], evidence[b]
        for c in range(block.size):
            word = block[c]
            value = min(max((word >> bits) + kind(new[c]), least), most)
            count = min((word & full) + one, full)
            block[c] = (value << bits) | count if new[c] != NOTHING else word


@njit(cache=True, nogil=True, error_model="numpy")
def _fuse_whole(words: Array, rows: Array, evidence: Array, rule: tuple[int, int, int]) -> None:
    kind = words.dtype.type
    one, full = kind(1), kind((1 << rule[0]) - 1)
    bits, least, most = kind(rule[0]), kind(rule[1]), kind(rule[2])
    for b in range(len(rows)):
        block, gain = words[rows[b]], kind(evidence[b])
        for c in range(block.size):
            word = block[c]
            value = min(max((word >> bits) + gain, least), most)
            block[c] = (value << bits) | min((word & full) + one, full)
