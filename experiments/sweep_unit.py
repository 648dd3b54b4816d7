"""What a worker of a sweep does: one map, scored. Only plain tables, lists, texts and numbers come and go."""

import errno
from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import cv2

from stereogrid.config import MatcherConfig, config_from_table
from stereogrid.mapping_run import untracked
from stereogrid.report import environment
from stereogrid.scoring import Score, scores_to_dict
from stereogrid.scoring.truth import MapTruth

from .drive_experiment import arms
from .drive_report import KNOWN_TILT
from .drives import open_drive, score
from .kept import NO_SCORE_DEPENDS_ON, ROOT, code_key, file_key
from .kept_drives import kept_drive
from .parallel import silent_stage
from .sweep_config import UnitConfig

CODE = (
    "arcos",
    "stereogrid",
    "sim",
    "experiments/drive_experiment.py",
    "experiments/drives.py",
    "experiments/sweep_unit.py",
)
TRUTHS_HELD = 3
OUT_OF = (errno.ENOSPC, errno.EDQUOT, errno.ENOMEM, errno.EMFILE, errno.ENFILE, errno.EROFS, errno.EIO)
"""What a machine is out of, or does not do, when the same map could be made elsewhere or later."""
Plain = dict[str, Any]


@lru_cache(1)
def makings() -> dict[str, str]:
    """What scores follow from besides the parameters; it must be the same for all who work on a sweep.

    Found once: who edits the code while a sweep runs on what was loaded does not end it.
    """
    return {"code": code_key(CODE, but=NO_SCORE_DEPENDS_ON), "versions": environment()["versions"]}


def files_of(matcher: MatcherConfig) -> dict[str, str]:
    """The SHA-256 of what a matcher reads from files, by its kind: scores follow from what is in them."""
    return {kind: file_key(path) for kind, path in matcher.files()}


def attempt(unit: Mapping[str, Any], drives: str) -> Plain:
    """{"scores": ...} of the map of a unit's parameters, or {"error": ...}. drives: a folder, from the checkout.

    {"stopped": ...} where the machine is at fault and another map would fail too.
    """
    cv2.setNumThreads(1)  # there is a process for each core
    try:
        config = config_from_table(UnitConfig, unit)
        return {"scores": scores_to_dict(scores_of(config, ROOT / drives))}
    except Exception as error:
        return {"stopped" if _is_the_machines(error) else "error": f"{type(error).__name__}: {error}"}


def _is_the_machines(error: BaseException | None) -> bool:
    """Whether it arose from a full disk or the like, in which the parameters have no part."""
    while error is not None and not (isinstance(error, OSError) and error.errno in OUT_OF):
        error = error.__cause__ or error.__context__
    return error is not None


def scores_of(config: UnitConfig, drives: Path) -> list[Score]:
    """Drive, or take the kept drive; map in the one arm; score."""
    path = kept_drive(config.drive, drives, silent_stage)
    truth = _truth(path, config.mapping.grid.cell_m, config.score_range_m)
    config = replace(config, known_tilt=config.arm == KNOWN_TILT)  # that arm is there only where it is asked for
    mapped = arms(open_drive(path), config, untracked)[config.arm]()
    return score(truth, truth.above_ground(*config.obstacles_m), mapped)


@lru_cache(TRUTHS_HELD)
def _truth(path: Path, cell_m: float, range_m: float) -> MapTruth:
    """What seeds and matchers have in common."""
    return MapTruth.of_recording(open_drive(path), cell_m, max_range_m=range_m)
