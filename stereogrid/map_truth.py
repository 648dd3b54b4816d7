"""Is there a truth to score a map against, and what does the map look like beside it?"""

import time
from dataclasses import dataclass, field

import numpy as np

from .config import MappingConfig
from .errors import StereogridError
from .geometry import FloatArray
from .mapped import Mapped, Track
from .scoring import Score
from .scoring.meanings import OF_CELLS
from .scoring.truth import KnowsTruth, MapTruth


@dataclass(frozen=True)
class KnownTruth:
    """What is known of the truth of a recording.

    truth: what its maps are scored against, None where they are not; why_not: the reason, for a reader, "" where nobody
    would expect scores; poses: true T_world_cam (M, 4, 4) of its observations, NaN where unknown, None without any;
    took_s: how long it took to find out what could be seen [s].
    """

    truth: MapTruth | None = None
    why_not: str = ""
    poses: FloatArray | None = None
    took_s: float = 0.0

    def path_m(self, n: int) -> FloatArray | None:
        """True positions (n, 3) of the camera at the first n observations [m]."""
        return None if self.poses is None or len(self.poses) < n else self.poses[:n, :3, 3]


@dataclass(frozen=True)
class TrueScores:
    """Scores of a map against the truth; notes: how to read them; facts: what was done for them."""

    scores: list[Score] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    facts: dict[str, str] = field(default_factory=dict)


def known_truth(recording: object, config: MappingConfig, score: bool | None, track: Track) -> KnownTruth:
    """The truth that a recording carries, to score maps by this config against, on what is seen within its range.

    score: False: only the true poses; None: where it can be had, and else why_not says why it cannot. True: raises
    RecordingError without a truth, InvalidInputError for one that cannot be, MissingExtraError without embreex,
    MapTooLargeError for more cells than fit.
    """
    poses = recording.true_poses() if isinstance(recording, KnowsTruth) else None
    if score is False:
        return KnownTruth(poses=poses)
    bare = poses is None or not isinstance(recording, KnowsTruth) or recording.truth_mesh_ply() is None
    if bare and score is None:
        return KnownTruth(poses=poses)
    start_s = time.perf_counter()
    n = 0 if poses is None else len(poses)
    seen = iter(track(range(n), "what could be seen", n))
    try:
        truth = MapTruth.of_recording(
            recording,
            config.grid.cell_m,
            max_range_m=config.model.max_range_m,
            around_path=True,
            progress=lambda _done, _total: next(seen, None),
        )
    except StereogridError as error:
        if score:
            raise
        return KnownTruth(None, f"Not scored against the recording's truth: {error}.", poses)
    finally:
        # The bar goes.
        for _ in seen:
            pass
    return KnownTruth(truth, "", poses, time.perf_counter() - start_s)


def true_scores(mapped: Mapped, known: KnownTruth, track: Track) -> TrueScores:
    """The scores of a map with their intervals; none where there is no truth."""
    truth = known.truth
    if truth is None:
        return TrueScores(notes=[known.why_not] if known.why_not else [])
    start_s = time.perf_counter()
    scores: list[Score] = []
    for _ in track(range(1), "scoring", 1):
        scores += truth.score(mapped.grid, prior=mapped.grid.model.prior, intervals=True)
    took_s = known.took_s + time.perf_counter() - start_s
    range_m = mapped.grid.model.max_range_m
    n = int(np.count_nonzero(truth.visible.mask))
    what = f"against the true mesh, on the {n:,} cells that could be seen within {range_m:g} m; it took {took_s:.1f} s"
    return TrueScores(scores, [OF_CELLS, truth.interval_note], {"scored": what})
