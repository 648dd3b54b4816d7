"""metrics.json: the numbers of a run."""

import json
from collections.abc import Mapping
from pathlib import Path

from ..files import written_beside


def write_metrics(folder: Path, metrics: Mapping[str, object]) -> Path:
    """Write folder/metrics.json; NaN must already be null (scores_to_dict sees to that)."""
    path = folder / "metrics.json"
    with written_beside(path) as temporary:
        temporary.write_text(json.dumps(metrics, indent=1, allow_nan=False) + "\n", encoding="utf-8")
    return path
