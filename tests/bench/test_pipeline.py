"""From a pair of 640 x 480 to the map: matching, the grid, and both. By the clock, on all cores, as a robot waits."""

import numpy as np
import pytest

from experiments.grid_bench import PIPELINE_MATCHER, PIPELINE_RANGE_M, PipelineRow, plain
from experiments.grid_contenders import occupancy_grid
from sim.record import record_drive
from stereogrid.mapper import Mapper
from stereogrid.matching import matcher
from stereogrid.recording import TruePoses, open_recording

CELL_M, NUM_DISPARITIES = 0.05, 80
"""As in the corridor experiment."""
CORES = 2
DRIVES = 3


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    """A pair every .1 m along 10 m, in memory: (camera, observations)."""
    path = tmp_path_factory.mktemp("bench") / "drive.mcap"
    recording = TruePoses(open_recording(record_drive(path, every_m=0.1, max_distance_m=10.0)))
    return recording.camera, list(recording)


def new_mapper(camera) -> Mapper:
    grid = occupancy_grid(CELL_M, PIPELINE_RANGE_M, CORES)
    return Mapper(camera, matcher(PIPELINE_MATCHER, num_disparities=NUM_DISPARITIES), grid)


@pytest.fixture(scope="module")
def disparities(drive):
    """Of each observation; making them and a first map compiles and warms everything."""
    camera, observations = drive
    mapper = new_mapper(camera)
    return [mapper.step(observation) for observation in observations]


@pytest.mark.parametrize("stage", ["matching", "grid", "both"])
def test_pipeline(benchmark, drive, disparities, stage):
    """A round is a pair; every drive goes into a new map."""
    camera, observations = drive

    def drives():
        while True:
            mapper = new_mapper(camera)
            yield from (((mapper, *pair), {}) for pair in zip(observations, disparities, strict=True))

    work = {
        "matching": lambda mapper, observation, _: mapper.matcher.match(observation.left, observation.right),
        "grid": lambda mapper, observation, disparity: mapper.fuse(observation, disparity),
        "both": lambda mapper, observation, _: mapper.step(observation),
    }[stage]
    upcoming, n_pairs = drives(), DRIVES * len(observations)
    benchmark.group = "pipeline"
    benchmark.pedantic(work, setup=lambda: next(upcoming), rounds=n_pairs)
    median_ms, late_ms = 1e3 * np.quantile(benchmark.stats.stats.data, [0.5, 0.99])
    rate = 1 / benchmark.stats.stats.mean
    row = PipelineRow(stage, CELL_M, camera.width_px, rate, float(median_ms), float(late_ms), n_pairs)
    benchmark.extra_info.update(plain(row))
