"""Matchers on pairs whose disparity is known: how good, and how long."""

import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from stereogrid.errors import InvalidInputError
from stereogrid.observation import Disparity, Image, Matcher
from stereogrid.scoring import Score
from stereogrid.scoring.disparity import disparity_scores, occlusion_f1, sigma_coverage

from .contenders import Contender
from .pairs import Pair

SECOND = "s"
WARM_UP_ROWS = 64
REPEATS = 3


@dataclass(frozen=True)
class PairResult:
    """What one contender found on one pair, and its scores. labels: how many disparities it searched, 0 = unknown."""

    pair: Pair
    contender: str
    labels: int
    disparity: Disparity
    scores: list[Score]

    def score(self, name: str) -> Score:
        """The score of that name."""
        return next(score for score in self.scores if score.name == name)


def at_most(pair: Pair, pixels: int) -> Pair:
    """The pair, shrunk by the smallest whole factor that leaves no more than so many pixels."""
    times = int(np.ceil(np.sqrt(pair.truth_px.size / pixels)))
    return pair.shrunk(times) if times > 1 else pair


def match_pairs(
    pairs: Iterable[Pair], contenders: Mapping[str, Contender], step: Callable[[], None]
) -> list[PairResult]:
    """Each contender on each pair, one after the other, since they are timed; step is called after each."""
    results = []
    for pair in pairs:
        for name, contender in contenders.items():
            try:
                found, times = timed(contender.make(pair.num_disparities), contender.images(pair))
            except InvalidInputError as error:
                raise InvalidInputError(f"{name} on the pair {pair.name}: {error}") from None
            scores = [*score_pair(found, pair), *times]
            results.append(PairResult(pair, name, contender.labels(pair.num_disparities), found, scores))
            step()
    return results


def timed(matcher: Matcher, images: tuple[Image, Image]) -> tuple[Disparity, list[Score]]:
    """The disparity, and the median CPU and wall seconds of REPEATS runs after a warm-up, which compiles kernels."""
    matcher.match(*(np.ascontiguousarray(image[:WARM_UP_ROWS]) for image in images))
    cpu_s, wall_s = [], []
    for _ in range(REPEATS):
        wall, cpu = time.perf_counter(), time.process_time()
        found = matcher.match(*images)
        cpu_s.append(time.process_time() - cpu)
        wall_s.append(time.perf_counter() - wall)
    return found, [
        Score("cpu_s", float(np.median(cpu_s)), SECOND, REPEATS),
        Score("wall_s", float(np.median(wall_s)), SECOND, REPEATS),
    ]


def score_pair(found: Disparity, pair: Pair) -> list[Score]:
    """Every score of a disparity: over the non-occluded pixels, and with the suffix _all over the occluded ones too."""
    known = pair.visible | pair.hidden
    everywhere = disparity_scores(found.disparity_px, pair.truth_px, known)
    return [
        *disparity_scores(found.disparity_px, pair.truth_px, pair.visible),
        *(replace(score, name=f"{score.name}_all") for score in everywhere),
        occlusion_f1(found.disparity_px, pair.hidden, known),
        *sigma_coverage(found, pair.truth_px, pair.visible, step_px=pair.step_px),
    ]
