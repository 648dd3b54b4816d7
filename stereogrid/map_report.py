"""What a run leaves of its map: the map, its config, metrics, figures and report."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from .camera import StereoCamera
from .errors import InvalidInputError
from .figures import (
    cubes_figure,
    disparity_figure,
    reliability_figure,
    save_figure,
    slice_figure,
    trajectory_figure,
)
from .figures.cubes import eye_behind, frustum_lines_m
from .geometry import FloatArray
from .map_truth import KnownTruth, true_scores
from .mapped import ABOVE_CAMERA_M, HasCamera, Mapped, Track, untracked
from .report import ReportFigure, Scene3D, map_scene, write_metrics, write_report
from .scoring import Score, scores_to_dict
from .scoring.ground import camera_height
from .scoring.truth import MapTruth
from .trajectory import save_tum

HEADLINE = (
    *("camera_height_m", "disparity_density", "known_cells"),
    *("auc", "occupied_precision", "occupied_recall", "occupied_f1", "coverage_occupied"),
    *("brier_balanced", "log_loss", "ece_width", "accuracy_m", "completeness_m"),
)
"""What comes first of the scores of a map."""


@dataclass(frozen=True)
class Drawing:
    """A figure to be: name, of its file; what it shows; how it is drawn; the scene to turn in its place, where one is.

    What raises InvalidInputError when it is drawn has nothing to show.
    """

    name: str
    caption: str
    draw: Callable[[], Figure]
    scene: Callable[[], Scene3D] | None = None


@dataclass(frozen=True)
class Drawn:
    """figures: those that are there; left_out: which are not and why, a line each."""

    figures: list[ReportFigure]
    left_out: list[str]


def write_mapped(
    folder: Path,
    mapped: Mapped,
    *,
    source: HasCamera,
    title: str,
    facts: Mapping[str, str],
    track: Track = untracked,
    truth: KnownTruth | None = None,
    config: object = None,
) -> list[Score]:
    """Write map, metrics, figures and report of a map of what `source` saw; its scores, against the truth too
    where that is given."""
    known = truth or KnownTruth()
    mapped.grid.save(folder / "map.sgrid")
    save_trajectory(mapped, folder / "trajectory.tum")
    true = true_scores(mapped, known, track)
    scores = [*_plain_scores(mapped), *true.scores]
    facts = {**facts, **true.facts}
    write_metrics(folder, {**facts, "notes": true.notes, "scores": scores_to_dict(scores)})
    drawn = draw_all(map_drawings(mapped, source, known), folder, track)
    write_report(
        folder,
        title,
        summary=f"{len(mapped.path_m)} observations, {mapped.grid!r}",
        arms={"map": scores},
        figures=drawn.figures,
        facts={**facts, "map sha256": mapped.grid.sha256()},
        headline=HEADLINE if true.scores else (),
        notes=[*true.notes, *drawn.left_out],
        config=config,
    )
    return scores


def headline_of(scores: Sequence[Score]) -> list[Score]:
    """Those of the scores that come first."""
    return [score for score in scores if score.name in HEADLINE]


def save_trajectory(mapped: Mapped, path: Path) -> None:
    """Where the camera was taken to be, as a TUM trajectory; nothing where the stamps are not known."""
    if mapped.stamps_s is not None:
        save_tum(path, mapped.stamps_s, mapped.path_T_world_cam)


def _plain_scores(mapped: Mapped) -> list[Score]:
    return [
        camera_height(mapped.grid, mapped.path_m),
        Score("disparity_density", mapped.density, "1", len(mapped.path_m)),
        Score("known_cells", mapped.grid.n_known, "cell", mapped.grid.n_known),
    ]


def draw_all(drawings: Sequence[Drawing], folder: Path, track: Track = untracked) -> Drawn:
    """Draw into PNG files in folder. Raises InvalidInputError when one cannot be written."""
    figures, left_out = [], []
    for drawing in track(drawings, "drawing", len(drawings)):
        try:
            figure = drawing.draw()
            scene = None if drawing.scene is None else drawing.scene()
        except InvalidInputError as error:
            # A map without a cell at that height is a poor map, but no reason to lose it.
            left_out.append(f"No figure {drawing.name}: {error}.")
            continue
        path = save_figure(figure, folder / f"{drawing.name}.png")
        figures.append(ReportFigure(path, drawing.caption, scene))
    return Drawn(figures, left_out)


def map_drawings(mapped: Mapped, source: HasCamera, known: KnownTruth | None = None) -> list[Drawing]:
    """Disparity, slice, cubes and trajectory of a map; its reliability too where the truth is known."""
    known = known or KnownTruth()
    observation, disparity = mapped.sample
    true_path_m = known.path_m(len(mapped.path_m))
    drawings = [
        Drawing(
            "disparity",
            "The left image a quarter of the way down the drive, and its disparity.",
            lambda: disparity_figure(observation.left, disparity),
        ),
        slice_drawing(mapped, known.truth),
        Drawing(
            "cubes",
            "Occupied cells as cubes, higher ones lighter, ground in grey; the camera and its way in vermilion (as in "
            f"the paper's Fig. 9). Cells more than {ABOVE_CAMERA_M:g} m above the camera are left out.",
            lambda: _draw_cubes(mapped, source.camera),
            lambda: _scene(mapped, source.camera, true_path_m),
        ),
        trajectory_drawing(mapped.path_m, true_path_m),
    ]
    return drawings if known.truth is None else [*drawings, reliability_drawing("reliability", mapped, known.truth)]


def slice_drawing(mapped: Mapped, truth: MapTruth | None) -> Drawing:
    """The map at the camera's height, with the true surfaces where they are known."""
    height_m = float(np.median(mapped.path_m[:, 2]))
    caption = (
        f"Slice of the map parallel to the ground at the camera's median height, z = {height_m:.2f} m (as in the "
        "paper's Fig. 7): white is free, black occupied; the camera's way in vermilion"
        + ("." if truth is None else ", the true surfaces in green.")
    )

    def draw() -> Figure:
        section_m = None if truth is None else truth.section_m(height_m)
        return slice_figure(mapped.grid, height_m, path_m=mapped.path_m, truth_segments_m=section_m)

    return Drawing("slice", caption, draw)


def trajectory_drawing(path_m: FloatArray, true_path_m: FloatArray | None, of: str = "") -> Drawing:
    """The camera's way; of: whose, where several are told apart."""
    beside = " beside the true one, and how far it is off" if true_path_m is not None else ""
    caption = f"The way of the camera{of and f', {of}'}, as its poses claim it{beside}: from above, and its height."
    return Drawing("trajectory", caption, lambda: trajectory_figure(path_m, true_path_m=true_path_m))


def reliability_drawing(name: str, mapped: Mapped, truth: MapTruth, of: str = "map") -> Drawing:
    """Are the map's probabilities frequencies? Over the cells that it has touched and that could be seen."""
    caption = (
        f"Are the probabilities of the {of} frequencies? Of the cells at p, so many are truly occupied; on the dashed "
        "line they are what they say."
    )
    return Drawing(
        name, caption, lambda: reliability_figure(truth.reliability(mapped.grid), title=f"Reliability, {of}")
    )


def _back_and_up_m(mapped: Mapped) -> tuple[float, float]:
    """From how far behind and above the camera the map is looked at."""
    up_m = max(3.0, 0.4 * mapped.grid.model.max_range_m)
    return 1.4 * up_m, up_m


def _draw_cubes(mapped: Mapped, camera: StereoCamera) -> Figure:
    ground_m = -camera_height(mapped.grid, mapped.path_m).value
    return cubes_figure(
        mapped.grid,
        mapped.sample[0].T_world_cam,
        camera,
        back_and_up_m=_back_and_up_m(mapped),
        path_m=mapped.path_m,
        heights_m=(-np.inf, ABOVE_CAMERA_M),
        ground_m=ground_m + 1.6 * mapped.grid.cell_m if np.isfinite(ground_m) else None,
    )


def _scene(mapped: Mapped, camera: StereoCamera, true_path_m: FloatArray | None) -> Scene3D:
    T_world_cam = mapped.sample[0].T_world_cam
    T_world_eye = eye_behind(T_world_cam, *_back_and_up_m(mapped))
    far_m = float(np.linalg.norm(T_world_eye[:3, 3] - T_world_cam[:3, 3]))
    return map_scene(
        mapped.grid,
        mapped.path_m,
        eye_and_target_m=(T_world_eye[:3, 3], T_world_eye[:3, 3] + far_m * T_world_eye[:3, 2]),
        true_path_m=true_path_m,
        frustum_m=frustum_lines_m(camera, T_world_cam),
        above_path_to_m=ABOVE_CAMERA_M,
    )
