"""The map to turn in a report: its faces are the map's, the page stays small, and it needs no network."""

import base64
import json
import re
import zlib
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from stereogrid.camera import StereoCamera
from stereogrid.errors import InvalidInputError
from stereogrid.exporting.cubes import outer_faces
from stereogrid.figures import cubes_figure, save_figure
from stereogrid.geometry import R_BASE_OPTICAL, from_rotation
from stereogrid.grid import OccupancyGrid
from stereogrid.report import ReportFigure, Scene3D, map_scene, write_report

pytest.importorskip("websockets", reason="asking a browser needs websockets")
from headless import CHROMIUM, OfflinePage

CELL_M = 0.1
PATH_M = np.stack([np.linspace(0, 3, 20), np.zeros(20), np.full(20, 0.4)], axis=1)
EYE = np.array([-4.0, -2.0, 4.0]), np.array([1.5, 0.0, 0.3])


def room(height: int = 8) -> OccupancyGrid:
    """A floor of 4 m x 2 m with a wall of `height` cells at its end, of which one cell is high above."""
    i, j = np.meshgrid(np.arange(40), np.arange(-10, 10), indexing="ij")
    floor = np.stack([i.ravel(), j.ravel(), np.full(i.size, -1)], axis=1)
    j, k = np.meshgrid(np.arange(-10, 10), np.arange(height), indexing="ij")
    wall = np.stack([np.full(j.size, 39), j.ravel(), k.ravel()], axis=1)
    cells = np.concatenate([floor, wall, [[5, 5, 30]]])
    return OccupancyGrid.from_cells(CELL_M, cells, np.full(len(cells), 3.0))


def scene(grid: OccupancyGrid, **changes: object) -> Scene3D:
    options = {"eye_and_target_m": EYE, "above_path_to_m": 1.0, **changes}
    return map_scene(grid, PATH_M, **options)  # type: ignore[arg-type]


def unpacked(packed: str, kind: str) -> np.ndarray:
    return np.frombuffer(zlib.decompress(base64.b64decode(packed)), kind)


def faces_of(shown: Scene3D) -> tuple[np.ndarray, np.ndarray]:
    """Middles (F, 3) [m] and outward normals (F, 3) of the faces, as view3d.js reads them."""
    held = json.loads(shown.json)
    x, y, z, side = np.cumsum(unpacked(held["faces"], "<u2").reshape(4, -1), axis=1, dtype=np.uint16)
    axis = side // 2
    middle = np.stack([x, y, z], axis=1) + 0.5 - 0.5 * np.eye(3)[axis]
    normal = np.eye(3)[axis] * np.where(side % 2, 1, -1)[:, None]
    return held["origin"] + middle * held["cell_m"], normal


def test_the_faces_are_those_between_an_occupied_cell_and_what_is_beside_it() -> None:
    grid = room()
    middle, normal = faces_of(scene(grid))
    inside, outside = (grid.probability(middle + sign * 0.4 * CELL_M * normal) for sign in (-1, 1))
    assert (inside > 0.5).all()
    assert not (outside > 0.5).any()
    low = grid.occupied_centres()
    low = np.floor(low[low[:, 2] < 1.4] / CELL_M).astype(np.int64)
    assert len(middle) == len(outer_faces(low)[1]) == len(np.unique(np.hstack([middle, normal]).round(6), axis=0))


def test_what_is_far_above_the_camera_is_left_out() -> None:
    middle, _ = faces_of(scene(room()))
    assert middle[:, 2].max() < PATH_M[0, 2] + 1.0
    assert faces_of(scene(room(), above_path_to_m=np.inf))[0][:, 2].max() > 3.0


def test_a_map_of_too_many_faces_is_drawn_in_coarser_cells_and_says_so() -> None:
    fine, coarse = scene(room()), scene(room(), most_faces=800)
    assert "instead of" not in fine.note
    assert re.search(r"In cells of 0\.\d m instead of 0\.1 m", coarse.note)
    middle, normal = faces_of(coarse)
    assert 0 < len(middle) <= 800
    cell_m = json.loads(coarse.json)["cell_m"]
    covered = np.floor(room().occupied_centres() / cell_m).astype(int)
    behind = np.floor((middle - 0.5 * cell_m * normal) / cell_m + 1e-9).astype(int)
    assert {tuple(cell) for cell in behind} <= {tuple(cell) for cell in covered}


def test_a_face_costs_about_a_byte() -> None:
    rng = np.random.default_rng(1)
    cells = np.unique(rng.integers(0, [150, 150, 12], size=(9_000, 3)), axis=0)
    shown = scene(OccupancyGrid.from_cells(CELL_M, cells, np.full(len(cells), 3.0)), above_path_to_m=np.inf)
    assert len(shown.json) < 3 * len(faces_of(shown)[0])


def test_a_map_without_a_cell_to_draw_is_no_scene() -> None:
    with pytest.raises(InvalidInputError, match="no occupied cell"):
        map_scene(room(), PATH_M - [0, 0, 9], eye_and_target_m=EYE, above_path_to_m=1.0)


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("run")
    (folder / "config.toml").write_text("[grid]\ncell_m = 0.1\n")
    camera = StereoCamera(170, 79.5, 59.5, 0.06, 160, 120)
    picture = cubes_figure(room(), from_rotation(R_BASE_OPTICAL, [0.0, 0.0, 0.4]), camera, path_m=PATH_M)
    figure = ReportFigure(save_figure(picture, folder / "cubes.png"), "Cubes.", scene(room(), true_path_m=PATH_M + 0.2))
    return write_report(folder, "Map of a room", summary="", arms={}, figures=[figure], facts={})


@pytest.fixture(scope="module")
def page(report: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[OfflinePage]:
    if CHROMIUM is None:
        pytest.skip("needs chromium")
    shown = OfflinePage(report, tmp_path_factory.mktemp("profile"))
    yield shown
    shown.close()


def colours(picture: np.ndarray) -> int:
    """How many colours there are, coarsely."""
    return len(np.unique(picture.reshape(-1, 3) // 16, axis=0))


def test_without_a_network_the_browser_shows_the_map_and_complains_of_nothing(page: OfflinePage) -> None:
    page.look()
    page.until("!!document.querySelector('figure.live')")
    picture = page.picture(".scene canvas")
    assert colours(picture) > 30
    shades = picture.reshape(-1, 3).astype(int)
    assert np.count_nonzero(np.ptp(shades, axis=1) > 40) > 0.02 * len(shades)
    assert page.faults == []
    assert page.requested and all(url.startswith(("file:", "data:")) for url in page.requested)


def test_dragging_turns_the_map_and_the_button_turns_it_back(page: OfflinePage) -> None:
    page.look()
    page.until("!!document.querySelector('figure.live')")
    before = page.picture(".scene canvas")
    x, y = page.value("(r => [r.x + r.width / 2, r.y + 150])(document.querySelector('canvas').getBoundingClientRect())")
    for kind, at in (("mousePressed", x), ("mouseMoved", x + 120), ("mouseReleased", x + 120)):
        page.ask("Input.dispatchMouseEvent", type=kind, x=at, y=y, button="left", buttons=1, clickCount=1)
    turned = page.picture(".scene canvas")
    assert np.count_nonzero(np.abs(turned.astype(int) - before).max(axis=2) > 30) > 2000
    page.value("document.querySelector('.scene button').click()")
    page.until("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(() => done(true))))")
    back = page.picture(".scene canvas")
    assert np.count_nonzero(np.abs(back.astype(int) - before).max(axis=2) > 30) < 200


def test_paper_shows_the_picture_and_what_is_folded_and_a_dark_screen_a_dark_page(page: OfflinePage) -> None:
    shown = "getComputedStyle(document.querySelector('{}')).display !== 'none'"
    height = "document.querySelector('details > :not(summary)').getBoundingClientRect().height"
    page.look()
    page.until("!!document.querySelector('figure.live')")
    assert page.value(shown.format(".scene")) and not page.value(shown.format("figure.live > img"))
    light = page.value("getComputedStyle(document.documentElement).colorScheme")
    page.look(media="print")
    assert not page.value(shown.format(".scene")) and page.value(shown.format("figure.live > img"))
    assert page.value(height) > 20
    page.look(scheme="dark")
    assert light == "light dark"
    dark = page.ask("Page.captureScreenshot", clip={"x": 0, "y": 0, "width": 9, "height": 9, "scale": 1})["data"]
    page.look()
    bright = page.ask("Page.captureScreenshot", clip={"x": 0, "y": 0, "width": 9, "height": 9, "scale": 1})["data"]
    assert dark != bright


def test_a_narrow_screen_needs_no_scrolling_to_the_side(page: OfflinePage) -> None:
    page.look(width_px=360)
    assert page.value("document.documentElement.scrollWidth") <= 360
