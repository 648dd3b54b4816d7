"""The sensor model as the sweep takes it: ratios, reach, and a table instead of logarithms."""

import math
from typing import NamedTuple

import numpy as np

from ..geometry import Array
from ..sensor_model import SensorModel, likelihood_ratios, odds, reach_behind
from .cells import ONE

TABLE_STEPS = 4096


class Judgement(NamedTuple):
    """The sensor model as the kernels take it.

    hit, passed: likelihood ratios of a surface that is certainly in the cell, and behind it (A and F). behind: reach
    behind the surface [sigmas]. weight, looks_per_px: see judgement(). free: evidence of plainly free space, and
    table: evidence by the root of the ratio, from 0 to hit, both in ONE-ths of a nat. printed_odds: of the prior,
    where the paper's print is to be followed; 0: the corrected form.
    """

    hit: float
    passed: float
    behind: float
    weight: float
    looks_per_px: float
    free: float
    printed_odds: float
    table: Array


def judgement(model: SensorModel, *, looks_per_px: float, weight: float) -> Judgement:
    """looks_per_px: independent looks that a pixel is worth (1 / L^2); weight: what the whole observation is worth."""
    hit, passed = likelihood_ratios(model)
    printed_odds = odds(model.prior) if model.form == "printed" else 0.0
    if printed_odds:
        # Printed Eq. 3 adds logit p + logit p0.
        hit, passed = odds(model.p_occupied) * printed_odds, odds(model.p_free) * printed_odds
    ratios = np.linspace(0, math.sqrt(hit), TABLE_STEPS) ** 2
    table = (np.log(np.maximum(ratios, passed)) * ONE).astype(np.float32)
    # The ratio of free space falls between two steps: it has its own value, or block and cell would disagree.
    free = np.float32(math.log(passed) * ONE)
    table[round(math.sqrt(passed / hit) * (TABLE_STEPS - 1))] = free
    return Judgement(hit, passed, reach_behind(model), weight, looks_per_px, float(free), printed_odds, table)
