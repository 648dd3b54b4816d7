"""How good is a map? Labels and a visible set from the true mesh, and every score against them."""

from .bound import BoundTest, surface_errors_m
from .calibration import ReliabilityTable, bound_coverage, reliability_table
from .casting import RayCaster
from .hits import Hits, Sampling, measure_hits
from .labels import FREE, INTERIOR, OCCUPIED, CellLabels, label_cells
from .map_scores import CellSample, ScoredMap, map_reliability, sample_cells, score_map
from .names import BOUND_NAMES, SCORE_NAMES
from .score import Score, scores_from_dict, scores_to_dict
from .visibility import VisibleSet, visible_cells

__all__ = [
    "BOUND_NAMES",
    "FREE",
    "INTERIOR",
    "OCCUPIED",
    "SCORE_NAMES",
    "BoundTest",
    "CellLabels",
    "CellSample",
    "Hits",
    "RayCaster",
    "ReliabilityTable",
    "Sampling",
    "Score",
    "ScoredMap",
    "VisibleSet",
    "bound_coverage",
    "label_cells",
    "map_reliability",
    "measure_hits",
    "reliability_table",
    "sample_cells",
    "score_map",
    "scores_from_dict",
    "scores_to_dict",
    "surface_errors_m",
    "visible_cells",
]
