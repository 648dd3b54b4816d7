"""A whole run of the mapper on a recording: map, checks, figures and report in one run folder."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .config import MappingConfig
from .errors import MapTooLargeError, RecordingError
from .files import check_writable
from .grid import OccupancyGrid
from .map_report import write_mapped
from .map_truth import known_truth
from .mapped import HasCamera, Mapped, Track, untracked
from .observation import Disparity, Observation, Recording
from .recorded_run import recorded_run
from .recording import FileRecording
from .run_record import OUTSIDE, RunRecord
from .runs import finished_path
from .scoring import Score

__all__ = [
    "HasCamera",
    "Mapped",
    "MappingResult",
    "Track",
    "build_map",
    "map_recording",
    "map_while_it_fits",
    "untracked",
    "write_mapped",
]


@dataclass(frozen=True)
class MappingResult:
    """folder: where everything stands; grid: the map; scores: of it, those against a truth too where one is known."""

    folder: Path
    grid: OccupancyGrid
    scores: list[Score]


def build_map(
    recording: Recording,
    config: MappingConfig,
    track: Track = untracked,
    *,
    disparity_of: Callable[[Observation], Disparity] | None = None,
) -> Mapped:
    """Map a recording, by disparity_of where it is given instead of by the config's matcher.

    Raises RecordingError when there is no observation, MapTooLargeError when the map outgrows its memory limit.
    """
    mapped = map_while_it_fits(recording, config, track, disparity_of=disparity_of)
    if mapped.stopped:
        raise mapped.stopped
    return mapped


def map_while_it_fits(
    recording: Recording,
    config: MappingConfig,
    track: Track = untracked,
    *,
    disparity_of: Callable[[Observation], Disparity] | None = None,
) -> Mapped:
    """As build_map, but a map that outgrows its memory limit is returned as far as it goes: `stopped` says so.

    Raises MapTooLargeError when not even the first observation fits.
    """
    mapper = config.build_mapper(recording.camera)

    def step(observation: Observation) -> Disparity:
        if disparity_of is None:
            return mapper.step(observation)
        disparity = disparity_of(observation)
        mapper.fuse(observation, disparity)
        return disparity

    poses, stamps_s, densities, sample, stopped = [], [], [], None, None
    for n, observation in enumerate(track(recording, "mapping", len(recording))):
        try:
            disparity = step(observation)
        except MapTooLargeError as error:
            if sample is None:
                raise
            stopped = error
            break
        poses.append(observation.T_world_cam)
        stamps_s.append(observation.stamp_s)
        densities.append(disparity.density)
        # The latest one until then: a drive may end before its first quarter.
        if n <= len(recording) // 4:
            sample = (observation, disparity)
    if sample is None:
        raise RecordingError("the recording holds no complete observation, so there is nothing to map")
    try:
        mapper.finish()
    except MapTooLargeError as error:
        stopped = stopped or error
    density = float(np.mean(densities))
    return Mapped(mapper.grid, np.array(poses), sample, density, stopped, np.array(stamps_s))


def map_recording(
    recording: Recording,
    config: MappingConfig,
    *,
    name: str,
    runs: Path,
    out: Path | None = None,
    record: RunRecord | None = None,
    track: Track = untracked,
    score: bool | None = False,
    truth_of: object = None,
) -> MappingResult:
    """Map a recording into runs/<stamp>-<name>/; out: where else to save the map (.sgrid); record: for its run.toml.

    score: whether to score the map against the recording's truth; None: where it carries one and that can be done, and
    else the report says why not. truth_of: what carries the truth, where that is not the recording itself.
    Where the map outgrows its memory limit, all is written of the map so far, and then MapTooLargeError raised.
    """
    if out is not None:
        check_writable(out)
    config.build_mapper(recording.camera)  # refuses what cannot work before anything is written
    record = record or RunRecord("map")
    source = recording if truth_of is None else truth_of
    outside = source.files_outside if isinstance(source, FileRecording) else ()
    record = record.reading_once(*((OUTSIDE, each) for each in outside))
    with recorded_run(runs, name, record.reading(*config.matcher.files()), config) as folder:
        truth = known_truth(source, config, score, track)
        mapped = map_while_it_fits(recording, config, track)
        facts = {"command": record.command} | _stop(mapped, recording)
        scores = write_mapped(
            folder,
            mapped,
            source=recording,
            title=f"Map of {name}",
            facts=facts,
            track=track,
            truth=truth,
            config=config,
        )
        if out is not None:
            mapped.grid.save(out)
    if mapped.stopped:
        places = " and ".join(str(place) for place in (finished_path(folder), out) if place)
        raise MapTooLargeError(f"{_stop(mapped, recording)['stopped']}; the map so far is saved in {places}")
    return MappingResult(finished_path(folder), mapped.grid, scores)


def _stop(mapped: Mapped, recording: Recording) -> dict[str, str]:
    """Why and where the mapping stopped; nothing of a whole map."""
    if mapped.stopped is None:
        return {}
    return {"stopped": f"{mapped.stopped}: stopped after {len(mapped.path_m)} of {len(recording)} observations"}
