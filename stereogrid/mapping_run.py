"""A whole run of the mapper on a recording: map, checks, figures and report in one run folder."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, TypeVar

import numpy as np
from matplotlib.figure import Figure

from .camera import StereoCamera
from .config import MappingConfig, save_config
from .errors import InvalidInputError, MapTooLargeError, RecordingError
from .figures import cubes_figure, disparity_figure, save_figure, slice_figure
from .files import check_writable
from .geometry import FloatArray
from .grid import OccupancyGrid
from .observation import Disparity, Observation, Recording
from .report import ReportFigure, write_metrics, write_report
from .runs import finished_path, run_folder
from .scoring import Score, scores_to_dict
from .scoring.ground import camera_height

Item = TypeVar("Item")


class Track(Protocol):
    """Yields items and shows how many of total are done; `what` says what is being done to them."""

    def __call__(self, items: Iterable[Item], what: str, total: int) -> Iterator[Item]: ...


class HasCamera(Protocol):
    """Whatever knows the rectified pair: a recording, live cameras."""

    @property
    def camera(self) -> StereoCamera: ...


@dataclass(frozen=True)
class Mapped:
    """A map and what is remembered of its making.

    path_T_world_cam (M, 4, 4): where the camera was taken to be; sample: an observation a quarter of
    the way down the drive with its disparity, for figures; density: mean share of matched pixels;
    stopped: what the map could not grow beyond, after the M observations that it holds.
    """

    grid: OccupancyGrid
    path_T_world_cam: FloatArray
    sample: tuple[Observation, Disparity]
    density: float
    stopped: MapTooLargeError | None = None

    @property
    def path_m(self) -> FloatArray:
        """Positions of the camera (M, 3) in world [m]."""
        return self.path_T_world_cam[:, :3, 3]


@dataclass(frozen=True)
class MappingResult:
    """folder: where everything stands; grid: the map; scores: what can be said without a true mesh."""

    folder: Path
    grid: OccupancyGrid
    scores: list[Score]


def untracked(items: Iterable[Item], what: str, total: int) -> Iterator[Item]:  # noqa: ARG001
    """No progress bar."""
    yield from items


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

    poses, densities, sample, stopped = [], [], None, None
    for n, observation in enumerate(track(recording, "mapping", len(recording))):
        try:
            disparity = step(observation)
        except MapTooLargeError as error:
            if sample is None:
                raise
            stopped = error
            break
        poses.append(observation.T_world_cam)
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
    return Mapped(mapper.grid, np.array(poses), sample, float(np.mean(densities)), stopped)


def map_recording(
    recording: Recording,
    config: MappingConfig,
    *,
    name: str,
    runs: Path,
    out: Path | None = None,
    command: str = "",
    track: Track = untracked,
) -> MappingResult:
    """Map a recording into runs/<stamp>-<name>/; out: where else to save the map (.sgrid).

    Where the map outgrows its memory limit, all is written of the map so far, and then MapTooLargeError raised.
    """
    if out is not None:
        check_writable(out)
    config.build_mapper(recording.camera)  # refuses what cannot work before anything is written
    with run_folder(runs, name) as folder:
        mapped = map_while_it_fits(recording, config, track)
        facts = {"command": command} | _stop(mapped, recording)
        scores = write_mapped(
            folder, mapped, config, source=recording, title=f"Map of {name}", facts=facts, track=track
        )
        if out is not None:
            mapped.grid.save(out)
    if mapped.stopped:
        places = " and ".join(str(place) for place in (finished_path(folder), out) if place)
        raise MapTooLargeError(f"{_stop(mapped, recording)['stopped']}; the map so far is saved in {places}")
    return MappingResult(finished_path(folder), mapped.grid, scores)


def write_mapped(
    folder: Path,
    mapped: Mapped,
    config: MappingConfig,
    *,
    source: HasCamera,
    title: str,
    facts: Mapping[str, str],
    track: Track = untracked,
) -> list[Score]:
    """Write map, config, metrics, figures and report of a map of what `source` saw; what can be said without truth."""
    scores = _scores(mapped)
    save_config(config, folder / "config.toml")
    mapped.grid.save(folder / "map.sgrid")
    write_metrics(folder, {**facts, "scores": scores_to_dict(scores)})
    write_report(
        folder,
        title,
        summary=f"{len(mapped.path_m)} observations, {mapped.grid!r}",
        arms={"map": scores},
        figures=draw_map(mapped, source, folder, track),
        facts={**facts, "map sha256": mapped.grid.sha256()},
    )
    return scores


def _scores(mapped: Mapped) -> list[Score]:
    return [
        camera_height(mapped.grid, mapped.path_m),
        Score("disparity_density", mapped.density, "1", len(mapped.path_m)),
        Score("known_cells", mapped.grid.n_known, "cell", mapped.grid.n_known),
    ]


def _stop(mapped: Mapped, recording: Recording) -> dict[str, str]:
    """Why and where the mapping stopped; nothing of a whole map."""
    if mapped.stopped is None:
        return {}
    return {"stopped": f"{mapped.stopped}: stopped after {len(mapped.path_m)} of {len(recording)} observations"}


def draw_map(
    mapped: Mapped,
    source: HasCamera,
    folder: Path,
    track: Track = untracked,
    *,
    truth_segments_m: FloatArray | None = None,
) -> list[ReportFigure]:
    """Disparity, slice and cubes of a map as PNG files in folder; what the map has nothing to show of is left out."""
    observation, disparity = mapped.sample
    height_m = float(np.median(mapped.path_m[:, 2]))
    drawings: list[tuple[str, str, Callable[[], Figure]]] = [
        (
            "disparity",
            "The left image a quarter of the way down the drive, and its disparity.",
            lambda: disparity_figure(observation.left, disparity),
        ),
        (
            "slice",
            f"Slice of the map parallel to the ground at the camera's median height, z = {height_m:.2f} m (Fig. 7).",
            lambda: slice_figure(mapped.grid, height_m, path_m=mapped.path_m, truth_segments_m=truth_segments_m),
        ),
        (
            "cubes",
            "Occupied cells as cubes, higher ones lighter, ground in grey; the camera in red (Fig. 9). "
            "Cells more than 1 m above the camera are left out.",
            lambda: _draw_cubes(mapped, source),
        ),
    ]
    figures = []
    for name, caption, draw in track(drawings, "drawing", len(drawings)):
        # A map without a cell at that height is a poor map, but no reason to lose it.
        with suppress(InvalidInputError):
            figures.append(ReportFigure(save_figure(draw(), folder / f"{name}.png"), caption))
    return figures


def _draw_cubes(mapped: Mapped, source: HasCamera) -> Figure:
    ground_m = -camera_height(mapped.grid, mapped.path_m).value
    up_m = max(3.0, 0.4 * mapped.grid.model.max_range_m)
    return cubes_figure(
        mapped.grid,
        mapped.sample[0].T_world_cam,
        source.camera,
        back_and_up_m=(1.4 * up_m, up_m),
        path_m=mapped.path_m,
        heights_m=(-np.inf, 1.0),
        ground_m=ground_m + 1.6 * mapped.grid.cell_m if np.isfinite(ground_m) else None,
    )
