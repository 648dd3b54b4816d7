"""A world in a browser: the robot drives along the path, and a page shows it and what its cameras see."""

import html
import time
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from itertools import takewhile
from typing import TypeVar

import cv2

from stereogrid.camera import StereoCamera
from stereogrid.geometry import FloatArray
from stereogrid.interrupts import held_interrupts
from stereogrid.mjpeg import MjpegServer, jpeg

from ..rig import StereoRig, calibration
from ..robot.follower import PathFollower
from ..robot.headway import Headway
from ..robot.pioneer import TICK_S, Pioneer, SimulationError
from ..scene.scene import World
from .viewer import Viewer

BYSTANDER = StereoCamera(560.0, 419.5, 199.5, 0.06, 840, 400)
MOST_LAG_S = 0.5
"""A slow machine shows the drive in slow motion rather than by leaps."""
PAGE = """<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{title}</title><style>
body {{ font: 15px/1.4 system-ui, sans-serif; margin: 1rem auto; max-width: 840px; padding: 0 1rem; }}
h1 {{ font-size: 1.1rem; }} img {{ width: 100%; display: block; background: #ddd; }} figure {{ margin: 0 0 .8rem; }}
.pair {{ display: grid; grid-template-columns: 1fr 1fr; gap: .8rem; }} figcaption {{ color: #666; }}
</style></head><body><h1>{title}</h1>
<figure><img src="/overview.mjpg" alt="the robot from behind"><figcaption>The robot from behind</figcaption></figure>
<div class="pair">
<figure><img src="/left.mjpg" alt="left camera"><figcaption>Left camera</figcaption></figure>
<figure><img src="/right.mjpg" alt="right camera"><figcaption>Right camera</figcaption></figure>
</div></body></html>
"""
Item = TypeVar("Item")
Shown = tuple[FloatArray, float]
"""Where the robot is, T_world_base (4, 4), and the time since its start [s]."""


def serve_view(world: World, *, port: int, say: Callable[[str], None], rig: StereoRig | None = None) -> None:
    """Serve the drive on this machine's loopback until it is interrupted; the address is said once it can be seen.

    An interrupt, or a request to terminate, ends it between two pictures.
    port 0: any that is free. At its end, or when the robot gets stuck, the drive starts again.
    Raises InvalidInputError when the port is in use.
    """
    rig = rig or StereoRig()
    page = PAGE.format(title=html.escape(f"{world.name}, seed {world.seed}")).encode()
    with MjpegServer(port, calibration(rig), page=page, others=("overview",)) as server, ThreadPoolExecutor(1) as pool:
        say(f"preparing {world.name} ...")
        viewer = Viewer(world, BYSTANDER, rig)
        say(f"{world.name} at {server.url} - Ctrl-C ends it")
        for T_world_base, time_s in until_interrupted(drive_for_ever(world, time.monotonic, say)):
            overview = pool.submit(viewer.overview, T_world_base, time_s=time_s)
            left, right = viewer.pair(T_world_base, time_s=time_s)
            shown = cv2.cvtColor(overview.result(), cv2.COLOR_RGB2BGR)
            server.publish(jpeg(left.gray), jpeg(right), time.monotonic(), overview=jpeg(shown))


def until_interrupted(items: Iterable[Item]) -> Iterator[Item]:
    """The items up to an interrupt (SIGINT) or a request to terminate, which then have no other effect."""
    with held_interrupts() as interrupted:
        yield from takewhile(lambda _: not interrupted(), items)


def drive_for_ever(
    world: World, clock: Callable[[], float], say: Callable[[str], None]
) -> Generator[Shown, None, None]:
    """Where the robot is whenever that is asked: as much later as the clock [s] says, but for MOST_LAG_S at most."""
    while True:
        with _told(say):
            yield from _drive_once(world, clock)


@contextmanager
def _told(say: Callable[[str], None]) -> Iterator[None]:
    """A drive that fails is no end of the view."""
    try:
        yield
    except SimulationError as error:
        say(f"{error}; it starts again")


def _drive_once(world: World, clock: Callable[[], float]) -> Generator[Shown, None, None]:
    follower = PathFollower(world.waypoints_m)
    headway = Headway()
    with Pioneer(world) as robot:
        yield robot.T_world_base, robot.time_s
        last_s = clock()
        while not follower.arrived:
            now_s = clock()
            for _ in range(max(1, round(min(now_s - last_s, MOST_LAG_S) / TICK_S))):
                robot.drive(*follower.command(robot.T_world_base, TICK_S))
            last_s = now_s
            headway.check(robot, follower)
            yield robot.T_world_base, robot.time_s
