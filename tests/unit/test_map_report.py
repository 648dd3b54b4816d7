"""What a run leaves of a map: a figure with nothing to show is left out and said; an unwritten one is an error."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh

from stereogrid.camera import StereoCamera
from stereogrid.config import MappingConfig
from stereogrid.errors import InvalidInputError, StereogridError
from stereogrid.geometry import R_BASE_OPTICAL, Array, from_rotation
from stereogrid.grid import OccupancyGrid
from stereogrid.map_report import draw_all, map_drawings, save_trajectory, write_mapped
from stereogrid.map_truth import KnownTruth, known_truth
from stereogrid.mapped import Mapped, untracked
from stereogrid.observation import Disparity, Observation, Odometry

CAMERA = StereoCamera(170, 79.5, 59.5, 0.06, 160, 120)
SOURCE = SimpleNamespace(camera=CAMERA)
PATH = np.stack([from_rotation(R_BASE_OPTICAL, [0.1 * n, 0.0, 0.4]) for n in range(4)])


def mapped(cells: list[list[int]], n: int = 4) -> Mapped:
    grid = OccupancyGrid.from_cells(0.1, cells, [2.0] * len(cells))
    image = np.full(CAMERA.shape, 99, np.uint8)
    sample = (
        Observation(0.0, image, image, Odometry(np.eye(4)), PATH[0]),
        Disparity(*np.full((2, *CAMERA.shape), 3.0, np.float32)),
    )
    return Mapped(grid, PATH[:n], sample, 0.5, stamps_s=10.0 + np.arange(n))


ROOM = mapped([[10, 0, 4], [12, 3, 4], [12, 3, 5]])
EMPTY_THERE = mapped([[10, 0, 40]], n=1)


def test_what_has_nothing_to_show_is_left_out_and_the_report_says_so(tmp_path: Path) -> None:
    write_mapped(tmp_path, EMPTY_THERE, source=SOURCE, title="Map", facts={})
    assert {path.name for path in tmp_path.glob("*.png")} == {"disparity.png"}
    report = (tmp_path / "report.html").read_text()
    for line in ("No figure slice: the map knows no cell at z = 0.40 m", "No figure cubes: ", "No figure trajectory: "):
        assert line in report
    write_mapped(tmp_path, ROOM, source=SOURCE, title="Map", facts={})
    assert "No figure" not in (tmp_path / "report.html").read_text()


def test_a_figure_that_cannot_be_written_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match=r"gone: no such folder"):
        draw_all(map_drawings(ROOM, SOURCE), tmp_path / "gone")


def test_the_true_way_is_drawn_as_far_as_the_map_goes() -> None:
    known = KnownTruth(poses=np.concatenate([PATH, PATH]))
    assert np.array_equal(known.path_m(4), PATH[:, :3, 3])  # type: ignore[arg-type]
    assert KnownTruth().path_m(4) is None and KnownTruth(poses=PATH[:2]).path_m(4) is None


class Claims:
    """A recording that carries this as its truth."""

    camera = CAMERA

    def __init__(self, poses: np.ndarray, corner: float) -> None:
        mesh = trimesh.creation.box((1, 1, 1))
        mesh.vertices[0] = corner
        self._poses, self._ply = poses, mesh.export(file_type="ply")

    def true_poses(self) -> np.ndarray:
        return self._poses

    def truth_mesh_ply(self) -> bytes:
        return self._ply


@pytest.mark.parametrize(
    ("poses", "corner", "why"),
    [
        (np.full((4, 4, 4), np.nan), -0.5, "of no observation the true pose is known"),
        (PATH, np.nan, "finite"),
        (PATH, np.inf, "finite"),
    ],
)
def test_a_truth_that_cannot_be_ends_no_map_that_was_not_to_be_scored(poses: Array, corner: float, why: str) -> None:
    recording = Claims(poses, corner)
    known = known_truth(recording, MappingConfig(), None, untracked)
    assert known.truth is None and why in known.why_not and "\n" not in known.why_not
    with pytest.raises(StereogridError, match=why):
        known_truth(recording, MappingConfig(), True, untracked)


def test_the_trajectory_is_kept_where_its_stamps_are_known(tmp_path: Path) -> None:
    save_trajectory(replace(ROOM, stamps_s=None), tmp_path / "none.tum")
    assert not (tmp_path / "none.tum").exists()
    save_trajectory(ROOM, tmp_path / "trajectory.tum")
    rows = np.loadtxt(tmp_path / "trajectory.tum")
    assert rows[:, 0] == pytest.approx([10, 11, 12, 13])
    assert rows[:, 1:4] == pytest.approx(PATH[:, :3, 3])
    assert np.linalg.norm(rows[:, 4:], axis=1) == pytest.approx(1)


def test_of_a_recording_without_a_truth_nobody_expects_scores() -> None:
    assert known_truth(SOURCE, MappingConfig(), None, untracked) == KnownTruth()
