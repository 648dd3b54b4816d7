"""The flat map: rows from the top, black is occupied, and the corner where map_server expects it."""

import cv2
import numpy as np
import pytest

from stereogrid.errors import InvalidInputError
from stereogrid.exporting import export
from stereogrid.exporting.map_server import project
from stereogrid.grid import OccupancyGrid
from stereogrid.sensor_model import log_odds

from .maps import random_map

yaml = pytest.importorskip("ruamel.yaml", reason="needs ruamel.yaml, of rosbags")


def made(cells, p, cell_m=0.5):
    return OccupancyGrid.from_cells(cell_m, np.array(cells), log_odds(np.array(p)))


def read(path):
    """Image (rows, columns) and description, read by OpenCV and a reader of YAML 1.2."""
    image = cv2.imread(str(path.with_suffix(".pgm")), cv2.IMREAD_UNCHANGED)
    return image, yaml.YAML(typ="safe", pure=True).load(path.with_suffix(".yaml").read_text())


def trinary(image, description):
    """What map_server makes of a pixel in its trinary mode: 100 occupied, 0 free, -1 unknown; rows from the bottom."""
    occupancy = (255 - image[::-1].astype(float)) / 255
    occupied = occupancy > description["occupied_thresh"]
    return np.select([occupied, occupancy < description["free_thresh"]], [100, 0], -1)


def test_map_server_finds_every_column_where_it_is(tmp_path):
    grid = random_map(1, spread=12)
    image, description = read(export(grid, tmp_path / "map.pgm", low_m=-1.0, high_m=0.6))
    cells, p = grid.known_cells()
    grid_map = trinary(image, description)
    assert description["image"] == "map.pgm"
    expected = np.full(grid_map.shape, -1)
    centres = (cells + 0.5) * grid.cell_m
    within = (centres[:, 2] >= -1.0) & (centres[:, 2] <= 0.6)
    column = np.floor((centres[:, :2] - description["origin"][:2]) / description["resolution"]).astype(int)
    for x, y in np.unique(column[within], axis=0):
        highest = p[within & (column == (x, y)).all(axis=1)].max()
        expected[y, x] = 100 if highest >= 0.65 else 0 if highest <= 0.196 else -1
    np.testing.assert_array_equal(grid_map, expected)
    assert {100, 0, -1} == set(np.unique(grid_map).tolist())


def test_the_first_row_is_the_farthest_along_y_and_the_origin_is_the_lower_left_corner(tmp_path):
    grid = made([[-2, 3, 0], [0, 4, 0], [1, 6, 0]], [0.9, 0.1, 0.5])
    image, description = read(export(grid, tmp_path / "map.yaml", low_m=0, high_m=1))
    assert image.tolist() == [[205, 205, 205, 205], [205] * 4, [205, 205, 254, 205], [0, 205, 205, 205]]
    assert (description["origin"], description["resolution"]) == ([-1.0, 1.5, 0.0], 0.5)
    assert {key: description[key] for key in ("negate", "occupied_thresh", "free_thresh", "mode")} == {
        "negate": 0,
        "occupied_thresh": 0.65,
        "free_thresh": 0.196,
        "mode": "trinary",
    }


def test_numbers_and_names_stay_what_they_are_for_every_reader(tmp_path):
    grid = made([[0, 0, 0]], [0.9], cell_m=1e-5)
    path = export(grid, tmp_path / 'a "map": # ü.pgm', low_m=0, high_m=1)
    text = path.with_suffix(".yaml").read_text(encoding="utf-8")
    assert "\nresolution: 0.00001\n" in text
    assert read(path)[1]["image"] == path.name


def test_only_cells_with_their_centres_in_the_band_count():
    grid = made([[0, 0, 0], [0, 0, 1], [0, 0, 2]], [0.2, 0.9, 0.3])
    for (low, high), p in {(0, 0.5): 0.2, (0.25, 0.75): 0.9, (1.0, 2.0): 0.3, (0, 9): 0.9}.items():
        origin, found = project(grid, low, high)
        assert found == pytest.approx(np.array([[p]]), abs=1e-3)
        assert origin.tolist() == [0, 0]


@pytest.mark.parametrize("band", [(3.0, 4.0), (1.0, 0.0)])
def test_a_band_without_a_known_cell_is_refused_with_the_heights_that_there_are(tmp_path, band):
    grid = made([[0, 0, 0], [0, 0, 3]], [0.2, 0.9])
    with pytest.raises(InvalidInputError, match=r"no known cell lies between .* m; the map reaches 0\.25 to 1\.75 m"):
        export(grid, tmp_path / "map.pgm", low_m=band[0], high_m=band[1])
    with pytest.raises(InvalidInputError, match="the map reaches nowhere"):
        export(OccupancyGrid(0.1), tmp_path / "map.pgm")
    assert list(tmp_path.iterdir()) == []


def test_a_map_too_wide_for_an_image_is_refused(tmp_path):
    grid = made([[0, 0, 1], [10**6, 10**6, 1]], [0.2, 0.9])
    with pytest.raises(InvalidInputError, match="too wide for an image: 1000001 x 1000001 cells"):
        export(grid, tmp_path / "map.pgm")


def test_both_files_are_checked_before_one_is_written(tmp_path):
    (tmp_path / "map.yaml").mkdir()
    with pytest.raises(InvalidInputError, match=r"map\.yaml: is a folder"):
        export(made([[0, 0, 1]], [0.9]), tmp_path / "map.pgm")
    assert [each.name for each in tmp_path.iterdir()] == ["map.yaml"]
