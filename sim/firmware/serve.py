"""`python -m sim firmware`: a simulated robot for anyone's client."""

from collections.abc import Callable
from contextlib import ExitStack, closing

import arcos
from stereogrid.errors import unknown_name
from stereogrid.interrupts import held_interrupts
from stereogrid.mjpeg import MjpegServer

from ..rig import calibration
from ..robot.pioneer import TICK_S, Pioneer
from ..worlds.world import WorldPlan
from .eyes import Eyes, EyeSettings
from .firmware import Firmware
from .links import Link
from .loop import Loop
from .pacer import Pacer
from .tcp import TcpLink
from .terminal import TerminalLink


def serve(
    world: str,
    *,
    seed: int = 0,
    subclass: str = "p3at",
    port: int | None = 8101,
    battery_v: float = 12.9,
    payload_kg: float = 0.0,
    people: int = 0,
    eyes: EyeSettings | None = None,
    say: Callable[[str], None] = lambda _: None,
    log: Callable[[str], None] = lambda _: None,
    running: Callable[[], bool] = lambda: True,
) -> None:
    """Serve the robot in a world until running() is false or an interrupt; port None: over a pseudo-terminal.

    say: takes the lines that a user needs to connect; log: what happens then. A robot that falls is replaced when it is
    opened the next time, in a world whose time starts again.
    Raises InvalidInputError for an unknown world or subclass, or a port in use. KeyboardInterrupt, or SystemError in
    its place (stereogrid.cli.was_interrupted), comes out while the world is made; afterwards an interrupt only ends
    the loop.
    """
    if subclass not in arcos.ROBOTS:
        raise unknown_name("robot", subclass, arcos.ROBOTS)
    plan = WorldPlan(world, seed, people)
    with ExitStack() as open_things:
        # The ports before the world, which takes its time to make.
        link: Link = open_things.enter_context(closing(TerminalLink() if port is None else TcpLink(port)))
        server = eyes and open_things.enter_context(MjpegServer(eyes.port, calibration(eyes.rig)))
        scene = plan.make()
        robots = open_things.enter_context(ExitStack())

        def renew() -> Pioneer:
            robots.close()
            return robots.enter_context(Pioneer(scene, battery_v=battery_v, payload_kg=payload_kg))

        loop = Loop(renew(), Firmware(subclass, tick_s=TICK_S), link, Pacer(TICK_S), log, renew=renew)
        if eyes and server:
            loop.watch = open_things.enter_context(Eyes(scene, eyes, loop.body, server)).see
            say(f"cameras: {server.url}left.mjpg {server.url}right.mjpg")
        with held_interrupts() as interrupted:
            say(f"{subclass} in {world} (seed {seed}): {link.name}")
            loop.pacer.restart()
            loop.run(lambda: running() and not interrupted())
