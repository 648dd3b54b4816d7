"""The map in the browser: what is drawn, who may look, and what it costs whom."""

import base64
import http.client
import json
import re
import shutil
import subprocess
import sys
import threading
import time
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

pytest.importorskip("viser", reason="the view needs viser")

import websockets.exceptions
from websockets.sync.client import connect

from stereogrid.camera import StereoCamera
from stereogrid.errors import MissingExtraError
from stereogrid.geometry import R_BASE_OPTICAL, from_rotation
from stereogrid.grid import OccupancyGrid
from stereogrid.viewer import LiveView
from stereogrid.viewer.scene import cell_colours, height_colours
from stereogrid.viewer.snapshot import Snapshot

CAMERA = StereoCamera(170, 79.5, 59.5, 0.06, 160, 120)
T_WORLD_CAM = from_rotation(R_BASE_OPTICAL, [0.0, 0.0, 0.4])
LEFT = np.random.default_rng(1).integers(0, 256, CAMERA.shape, dtype=np.uint8)
CHROMIUM = shutil.which("chromium") or shutil.which("google-chrome")
FLAGS = (
    *("--headless", "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--no-first-run"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync", "--window-size=640,400"),
)


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


@pytest.mark.parametrize("threshold", [0.5, 0.7, 0.9])
def test_what_is_drawn_are_the_maps_occupied_cells_below_the_height(threshold: float) -> None:
    grid = wall_grid()
    drawn = Snapshot.of(grid).occupied_m(threshold, below_m=0.6)
    centres = grid.occupied_centres(threshold)
    assert 0 < len(drawn) < len(centres)
    assert {tuple(p) for p in drawn.round(6)} == {tuple(p) for p in centres[centres[:, 2] < 0.6].round(6)}


def test_a_snapshot_stays_as_it_was_while_the_map_goes_on() -> None:
    grid = wall_grid()
    snapshot = Snapshot.of(grid)
    before = snapshot.occupied_m(0.5)
    grid.merge(wall_grid(60))
    assert np.array_equal(snapshot.occupied_m(0.5), before)


def test_colours_run_with_height_and_end_at_both_ends() -> None:
    colours = height_colours(np.array([-9.0, -0.2, 0.4, 1.8, 9.0])).astype(int)
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


class Browser:
    """A headless Chromium on one page, asked by its DevTools protocol."""

    def __init__(self, url: str, folder: Path) -> None:
        command = [str(CHROMIUM), *FLAGS, f"--user-data-dir={folder}", "--remote-debugging-port=0", "about:blank"]
        self.process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
        assert self.process.stderr is not None
        port = next(found[1] for line in self.process.stderr if (found := re.search(r"127\.0\.0\.1:(\d+)/", line)))
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/json") as answer:
            pages = [page for page in json.load(answer) if page["type"] == "page"]
        self._socket = connect(pages[0]["webSocketDebuggerUrl"], max_size=None)
        self._n = 0
        self.ask("Page.navigate", url=url)

    def ask(self, method: str, **parameters: Any) -> dict[str, Any]:
        self._n += 1
        self._socket.send(json.dumps({"id": self._n, "method": method, "params": parameters}))
        while (answer := json.loads(self._socket.recv(60))).get("id") != self._n:
            pass
        result: dict[str, Any] = answer["result"]
        return result

    def text(self) -> str:
        shown = self.ask("Runtime.evaluate", expression="document.body ? document.body.innerText : ''")
        return str(shown["result"].get("value", ""))

    def picture(self) -> np.ndarray:
        png = base64.b64decode(self.ask("Page.captureScreenshot")["data"])
        return np.asarray(cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR))

    def close(self) -> None:
        self._socket.close()
        self.process.kill()
        self.process.wait()


def until(true: Callable[[], object], within_s: float = 90.0) -> None:
    end_s = time.monotonic() + within_s
    while not true():
        assert time.monotonic() < end_s, "it did not happen"
        time.sleep(0.2)


def coloured(picture: np.ndarray) -> int:
    """Pixels of the scene that are neither grey nor white, without the panel at the right."""
    scene = picture[:, :330].astype(int)
    return int(np.count_nonzero(scene.max(axis=2) - scene.min(axis=2) > 40))


def test_cells_are_told_apart_by_their_shade_and_a_map_of_many_is_drawn_as_points(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    centres = wall_grid().occupied_centres()
    colours = cell_colours(centres, 0.05).astype(int)
    beside = np.flatnonzero(np.isclose(np.diff(centres[:, 2]), 0.05) & (np.diff(centres[:, 1]) == 0))
    assert len(beside) and (colours[beside].sum(axis=1) != colours[beside + 1].sum(axis=1)).all()
    monkeypatch.setattr("stereogrid.viewer.scene.MOST_CUBES", 100)
    grid, lock = wall_grid(), threading.Lock()
    with viewing() as view:
        view.watch(grid, lock)
        for size in (40, 50):
            with lock:
                grid.merge(wall_grid(size))
            n = len(Snapshot.of(grid).occupied_m(0.6, 1.4))
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
