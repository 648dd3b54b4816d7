"""The same drive, the same poses, each matcher in turn: what a matcher is worth to the map."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from threading import Event

import numpy as np

from sim.faults import FaultyCameras, camera_faults
from stereogrid.config import MappingConfig
from stereogrid.mapping_run import Mapped, Track, build_map
from stereogrid.observation import Recording
from stereogrid.recording import TruePoses
from stereogrid.scoring import Score
from stereogrid.scoring.paired import Interval, paired_difference
from stereogrid.scoring.truth import MapTruth

from .compared import BOOTSTRAP_SEED
from .contenders import Contender
from .drives import HEADLINE, OBSTACLES_M, score
from .matched_pairs import timed
from .parallel import Stage, counted, in_parallel, until

DENSITY = "disparity_density"
SHOWN = (*HEADLINE, DENSITY)
"""The scores of a map that tables show and that differences are taken of."""


@dataclass(frozen=True)
class Seeing:
    """How the drive is seen and mapped: by which cameras, with which noise, into which map."""

    mapping: MappingConfig
    noise: str
    noise_seeds: tuple[int, ...]
    num_disparities: int

    def noisy(self, drive: Recording, seed: int) -> Recording:
        """The drive as every contender sees it: true poses, and image noise that depends on the seed alone."""
        return TruePoses(FaultyCameras(drive, camera_faults(self.noise), seed))


@dataclass(frozen=True)
class MapResult:
    """scores[contender][seed]; the maps of the first seed and the times of one pair of the drive, by contender."""

    truth: MapTruth
    scores: Mapping[str, Mapping[int, list[Score]]]
    maps: Mapping[str, Mapped]
    times: Mapping[str, list[Score]]

    @property
    def n_seeds(self) -> int:
        """How many seeds of the image noise each contender was given."""
        return len(next(iter(self.scores.values())))

    def each(self, contender: str, name: str) -> list[Score]:
        """The score of that name for each seed, in their order."""
        by_seed = self.scores[contender].values()
        return [each for scores in by_seed for each in scores if each.name == name]

    def values(self, contender: str, name: str) -> list[float]:
        """Its values."""
        return [score.value for score in self.each(contender, name)]

    def unit(self, name: str) -> str:
        """The unit of the score of that name."""
        return self.each(next(iter(self.scores)), name)[0].unit

    def mean(self, contender: str, name: str) -> float:
        """Its mean over the seeds."""
        return float(np.mean(self.values(contender, name)))

    def difference(self, contender: str, reference: str, name: str) -> Interval:
        """How much higher the contender's score is than the reference's, seed by seed."""
        rng = np.random.default_rng(BOOTSTRAP_SEED)
        return paired_difference(self.values(contender, name), self.values(reference, name), rng=rng)


def truth_of(drive: Recording, seeing: Seeing, stage: Stage) -> MapTruth:
    """What the maps are scored against: what the cameras could see within the range that is mapped."""
    with stage("finding what the cameras could see", len(drive)) as step:
        return MapTruth.of_recording(
            drive,
            seeing.mapping.grid.cell_m,
            max_range_m=seeing.mapping.model.max_range_m,
            progress=lambda _done, _total: step(),
        )


def map_drive(
    drive: Recording, truth: MapTruth, contenders: Mapping[str, Contender], *, seeing: Seeing, stage: Stage
) -> MapResult:
    """Map the drive by every contender with every noise seed, two maps at a time, and score the maps."""
    stop = Event()
    with stage("mapping", len(contenders) * len(seeing.noise_seeds) * len(drive)) as step:
        one_map = partial(map_and_score, drive, truth, seeing, track=until(stop, counted(step)))
        jobs = {
            (name, seed): partial(one_map, contender, seed=seed)
            for seed in seeing.noise_seeds
            for name, contender in contenders.items()
        }
        results = in_parallel(jobs, stop=stop)
    scores = {name: {seed: results[name, seed][1] for seed in seeing.noise_seeds} for name in contenders}
    maps = {name: results[name, seeing.noise_seeds[0]][0] for name in contenders}
    return MapResult(truth, scores, maps, time_matchers(maps, contenders, seeing, stage))


def map_and_score(
    drive: Recording, truth: MapTruth, seeing: Seeing, contender: Contender, *, seed: int, track: Track
) -> tuple[Mapped | None, list[Score]]:
    """The scores of one map; the map itself only for the first seed, which is drawn."""
    matcher = contender.make(seeing.num_disparities)  # its own: OpenCV's keep buffers
    mapped = build_map(
        seeing.noisy(drive, seed),
        seeing.mapping,
        track,
        disparity_of=lambda observation: matcher.match(observation.left, observation.right),
    )
    density = Score(DENSITY, mapped.density, "1", len(drive))
    scores = [*score(truth, truth.between(*OBSTACLES_M), mapped), density]
    return mapped if seed == seeing.noise_seeds[0] else None, scores


def time_matchers(
    maps: Mapping[str, Mapped], contenders: Mapping[str, Contender], seeing: Seeing, stage: Stage
) -> dict[str, list[Score]]:
    """CPU and wall seconds that each contender takes for one pair of the drive, with nothing beside it."""
    times = {}
    with stage("timing", len(contenders)) as step:
        for name, contender in contenders.items():
            seen = maps[name].sample[0]
            _, times[name] = timed(contender.make(seeing.num_disparities), (seen.left, seen.right))
            step()
    return times
