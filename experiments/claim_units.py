"""One unit of the claim: the drive through a world, with the pose noise of one seed, mapped in one way and scored."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np

from sim.faults import FaultyCameras, camera_faults
from stereogrid.camera import StereoCamera
from stereogrid.config import MappingConfig, MatcherConfig
from stereogrid.geometry import FloatArray
from stereogrid.mapping_run import Track, build_map
from stereogrid.motion import MotionError, MotionNoise, NoisyOdometry, PoseUncertainty
from stereogrid.observation import Disparity, Observation, Recording
from stereogrid.recording import ShuffledPoses, TruePoses
from stereogrid.scoring import BoundTest, RayCaster, Sampling, Score
from stereogrid.scoring.truth import MapTruth
from stereogrid.sensor_model import MOTION_RULES

from .claim_bins import bin_scores
from .drives import OBSTACLES_M, open_drive, score_grid, true_disparity
from .kept import file_key, key_of

CODE = ("stereogrid", "sim/faults", "experiments/claim_units.py", "experiments/claim_bins.py", "experiments/drives.py")
MAP, BOUND, TRUE_DEPTH, SHUFFLED, PRIOR = "map", "bound", "true depth", "shuffled poses", "prior only"
CONTROLS, ANY = "controls", "any"
"""Where a noise, or a rule of fusion, stands else."""
END_ERROR = "end_error_m"
READINGS_HELD = 3
"""Of a world: with the camera noise of most units, and with that of the two that are being mapped."""


@dataclass(frozen=True)
class Unit:
    """What a row of the results is of."""

    world: str
    noise: str
    seed: int
    fusion: str
    way: str


@dataclass(frozen=True)
class Sight:
    """What the matcher saw: its parameters, the cameras' faults (a text for camera_faults), and the seed of these."""

    matcher: MatcherConfig
    faults: str
    seed: int


@dataclass(frozen=True)
class Task:
    """What makes the scores of a unit, besides the drive.

    kind: MAP; BOUND, the test of the hits' claimed errors; or one of the controls, which are maps. error: of the
    poses, drawn by seed. mapping: with the error that the mapper is told. surface: whether the map's surface is scored.
    """

    kind: str
    sight: Sight
    error: MotionError
    seed: int
    mapping: MappingConfig
    surface: bool


@dataclass(frozen=True)
class Readings:
    """A drive in memory: a Recording of true poses, and the disparity of each of its observations, by stamp."""

    camera: StereoCamera
    T_base_cam: FloatArray
    observations: tuple[Observation, ...]
    disparities: Mapping[float, Disparity]

    def __len__(self) -> int:
        return len(self.observations)

    def __iter__(self) -> Iterator[Observation]:
        return iter(self.observations)

    def disparity_of(self, observation: Observation) -> Disparity:
        """Its disparity: noise of poses does not touch images."""
        return self.disparities[observation.stamp_s]


class Scene:
    """A recorded drive and its truth; images are matched once for each Sight."""

    def __init__(self, path: Path, *, cell_m: float, range_m: float) -> None:
        self.recording = TruePoses(open_drive(path))
        self.range_m = range_m
        self.truth = MapTruth.of_recording(open_drive(path), cell_m, max_range_m=range_m, around_path=True)
        self.obstacles = self.truth.above_ground(*OBSTACLES_M)
        self.surface = RayCaster(self.truth.mesh)
        self.key = key_of(file_key(path), cell_m, range_m)
        self._held: dict[Sight, Readings] = {}
        self._one_at_a_time = Lock()

    def readings(self, sight: Sight) -> Readings:
        """What was seen; the last few are held."""
        with self._one_at_a_time:
            found = self._held.pop(sight, None) or self._read(sight)
            self._held[sight] = found  # the newest stands last
            while len(self._held) > READINGS_HELD:
                del self._held[next(iter(self._held))]
        return found

    def _read(self, sight: Sight) -> Readings:
        matcher = sight.matcher.build()
        seen = tuple(FaultyCameras(self.recording, camera_faults(sight.faults), sight.seed))
        disparities = {each.stamp_s: matcher.match(each.left, each.right) for each in seen}
        return Readings(self.recording.camera, self.recording.T_base_cam, seen, disparities)


def scores_of(scene: Scene, task: Task, track: Track) -> list[Score]:
    """Do what the task says; track sees every observation that is mapped."""
    readings = scene.readings(task.sight)
    claimed: Recording = NoisyOdometry(readings, MotionNoise(task.error), task.seed)
    if task.kind == BOUND:
        return bound_scores(scene, claimed, readings.disparity_of, task.mapping.motion_error)
    if task.kind == PRIOR:
        grid = task.mapping.build_mapper(claimed.camera).grid
        return score_grid(scene.truth, scene.obstacles, grid, surface=task.surface)
    disparity_of = readings.disparity_of
    if task.kind == SHUFFLED:
        claimed = ShuffledPoses(readings, task.seed)
    if task.kind == TRUE_DEPTH:

        def disparity_of(observation: Observation) -> Disparity:
            return true_disparity(claimed.camera, observation)

    mapped = build_map(claimed, task.mapping, track, disparity_of=disparity_of)
    scores = score_grid(scene.truth, scene.obstacles, mapped.grid, surface=task.surface)
    return [*scores, *bin_scores(scene.truth, mapped.grid)]


def bound_scores(
    scene: Scene, claimed: Recording, disparity_of: Callable[[Observation], Disparity], told: MotionError
) -> list[Score]:
    """How many hits err as little as is claimed; and how far the last pose is from the true one."""
    test = BoundTest(claimed.camera, surface=scene.surface, sampling=Sampling(max_range_m=scene.range_m))
    claim, off_m = claims_of(told), np.zeros(3)
    for each in claimed:
        if each.truth is not None:  # as TruePoses saw to
            test.add(disparity_of(each), each.T_world_cam, each.truth, **claim(each))
            off_m = each.T_world_cam[:3, 3] - each.truth.T_world_cam[:3, 3]
    return [*test.scores(), Score(END_ERROR, float(np.linalg.norm(off_m)), "m", len(claimed))]


def claims_of(error: MotionError) -> Callable[[Observation], dict[str, Any]]:
    """What is claimed of the pose error of each observation, in their order, as BoundTest.add takes it.

    As the mapper tells the grid. Of submaps, as of pose, each observation's own: the map lays a whole piece by that of
    the pose in its middle, from which no other of the piece is farther than about half of submap_m.
    """
    uncertainty = PoseUncertainty(error)

    def claim(observation: Observation) -> dict[str, Any]:
        if error.way in MOTION_RULES:
            return {"motion_sigma_m": error.sigma_m(observation.odometry), "motion_rule": error.way}
        return {} if error.way == "none" else {"pose_covariance": uncertainty.step(observation)}

    return claim
