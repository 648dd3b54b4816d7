"""report.html: one self-contained file for a run, made from the files that stand in its folder."""

from .environment import duration_text, environment
from .figures import ReportFigure
from .metrics import write_metrics
from .page import write_report
from .tables import SEEDS, ReportTable, format_score, score_table
from .view3d import Scene3D, map_scene

__all__ = [
    "SEEDS",
    "ReportFigure",
    "ReportTable",
    "Scene3D",
    "duration_text",
    "environment",
    "format_score",
    "map_scene",
    "score_table",
    "write_metrics",
    "write_report",
]
