"""How fast the renderer bakes and photographs, and a drive is recorded, in CPU seconds. No time is asserted.

`python -m pytest tests/bench/test_render.py --benchmark-columns=min,median,rounds` prints a table.
"""

import time
from contextlib import closing
from functools import cache
from itertools import cycle

import numpy as np
import pytest

pytest.importorskip("embreex")
pytest.importorskip("pybullet")

from open_air import open_air

from sim import source
from sim.rendering.render import Renderer
from sim.rig import MINORU, StereoRig
from sim.scene.scene import World
from sim.source import Drive
from sim.worlds.world import make_world
from stereogrid.geometry import from_yaw
from stereogrid.recording.mcap import McapWriter

RIG = StereoRig()
PLACES = {
    "corridor": [(0.0, 2.0, 0.0), (0.2, 8.0, 0.1), (1.0, 17.3, 0.3), (1.7, 17.4, 6.0), (2.4, 10.0, 0.6)],
    "open air": [(0.0, 0.0, 0.0), (0.3, 3.0, 0.0), (-0.6, 9.0, -0.3), (2.5, 12.0, 1.0), (-1.2, 6.0, 0.0)],
}


@cache
def world_of(name: str) -> World:
    """The corridor, or 100 000 faces under a sky: 22 000 leaves, hills of 45 m, a walker, glass, a mirror, varnish."""
    return make_world("corridor", 0) if name == "corridor" else open_air(600, 36, 22.5)


@cache
def renderer_of(name: str) -> Renderer:
    renderer = Renderer(world_of(name))
    renderer.view(MINORU, RIG.T_base_cam)
    renderer.view_rows(MINORU, np.tile(RIG.T_base_cam, (MINORU.height_px, 1, 1)))
    return renderer


@pytest.mark.parametrize("name", PLACES)
@pytest.mark.benchmark(group="bake", timer=time.process_time)
def test_bake(benchmark, name):
    world = world_of(name)
    renderer_of(name)
    benchmark.pedantic(lambda: Renderer(world), rounds=2)


@pytest.mark.parametrize("supersampling", [1, "edges", 2])
@pytest.mark.parametrize("name", PLACES)
@pytest.mark.benchmark(group="view, 640 x 480", timer=time.process_time)
def test_view(benchmark, name, supersampling):
    """A round is a view; the median is over places along the path."""
    renderer, upcoming = renderer_of(name), cycle(PLACES[name])

    def place():
        yaw, x, y = next(upcoming)
        return (MINORU, from_yaw(yaw, [x, y, 0.0]) @ RIG.T_base_cam), {"supersampling": supersampling}

    benchmark.pedantic(renderer.view, setup=place, rounds=4 * len(PLACES[name]))


@pytest.mark.parametrize("name", PLACES)
@pytest.mark.benchmark(group="rolling shutter, 640 x 480", timer=time.process_time)
def test_rows(benchmark, name):
    poses = np.array([from_yaw(1e-4 * y) @ RIG.T_base_cam for y in range(MINORU.height_px)])
    benchmark.pedantic(renderer_of(name).view_rows, (MINORU, poses), rounds=5)


@pytest.mark.benchmark(group="preparing outdoor: the world, its light", timer=time.process_time)
def test_preparing_outdoor(benchmark):
    benchmark.pedantic(lambda: Renderer(make_world("outdoor", 0)), rounds=1)


@pytest.mark.benchmark(group="recording outdoor's first 10 m, 640 x 480, every 0.2 m", timer=time.process_time)
def test_drive(benchmark, tmp_path, monkeypatch):
    """A round is a pair with its physics and its writing. The target: 60 m, which are 300 pairs, and their preparation
    in 90 s."""
    drive = Drive(make_world("outdoor", 0), RIG, every_m=0.2)
    renderer = Renderer(drive.world)
    monkeypatch.setattr(source, "make_renderer", lambda name, world: renderer)
    with closing(iter(drive)) as pairs, McapWriter(tmp_path / "drive.mcap", drive.camera, drive.T_base_cam) as writer:
        # The first pair waits for those that are made ahead.
        writer.write(next(pairs))
        benchmark.pedantic(lambda: writer.write(next(pairs)), rounds=50)
