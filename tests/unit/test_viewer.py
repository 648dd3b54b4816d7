"""The map in the browser: what is drawn, who may look, and what it costs whom."""

import http.client
import re
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import cv2
import numpy as np
import pytest

pytest.importorskip("viser", reason="the view needs viser")

import msgspec
import viser
import websockets.exceptions
from browsers import CHROMIUM, Browser, until
from websockets.sync.client import connect

from stereogrid.camera import StereoCamera
from stereogrid.errors import InvalidInputError, MissingExtraError
from stereogrid.geometry import R_BASE_OPTICAL, from_rotation
from stereogrid.grid import OccupancyGrid
from stereogrid.viewer import LiveView
from stereogrid.viewer.colours import PALETTES, ramp, shaded
from stereogrid.viewer.controls import Choices
from stereogrid.viewer.server import close_server, open_server, url_of
from stereogrid.viewer.snapshot import Snapshot

CAMERA = StereoCamera(170, 79.5, 59.5, 0.06, 160, 120)
T_WORLD_CAM = from_rotation(R_BASE_OPTICAL, [0.0, 0.0, 0.4])
LEFT = np.random.default_rng(1).integers(0, 256, CAMERA.shape, dtype=np.uint8)


def wall_grid(n: int = 40) -> OccupancyGrid:
    """A wall ahead, of cells that grow surer with height, and free cells before it."""
    j, k = np.meshgrid(np.arange(-n, n), np.arange(0, n // 2), indexing="ij")
    wall = np.stack([np.full(j.size, 40), j.ravel(), k.ravel()], axis=1)
    odds = np.concatenate([0.1 + 0.2 * k.ravel(), np.full(j.size, -2.0)])
    return OccupancyGrid.from_cells(0.05, np.concatenate([wall, wall - [1, 0, 0]]), odds)


@contextmanager
def viewing() -> Iterator[LiveView]:
    with LiveView(CAMERA) as view:
        yield view
        assert view.fault is None


def ask(view: LiveView, path: str = "/", **headers: str) -> int:
    port = int(view.url.rsplit(":", 1)[1].strip("/"))
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=10)
    connection.putrequest("GET", path, skip_host="Host" in headers)
    for name, value in headers.items():
        connection.putheader(name, value)
    connection.endheaders()
    return connection.getresponse().status


def occupied_m(grid: OccupancyGrid, threshold: float, below_m: float = np.inf) -> np.ndarray:
    """Centres (N, 3) of the cells that are drawn."""
    cells = Snapshot.of(grid).cells()
    choices = Choices(threshold, (-np.inf, below_m))
    return cells.centres_m(cells.select(threshold, choices.box(cells.cell_m)).cells)


@pytest.mark.parametrize("threshold", [0.5, 0.7, 0.9])
def test_what_is_drawn_are_the_maps_occupied_cells_below_the_height(threshold: float) -> None:
    grid = wall_grid()
    drawn = occupied_m(grid, threshold, below_m=0.6)
    centres = grid.occupied_centres(threshold)
    assert 0 < len(drawn) < len(centres)
    assert {tuple(p) for p in drawn.round(6)} == {tuple(p) for p in centres[centres[:, 2] < 0.6].round(6)}


def test_a_snapshot_stays_as_it_was_while_the_map_goes_on() -> None:
    grid = wall_grid()
    snapshot = Snapshot.of(grid)
    before = snapshot.values()
    grid.merge(wall_grid(60))
    assert np.array_equal(snapshot.values(), before)


def test_colours_run_with_height_and_end_at_both_ends() -> None:
    colours = ramp(np.array([-9.0, -0.2, 0.4, 1.8, 9.0]), (-0.2, 1.8), PALETTES["height"]).astype(int)
    assert (colours[0] == colours[1]).all() and (colours[3] == colours[4]).all()
    brightness = colours.sum(axis=1)
    assert brightness[0] < brightness[2] < brightness[4]


def test_the_page_is_for_this_machines_own_browser_alone() -> None:
    with viewing() as view:
        assert view.url.startswith("http://127.0.0.1:")
        assert ask(view) == 200
        assert ask(view, Host="evil.example") == 403
        assert ask(view, Origin="http://evil.example") == 403
        own = view.url.strip("/")
        assert ask(view, Origin=own) == 200
        address = own.replace("http", "ws")
        for origin in ("http://evil.example", "http://127.0.0.1:1", "null"):
            with pytest.raises(websockets.exceptions.InvalidStatus, match="403"):
                connect(address, origin=origin)  # type: ignore[arg-type]
        with connect(address, origin=own, subprotocols=["viser-v0"]):  # type: ignore[arg-type, list-item]
            pass


def test_no_page_can_open_a_tunnel_to_the_world(monkeypatch: pytest.MonkeyPatch) -> None:
    """As a page would ask for it: by the message that the button sends, which is not shown."""
    opened: list[object] = []
    monkeypatch.setattr("viser._viser.ViserTunnel", lambda *address: opened.append(address))
    server = open_server(0, "a map")
    try:
        own = url_of(server).strip("/")
        asked = connect(own.replace("http", "ws"), origin=own, subprotocols=[f"viser-v{viser.__version__}"])  # type: ignore[arg-type, list-item]
        with asked as page:
            page.send(msgspec.msgpack.encode({"type": "ShareUrlRequest"}))
            # What comes after it has been dealt with: the same client may still be told of changes.
            page.ping().wait(10)
            time.sleep(0.3)
            assert not opened and server.request_share_url() is None
    finally:
        close_server(server)


def test_showing_never_waits_for_the_page_and_a_fault_of_the_page_is_no_fault_of_the_map() -> None:
    grid, lock = wall_grid(), threading.Lock()
    with LiveView(CAMERA) as view:
        view.watch(grid, lock)
        start_s = time.monotonic()
        for n in range(200):
            view.show(LEFT, from_rotation(R_BASE_OPTICAL, [0.01 * n, 0, 0.4]))
        assert time.monotonic() - start_s < 0.5
        view.watch("no map", lock)  # type: ignore[arg-type]
        end_s = time.monotonic() + 20
        while view.fault is None and time.monotonic() < end_s:
            time.sleep(0.01)
        assert isinstance(view.fault, AttributeError)
        view.show(LEFT, T_WORLD_CAM)


def test_without_viser_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "viser", None)
    with pytest.raises(MissingExtraError, match=re.escape('pip install "stereogrid[view]"')):
        LiveView(CAMERA)


def coloured(picture: np.ndarray) -> int:
    """Pixels of the scene that are neither grey nor white, without the panel at the right."""
    scene = picture[:, :330].astype(int)
    return int(np.count_nonzero(scene.max(axis=2) - scene.min(axis=2) > 40))


def test_cells_are_told_apart_by_their_shade_and_a_map_of_many_is_drawn_as_points(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    cells = Snapshot.of(wall_grid()).cells().select(0.5).cells
    cells = cells[np.lexsort(cells.T[::-1])]
    colours = shaded(ramp(cells[:, 2].astype(float), (-4, 36), PALETTES["height"]), cells).astype(int)
    beside = np.flatnonzero((np.diff(cells[:, 2]) == 1) & (np.diff(cells[:, 1]) == 0))
    assert len(beside) and (colours[beside].sum(axis=1) != colours[beside + 1].sum(axis=1)).all()
    monkeypatch.setattr("stereogrid.viewer.scene.MOST_CUBES", 100)
    grid, lock = wall_grid(), threading.Lock()
    with viewing() as view:
        view.watch(grid, lock)
        for size in (40, 50):
            with lock:
                grid.merge(wall_grid(size))
            n = len(occupied_m(grid, 0.6, 1.4))
            until(lambda n=n: view.drawn == n)


@pytest.mark.skipif(CHROMIUM is None, reason="needs chromium")
def test_a_browser_shows_the_map_as_it_grows(tmp_path: Path) -> None:
    grid, lock = OccupancyGrid(0.05), threading.Lock()
    with viewing() as view:
        view.watch(grid, lock)
        view.show(LEFT, T_WORLD_CAM)
        browser = Browser(view.url, tmp_path)
        try:
            until(lambda: "0 cells of 5 cm" in browser.text())
            before = coloured(browser.picture())
            with lock:
                grid.merge(wall_grid())
            until(lambda: re.search(r"\d,\d{3} cells of 5 cm", browser.text()))
            until(lambda: coloured(browser.picture()) > before + 500)
        finally:
            cv2.imwrite(str(tmp_path / "view.png"), browser.picture())
            browser.close()


@pytest.mark.parametrize("host", ["nohost.invalid", "192.0.2.1"])
def test_a_host_that_is_not_this_machine_is_refused_at_once(host):
    with pytest.raises(InvalidInputError, match="is no address of this machine"):
        open_server(0, "view", host=host)
