"""`stereogrid view`: what its page shows of a run, a map and a recording, to whom, and what it says is missing."""

import html
import http.client
import re
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest

pytest.importorskip("viser", reason="the view needs viser")
pytest.importorskip("pybullet", reason="the drive is simulated")

import viser
from browsers import CHROMIUM, Browser, until
from small_drives import small_drive

from stereogrid import cli
from stereogrid.config import GridConfig, MappingConfig, MatcherConfig, save_config
from stereogrid.errors import InvalidInputError
from stereogrid.geometry import from_quaternion_wxyz, transform
from stereogrid.grid import OccupancyGrid
from stereogrid.loopback import is_foreign, is_misled
from stereogrid.mapping_run import build_map
from stereogrid.recording import open_recording
from stereogrid.run_record import RunRecord
from stereogrid.sensor_model import SensorModel
from stereogrid.viewer import MapPage, is_run, subject_of_map, subject_of_recording, subject_of_run
from stereogrid.viewer.colours import slice_image

CONFIG = MappingConfig(
    matcher=MatcherConfig("bm", num_disparities=32), model=SensorModel(max_range_m=3.0), grid=GridConfig(cell_m=0.1)
)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run folder beside its recording."""
    folder = tmp_path_factory.mktemp("runs") / "run"
    folder.mkdir()
    recording = open_recording(small_drive(folder.parent / "drive.mcap"))
    build_map(recording, CONFIG).grid.save(folder / "map.sgrid")
    save_config(CONFIG, folder / "config.toml")
    RunRecord("map", recording="../drive.mcap").save(folder)
    return folder


@pytest.fixture(scope="module")
def page(run: Path) -> Iterator[MapPage]:
    with MapPage(subject_of_run(run)) as shown:
        until(lambda: shown.replay is not None and shown.replay.ended)
        yield shown
        assert shown.fault is None


def ask(page: MapPage, **headers: str) -> int:
    connection = http.client.HTTPConnection("127.0.0.1", int(page.url.rsplit(":", 1)[1].strip("/")), timeout=10)
    connection.putrequest("GET", "/", skip_host="Host" in headers)
    for name, value in headers.items():
        connection.putheader(name, value)
    connection.endheaders()
    return connection.getresponse().status


def test_the_replay_of_a_run_ends_in_the_map_that_was_saved(page: MapPage) -> None:
    replay = page.replay
    assert replay is not None and not replay.fault and replay.done == len(page.subject.poses) > 1
    until(lambda: page._moments.sha256)
    assert replay.sha256 == page._moments.sha256["map"]


def test_ages_are_shown_of_the_whole_map_too(page: MapPage) -> None:
    controls = page.controls
    controls._colour.value = "age"
    until(lambda: f">{len(page.subject.poses)}<" in controls._legend.content)
    assert "last changed by" in controls._legend.content
    controls._colour.value = "height"


@pytest.mark.skipif(CHROMIUM is None, reason="needs chromium")
def test_a_browser_shows_the_run_its_growth_its_slice_and_its_errors(page: MapPage, tmp_path: Path) -> None:
    controls, n = page.controls, len(page.subject.poses)
    browser = Browser(page.url, tmp_path, (760, 560))
    try:
        until(lambda: f"observation {n} of {n}" in browser.text() and page.drawn)
        until(lambda: len(_scene_colours(browser.picture())) > 60)
        whole, picture = page.drawn, browser.picture()
        assert _reddish(picture) > 30  # the path, and the camera's frustum
        controls.number.value = 1
        until(lambda: 0 < page.drawn < whole and f"observation 1 of {n}" in browser.text())
        controls._colour.value = "errors"
        until(lambda: "falsely occupied" in browser.text() or "falsely occupied" in str(controls._legend.content))
        assert re.search(r"truly occupied: [\d,]+", controls._legend.content)
        controls._axis.value = "z"
        until(lambda: page._scene._slice is not None)
        controls._truth.value = 0.5
        until(lambda: page._scene._truth is not None and page._scene._truth.opacity == 0.5)
        until(lambda: np.abs(browser.picture()[:, :400].astype(int) - picture[:, :400]).max() > 60)
    finally:
        cv2.imwrite(str(tmp_path / "page.png"), browser.picture())
        browser.close()
        controls._axis.value, controls._colour.value, controls.number.value = "none", "height", n


def _scene_colours(picture: np.ndarray) -> np.ndarray:
    """Different colours of the scene, without the panel at its right and the note at its left."""
    return np.unique(picture[150:, :400].reshape(-1, 3) // 8, axis=0)


def _reddish(picture: np.ndarray) -> int:
    blue, green, red = picture[:, :400].astype(int).transpose(2, 0, 1)
    return int(np.count_nonzero((red > 150) & (green < 110) & (blue < 110)))


def test_the_page_of_a_run_is_for_this_machine_alone(page: MapPage) -> None:
    assert page.url.startswith("http://127.0.0.1:")
    assert ask(page) == 200
    assert ask(page, Host="evil.example") == 403
    assert ask(page, Origin="http://evil.example") == 403


def test_where_others_may_look_a_name_that_only_leads_here_is_still_refused(run: Path) -> None:
    with MapPage(subject_of_map(run / "map.sgrid"), host="0.0.0.0") as page:
        assert ask(page) == 200
        assert ask(page, Host="evil.example") == 403
        assert ask(page, Origin="http://evil.example") == 403
        own = page.url.removeprefix("http://").strip("/")
        assert ask(page, Host=own, Origin=f"http://{own}") == 200


@pytest.mark.parametrize("host", ["192.168.0.7:8104", "[fe80::1]:8104", "localhost:8104", "127.0.0.1"])
def test_an_address_is_nobodys_other_site(host: str) -> None:
    assert not is_misled(host, None) and not is_misled(host, f"http://{host}")
    assert is_misled(host, "http://192.168.0.8:8104") and is_misled("evil.example", None)
    assert is_foreign("192.168.0.7:8104", None) and is_misled(None, None)


def test_a_page_says_what_it_lacks_and_why(run: Path, tmp_path: Path) -> None:
    grid = run / "map.sgrid"
    assert "a map file has no recording" in subject_of_map(grid).all_missing()[0]
    shutil.copy(grid, tmp_path)
    assert is_run(tmp_path)
    old = subject_of_run(tmp_path)
    assert old.recording is None and "no run.toml" in old.all_missing()[0]
    RunRecord("map", recording="gone.mcap").save(tmp_path)
    gone = subject_of_run(tmp_path)
    assert list(gone.maps) == ["map"] and "gone.mcap: no such file" in gone.all_missing()[0]
    with MapPage(gone) as page:
        until(lambda: page.drawn)
        assert "gone.mcap" in page.controls._missing.content
    RunRecord("experiments corridor", recording=str(run.parent / "drive.mcap")).save(tmp_path)
    shutil.move(tmp_path / "map.sgrid", tmp_path / "map-ideal.sgrid")
    shutil.copy(grid, tmp_path / "map-noisy.sgrid")
    arms = subject_of_run(tmp_path)
    assert set(arms.maps) == {"ideal", "noisy"} and not arms.replays and len(arms.poses) > 1
    assert "experiments corridor" in arms.all_missing()[0]
    for each in tmp_path.glob("map*"):
        each.unlink()
    with pytest.raises(InvalidInputError, match="holds no map"):
        subject_of_run(tmp_path)


def test_a_recording_is_mapped_while_one_looks_on(run: Path) -> None:
    recording = open_recording(run.parent / "drive.mcap")
    with MapPage(subject_of_recording(recording, CONFIG)) as page:
        until(lambda: page.replay is not None and page.replay.ended)
        cells = page.replay.history.cells(len(recording) - 1) if page.replay else None
        assert cells is not None
        choices = page.controls.choices
        until(lambda: page.drawn == len(cells.select(choices.threshold, choices.box(0.1)).cells))
        assert page.drawn and page.fault is None


@pytest.mark.parametrize("axis", ["x", "y", "z"])
def test_the_picture_of_a_slice_stands_where_its_cells_are(axis: str, tmp_path: Path) -> None:
    index = np.stack(np.meshgrid(range(9), range(-7, 6), range(5), indexing="ij"), axis=-1).reshape(-1, 3)
    grid = OccupancyGrid.from_cells(0.1, index, np.random.default_rng(2).normal(0, 2, len(index)))
    with MapPage(subject_of_map(grid.save(tmp_path / "map.sgrid"))) as page:
        page.controls._axis.value = axis
        page.controls._slice.value = 0.23
        at = "xyz".index(axis)
        until(lambda: page._scene._slice is not None and abs(page._scene._slice.position[at] - 0.25) < 1e-6)
        shown = page._scene._slice
        picture, pose = shown.image, from_quaternion_wxyz(shown.wxyz, shown.position)
    height, width = picture.shape[:2]
    # viser's pictures stand as cameras see: columns along x, rows along y.
    x = ((np.arange(width) + 0.5) / width - 0.5) * shown.render_width
    y = ((np.arange(height) + 0.5) / height - 0.5) * shown.render_height
    points = np.stack([*np.meshgrid(x, y), np.zeros(picture.shape[:2])], axis=-1).reshape(-1, 3)
    p = grid.probability(transform(pose, points))
    expected = slice_image(p.reshape(height, width)).astype(int)
    assert np.isnan(p).any() and np.abs(expected - picture).max() <= 1


def test_ctrl_c_ends_the_command_with_one_quiet_line(run: Path) -> None:
    command = [sys.executable, "-m", "stereogrid.cli", "view", str(run / "map.sgrid"), "--no-open", "--port", "0"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stdout is not None
    assert re.fullmatch(r"http://127\.0\.0\.1:\d+/\n", process.stdout.readline())
    assert process.stdout.readline().startswith("not on the page: path, cameras, replay")
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 0 and err == "the page is closed\n", err


def test_options_of_mapping_are_refused_for_what_is_mapped(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.run(cli.app, ["view", str(run), "--cell", "0.2", "--no-open"]) == 1
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and "is mapped already" in error


def test_what_a_foreign_run_says_is_shown_as_it_is_and_does_nothing(tmp_path: Path) -> None:
    """Neither as Markdown, of which a picture would be fetched from elsewhere, nor as HTML."""
    OccupancyGrid.from_cells(0.1, [[1, 2, 3]], [0.9]).save(tmp_path / "map.sgrid")
    said = "![seen](a.png) <img src=x onerror=alert(1)> **bold**"
    RunRecord("map", recording=f"/{said}").save(tmp_path)
    with MapPage(subject_of_run(tmp_path)) as page:
        for handle in (page.controls._missing, page.controls._words):
            assert isinstance(handle, viser.GuiHtmlHandle)
        shown = page.controls._missing.content
        assert html.escape(said) in shown and "<img" not in shown
        page.controls.say(said)
        assert html.escape(said) in page.controls._words.content
