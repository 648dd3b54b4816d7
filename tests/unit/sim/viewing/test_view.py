"""Looking at a world: where the bystander stands, what he sees of the robot, and the files that are written."""

import io
import json
import os
import re
import signal
import socket
import time
import urllib.request
from dataclasses import replace
from itertools import islice

import numpy as np
import PIL.Image
import pytest
import trimesh

pytest.importorskip("pybullet", reason="the simulator needs pybullet (Python 3.10 or 3.11)")

from sim.__main__ import app
from sim.rig import MINORU, StereoRig
from sim.scene.scene import Lamp, Sky, World
from sim.scene.solids import Paint, box
from sim.scene.terrain import Terrain
from sim.scene.textures import Texture
from sim.viewing.export import export_world
from sim.viewing.live import drive_for_ever, serve_view, until_interrupted
from sim.viewing.picture import GRAY_LEVELS, WIDTH_PX, depth_colours, draw_picture, png_within
from sim.viewing.robot_body import robot_solids
from sim.viewing.viewer import Viewer, pose_at, without_ceiling
from stereogrid.camera import StereoCamera
from stereogrid.cli import run as run_command
from stereogrid.errors import InvalidInputError
from stereogrid.exporting.glb import T_GLTF_WORLD
from stereogrid.geometry import as_pose, inverse, transform
from stereogrid.scoring.solids import closed_bodies

SMALL = StereoCamera(120.0, 79.5, 59.5, 0.06, 160, 120)
RIG = StereoRig(replace(MINORU, focal_px=200.0, cx_px=79.5, cy_px=59.5, width_px=160, height_px=120))
CHECKS = Texture(np.kron([[60, 200], [200, 60]], np.ones((32, 32))).astype(np.uint8))


def a_world(*more, **given):
    """A floor of 20 x 8 m with a path of 6 m and a corner, and whatever is put on it."""
    floor = box("floor", (-4, -4, -0.1), (16, 4, 0), Paint("checks"))
    parts = {"lamps": (), "sky": Sky(), "waypoints_m": np.array([[0.0, 0], [4, 0], [4, 2]]), **given}
    return World("a floor", 0, (floor, *more), {"checks": CHECKS}, **parts)


@pytest.fixture(scope="module")
def viewer():
    return Viewer(a_world(), SMALL, RIG)


def red(overview):
    """(H, W) where a picture (H, W, 3) is red."""
    r, g, b = np.moveaxis(overview.astype(int), -1, 0)
    return (r > 2 * g) & (r > 2 * b) & (r > 25)


def test_the_robot_is_made_of_closed_bodies_and_stands_on_its_wheels():
    solids = robot_solids(StereoRig())
    for solid in solids:
        faces = solid.mesh().faces
        assert sum(map(len, closed_bodies(solid.vertices_m, faces))) == len(faces), solid.name
        assert solid.mesh().volume > 0, solid.name
    points = np.concatenate([solid.vertices_m for solid in solids])
    assert points[:, 2].min() == pytest.approx(0, abs=1e-9)
    length_m, width_m = np.ptp(points, axis=0)[:2]
    # As measured on the real one: 508 x 497 mm.
    assert length_m == pytest.approx(0.508, abs=0.02) and width_m == pytest.approx(0.497, abs=0.03)


def test_the_lenses_are_where_the_rig_has_its_cameras():
    lenses = [solid.vertices_m.mean(axis=0) for solid in robot_solids(StereoRig()) if solid.name.endswith("lens")]
    left_m = StereoRig().T_base_cam[:3, 3]
    np.testing.assert_allclose(lenses, [left_m, left_m - [0, MINORU.baseline_m, 0]], atol=0.01)


def test_the_bystander_sees_the_robot_red_and_all_else_gray(viewer):
    T = pose_at(viewer.world, 1.0)
    overview = viewer.overview(T)
    assert 20 < red(overview).sum() < 2000
    row, column = np.argwhere(red(overview)).mean(axis=0)
    expected = SMALL.K @ transform(inverse(viewer.eye(T)), transform(T, [-0.25, 0, 0.15]))
    assert np.hypot(column - expected[0] / expected[2], row - expected[1] / expected[2]) < 6
    others = overview[~red(overview)].astype(int)
    assert np.mean(np.ptp(others, axis=1) == 0) > 0.98  # but for the gold of the sonars


def test_the_robot_does_not_see_itself(viewer):
    T = pose_at(viewer.world, 1.0)
    sight = viewer.look(T)
    left, right = RIG.look(viewer._seen_by_robot, T)
    np.testing.assert_array_equal(sight.left, left.gray)
    np.testing.assert_array_equal(sight.right, right)
    assert np.isnan(sight.depth_m[0]).all() and np.isfinite(sight.depth_m[-1]).all()  # sky above, floor below


def test_the_bystander_goes_up_where_a_wall_stands_between(viewer):
    wall = box("wall", (-1.2, -4, 0), (-1.0, 4, 3), Paint("checks"))
    hidden = Viewer(a_world(wall), SMALL, RIG)
    T = pose_at(hidden.world, 0.0)
    assert hidden.eye(T)[2, 3] > viewer.eye(T)[2, 3] + 0.5
    assert red(hidden.overview(T)).sum() > 5  # from so steep the plate hides most of it


def test_indoors_the_ceiling_is_left_out_for_the_bystander_alone():
    ceiling = box("ceiling", (-4, -4, 2.6), (16, 4, 2.7), Paint("checks"))
    indoors = a_world(ceiling, lamps=(Lamp((2.0, 0.0, 2.5), (1.0, 0.3)),), sky=None)
    assert [solid.name for solid in without_ceiling(indoors).solids] == ["floor"]
    sight = Viewer(indoors, SMALL, RIG).look(pose_at(indoors, 1.0))
    assert red(sight.overview).sum() > 20
    assert np.isfinite(sight.depth_m[0]).all()
    outdoors = a_world(ceiling)
    assert without_ceiling(outdoors) is outdoors


@pytest.mark.parametrize(
    ("station_m", "xy", "heading"), [(0, (0, 0), 0), (3.5, (3.5, 0), 0), (5, (4, 1), np.pi / 2), (6, (4, 2), np.pi / 2)]
)
def test_a_place_along_the_path_is_on_it_and_heads_along_it(station_m, xy, heading):
    T = as_pose(pose_at(a_world(), station_m), "pose")
    np.testing.assert_allclose(T[:3, 3], [*xy, 0], atol=1e-9)
    np.testing.assert_allclose(T[:2, 0], [np.cos(heading), np.sin(heading)], atol=1e-9)


def test_on_a_slope_the_robot_lies_in_it():
    slope = Terrain(np.add.outer(0.1 * np.arange(9), 0.2 * np.arange(21)), (-4.0, -4.0), 1.0, "checks")
    T = pose_at(a_world(terrain=slope), 1.5)
    assert T[2, 3] == pytest.approx(float(slope.height_m([1.5, 0])), abs=1e-6)
    np.testing.assert_allclose(T[:3, 2] / T[2, 2], [-0.2, -0.1, 1], atol=1e-6)


@pytest.mark.parametrize("station_m", [-0.1, 6.1, np.nan])
def test_a_place_beyond_the_path_is_refused(station_m):
    with pytest.raises(InvalidInputError, match=r"'a floor' is 6\.0 m long"):
        pose_at(a_world(), station_m)


def test_the_picture_is_1200_px_wide_and_small_and_earlier_ones_are_replaced(tmp_path):
    path = tmp_path / "floor.png"
    path.write_bytes(b"an earlier one")
    assert draw_picture(a_world(), path, at_m=1.0, rig=RIG) == path
    assert path.stat().st_size < 300_000
    picture = np.asarray(PIL.Image.open(path).convert("RGB"))
    assert picture.shape[1] == WIDTH_PX
    assert red(picture[:500]).sum() > 500


@pytest.mark.parametrize("name", ["floor.jpg", "floor", "nowhere/floor.png"])
def test_a_picture_that_cannot_be_written_is_refused_before_it_is_drawn(name, tmp_path):
    with pytest.raises(InvalidInputError, match=r"\.png|no such folder"):
        draw_picture(a_world(), tmp_path / name)
    assert not list(tmp_path.iterdir())


def test_colours_of_depth_run_from_red_to_blue_and_nothing_is_gray():
    near, far, none = depth_colours(np.array([[0.6, 25.0, np.nan]], np.float32))[0].astype(int)
    assert near[0] > near[2] and far[2] > far[0] and np.ptp(none) == 0


def test_a_noisy_picture_gets_fewer_levels_of_gray_and_keeps_its_colours():
    rng = np.random.default_rng(0)
    noise = np.repeat(rng.integers(0, 256, (200, 200, 1), dtype=np.uint8), 3, axis=2)
    noise[:20] = depth_colours(np.full((20, 200), 2.0, np.float32))
    fine, coarse = (
        np.asarray(PIL.Image.open(io.BytesIO(png_within(noise, n))).convert("RGB")) for n in (10**6, 25_000)
    )
    assert len(png_within(noise, 25_000)) <= 25_000
    assert len(np.unique(fine[20:])) == GRAY_LEVELS[0] > len(np.unique(coarse[20:]))
    for found in fine, coarse:
        assert np.abs(found[:20].astype(int) - noise[:20]).max() <= 12
        assert np.abs(found[20:].astype(int) - noise[20:]).max() <= 255 / (len(np.unique(coarse[20:])) - 1) / 2 + 1


@pytest.mark.parametrize("suffix", [".glb", ".ply"])
def test_an_exported_mesh_is_the_worlds(suffix, tmp_path):
    world = a_world(box("post", (1, 1, 0), (1.2, 1.2, 2), Paint("checks")))
    loaded = trimesh.load(export_world(world, tmp_path / f"world{suffix}"), force="mesh", process=False)
    if suffix == ".glb":
        loaded.apply_transform(inverse(T_GLTF_WORLD))
    np.testing.assert_allclose(loaded.bounds, world.mesh().bounds, atol=1e-5)
    assert loaded.volume == pytest.approx(world.mesh().volume, rel=1e-5)
    assert set(np.unique(loaded.visual.vertex_colors[:, :3])) == {130}


def test_the_drive_follows_the_clock_but_never_leaps_and_starts_again_at_its_end():
    world = a_world(waypoints_m=np.array([[0.0, 0], [0.4, 0]]))
    times = iter(np.arange(0, 1000, 10.0))
    shown = list(islice(drive_for_ever(world, lambda: next(times), say=[].append), 40))
    seconds = np.array([time_s for _, time_s in shown])
    start = np.flatnonzero(seconds == 0)
    assert len(start) >= 2
    steps = np.diff(seconds[: start[1]])
    assert (steps > 0).all() and steps.max() == pytest.approx(0.5, abs=1e-6)
    assert shown[start[1] - 1][0][0, 3] == pytest.approx(0.4, abs=0.05)
    assert shown[start[1]][0][0, 3] == pytest.approx(0, abs=0.02)


def test_a_robot_that_is_stuck_is_told_and_starts_again():
    world = a_world(box("wall", (0.8, -2, 0), (1.0, 2, 1), Paint("checks")))
    times, said = iter(np.arange(0, 1000, 10.0)), []
    shown = list(islice(drive_for_ever(world, lambda: next(times), say=said.append), 60))
    assert sum(time_s == 0 for _, time_s in shown) >= 2
    assert said and "starts again" in said[0]


@pytest.mark.parametrize("what", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupt_ends_the_view_between_two_pictures_and_then_interrupts_again(what):
    before = signal.getsignal(what)
    seen = []
    for number in until_interrupted(iter(range(10))):
        seen.append(number)
        if number == 3:
            os.kill(os.getpid(), what)
            time.sleep(0.01)  # the rest of the picture is still made
    assert seen == [0, 1, 2, 3]
    assert signal.getsignal(what) == before


class EnoughError(Exception):
    """The test has seen what it wanted."""


def test_the_page_shows_three_streams_on_the_loopback():
    seen = {}

    def say(line):
        if url := re.search(r"http://127\.0\.0\.1:\d+/", line):
            seen["url"] = url.group()

    published = []

    def watch(server, left, right, stamp_s, **others):
        publish(server, left, right, stamp_s, **others)
        published.append(stamp_s)
        page = urllib.request.urlopen(seen["url"], timeout=10).read().decode()
        assert all(f"/{name}.mjpg" in page for name in ("overview", "left", "right"))
        for name, shape in (("overview", (400, 840, 3)), ("left", (120, 160)), ("right", (120, 160))):
            picture = urllib.request.urlopen(f"{seen['url']}{name}.jpg", timeout=10).read()
            assert np.asarray(PIL.Image.open(io.BytesIO(picture))).shape == shape
        assert json.loads(urllib.request.urlopen(seen["url"] + "camera.json", timeout=10).read())["width_px"] == 160
        if len(published) == 2:
            raise EnoughError

    from stereogrid.mjpeg import MjpegServer

    publish = MjpegServer.publish
    with pytest.MonkeyPatch.context() as patch, pytest.raises(EnoughError):
        patch.setattr(MjpegServer, "publish", watch)
        serve_view(a_world(), port=0, say=say, rig=RIG)
    with pytest.raises(OSError):
        urllib.request.urlopen(seen["url"], timeout=2)


def test_what_cannot_be_is_refused_in_one_line(tmp_path, capsys):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = str(taken.getsockname()[1])
        for arguments, named in (
            (["view", "corridor", "--port", port], port),
            (["view", "moon"], "no world named 'moon'; choose from: corridor, .*"),
            (["view", "corridor", "--seed", "-1"], "seed must be >= 0"),
            (["export", "corridor", "--out", str(tmp_path / "x.stl")], r"choose from: \.glb, \.ply"),
            (["export", "moon", "--out", str(tmp_path / "x.ply")], "no world named 'moon'; choose from: corridor, .*"),
        ):
            assert run_command(app, arguments) == 1
            assert re.fullmatch(f"error: .*{named}.*\n", capsys.readouterr().err)
    assert not list(tmp_path.iterdir())
