"""What comes of pictures of a board: the calibration, which pairs it rests on, and its report."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from stereogrid.calibration import (
    BoardViews,
    CalibrationErrors,
    CameraNames,
    Mount,
    Residuals,
    StereoCalibration,
    calibrate_views,
    far_pairs,
    residuals,
    save_calibration,
    without_far_pairs,
)
from stereogrid.figures import calibration_figure, rectified_figure, save_figure
from stereogrid.observation import Image
from stereogrid.report import ReportFigure, ReportTable, write_report


@dataclass(frozen=True, eq=False)
class Outcome:
    """A calibration of views; far: lines on pairs that are far worse than the others, by their names; cameras: what the
    pictures are from; example: the first raw pair of the views, for the report."""

    calibration: StereoCalibration
    views: BoardViews
    residuals: Residuals
    far: Mapping[str, str]
    cameras: CameraNames = field(default_factory=CameraNames)
    example: tuple[Image, Image] | None = None

    @classmethod
    def of(cls, views: BoardViews, cameras: CameraNames, *, drop_far: bool = False) -> "Outcome":
        """Calibrate; drop_far: without the pairs that are far worse than the others, which are then left_out.

        Raises InvalidInputError when that cannot be done, or comes out as no rig can be.
        """
        if drop_far:
            views = without_far_pairs(views)
        calibration = calibrate_views(views)
        found = residuals(calibration, views.corners, views.board)
        return cls(calibration, views, found, far_pairs(views.names, found.rms_px), cameras)

    @property
    def errors(self) -> CalibrationErrors:
        """Of the calibration."""
        assert self.calibration.errors is not None
        return self.calibration.errors

    @property
    def rows(self) -> list[tuple[str, str, str]]:
        """(what, value, how to read it) of all that is worth knowing."""
        found, errors = self.calibration, self.errors
        (left_px, right_px), camera = (K[0, 0] for K in found.K), found.rectification().camera
        rms_px, epipolar_px = f"{errors.stereo_rms_px:.3f} px", f"{errors.epipolar_mean_px:.3f} px"
        return [
            ("pairs used", f"{found.n_pairs}", f"{len(found.left_out)} left out"),
            ("stereo rms", rms_px, "where corners are from where they should be; below .5 is good"),
            ("left, right rms", f"{errors.rms_px[0]:.3f}, {errors.rms_px[1]:.3f} px", "each camera alone"),
            ("epipolar |dy| mean", epipolar_px, "rows of rectified corners; matchers want below .3"),
            ("epipolar |dy| p95", f"{errors.epipolar_p95_px:.3f} px", "95 % of the corners are within it"),
            ("focal length", f"{left_px:.1f}, {right_px:.1f} px", f"left, right; rectified {camera.focal_px:.1f}"),
            ("field of view", f"{_degrees(camera.width_px, camera.focal_px):.1f} deg", "across the rectified picture"),
            ("baseline", f"{found.baseline_m * 1000:.2f} mm", "measure it between the lenses: does it agree?"),
            ("square edges", f"{errors.square_edge_mean:.4f} +- {errors.square_edge_sd:.4f}", "measured over true"),
        ]  # fmt: skip

    @property
    def warnings(self) -> list[str]:
        """What a person should look at before trusting it."""
        lines = [f"{line}: look at it, or leave such out with --drop-bad" for line in self.far.values()]
        share = seen_share(self.views)
        if share < ENOUGH_SEEN:
            lines.append(
                f"the boards were in {100 * share:.0f} % of the pictures' area: distortion is guessed in the rest"
            )
        return lines


ENOUGH_SEEN = 0.7
TILES = 8, 6


def seen_share(views: BoardViews) -> float:
    """The share of TILES (across, down) of both pictures in which there was a corner."""
    shares = []
    for corners in views.corners:
        tiles = np.floor(corners.reshape(-1, 2) / views.size_px * TILES).astype(int)
        inside = ((tiles >= 0) & (tiles < TILES)).all(axis=1)
        shares.append(len(np.unique(tiles[inside], axis=0)) / np.prod(TILES))
    return float(min(shares))


def _degrees(width_px: float, focal_px: float) -> float:
    return float(np.degrees(2 * np.arctan(width_px / (2 * focal_px))))


def keep_outcome(outcome: Outcome, out: Path, folder: Path, *, mount: Mount | None, command: str) -> Path:
    """Write the calibration to out and its report into a folder that is there; the report's path."""
    page = write_outcome(outcome, folder, {"command": command, "calibration": str(out)})
    T_base_cam = None if mount is None else mount.T_base_cam
    save_calibration(
        outcome.calibration, out, T_base_cam=T_base_cam, board=outcome.views.board, cameras=outcome.cameras
    )
    return page


def write_outcome(outcome: Outcome, folder: Path, facts: Mapping[str, str]) -> Path:
    """Write report.html and its figures into a folder that is there; facts: what was run."""
    views = outcome.views
    save_figure(calibration_figure(views, outcome.residuals, outcome.far), folder / "calibration.png")
    figures = [
        ReportFigure(
            folder / "calibration.png",
            "Above: where boards were seen (green), and how far corners are from where the calibration expects them. "
            "Arrows that all point one way in a part of the picture show an error of the lens model there. Below: how "
            "well rows agree after rectification, and which pairs fit badly.",
        )
    ]
    if outcome.example is not None:
        corners = views.corners[0][0], views.corners[1][0]
        save_figure(rectified_figure(outcome.calibration, outcome.example, corners), folder / "rectified.png")
        figures.append(ReportFigure(folder / "rectified.png", f"The pair {views.names[0]}, rectified."))
    tables = [
        ReportTable("Result", ("what", "how to read it", "value"), [(a, c, b) for a, b, c in outcome.rows], n_names=2),
        _pairs_table(outcome),
    ]
    facts = {**facts, "board": f"{views.board}, squares of {views.board.square_m * 1000:g} mm"}
    notes = [*outcome.warnings, *outcome.calibration.left_out]
    summary = " ".join(f"{note}." for note in notes) or "All pairs were used, and none stands out."
    return write_report(
        folder, "Calibration of two cameras", summary=summary, arms={}, figures=figures, facts=facts, tables=tables
    )


def _pairs_table(outcome: Outcome) -> ReportTable:
    found = outcome.residuals
    left_px, right_px = (np.sqrt((off**2).sum(axis=-1).mean(axis=1)) for off in found.off_px)
    rows = [
        (name, *(f"{number:.3f}" for number in numbers), "far worse than the others" if name in outcome.far else "")
        for name, *numbers in zip(
            outcome.views.names, left_px, right_px, np.abs(found.rows_px).mean(axis=1), found.edges.mean(axis=1),
            strict=True,
        )
    ]  # fmt: skip
    header = ("pair", "left rms [px]", "right rms [px]", "rows differ by [px]", "square edges", "")
    return ReportTable("Each pair", header, rows)
