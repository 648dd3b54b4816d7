"""How good is a map? Labels and a visible set from the true mesh, and every score against them."""

from .calibration import ReliabilityTable, bound_coverage, reliability_table
from .labels import FREE, INTERIOR, OCCUPIED, CellLabels, label_cells
from .map_scores import CellSample, ScoredMap, map_reliability, sample_cells, score_map
from .names import SCORE_NAMES
from .score import Score, scores_from_dict, scores_to_dict
from .visibility import VisibleSet, visible_cells

__all__ = [
    "FREE",
    "INTERIOR",
    "OCCUPIED",
    "SCORE_NAMES",
    "CellLabels",
    "CellSample",
    "ReliabilityTable",
    "Score",
    "ScoredMap",
    "VisibleSet",
    "bound_coverage",
    "label_cells",
    "map_reliability",
    "reliability_table",
    "sample_cells",
    "score_map",
    "scores_from_dict",
    "scores_to_dict",
    "visible_cells",
]
