"""All checks in their order: the computer, what is plugged in, then what answers."""

import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from stereogrid.calibration import CalibrationFile, Rig
from stereogrid.checks import NOT_THERE, OK, PROBLEM, Check, split_trouble
from stereogrid.errors import StereogridError

from ..cameras import open_cameras
from ..cameras.discovery import DEV, VideoDevice, find_cameras
from ..cameras.minoru import FPS, SIZE_PX
from ..cameras.opening import CAMERA_JSON
from ..cameras.pairs import RawPair
from .calibration import check_file, check_fit, check_own, check_size
from .cameras import check_bandwidth, check_devices, check_minoru
from .machine import check_machine
from .permissions import User, check_group, check_node, read_groups
from .pictures import judge, measure
from .robot import LISTEN_S, check_robot
from .serial_lines import check_adapters, check_lines, nodes, serial_lines
from .usb import UsbDevice, usb_devices


@dataclass(frozen=True)
class Wanted:
    """What to look at beyond what is plugged in: addresses as the other commands take them; None: not given.

    size_px: of the pictures, None: the calibration's, or the Minoru's usual one; folder: where recordings will be.
    """

    robot: str | None = None
    camera: str | None = None
    calibration: Path | None = None
    size_px: tuple[int, int] | None = None
    fps: float = FPS
    swap: bool = False
    folder: Path = Path()


def examine(wanted: Wanted, say: Callable[[str], None] = lambda _: None) -> Iterator[Check]:
    """One check after the other; say: told what takes a while. Nothing that is asked for here moves the robot."""
    yield from check_machine(wanted.folder)
    devices = usb_devices()
    cameras = find_cameras()
    yield from _lines(devices)
    yield from check_devices(cameras, devices)
    file = None
    size_px = wanted.size_px or SIZE_PX
    if wanted.calibration is not None:
        checks, file = check_file(wanted.calibration)
        yield from checks
        if file is not None:
            size_px = wanted.size_px or file.calibration.size_px
    yield from check_bandwidth(_ports(wanted.camera, cameras, devices), size_px, wanted.fps)
    yield from _robot(wanted.robot, say)
    yield from _pairs(wanted, _spec(wanted.camera, cameras), size_px, file, say)


def _lines(devices: list[UsbDevice]) -> Iterator[Check]:
    user, groups, lines = User.current(), read_groups(), serial_lines()
    yield check_group("serial", user, groups)
    yield check_group("video", user, groups)
    yield from check_lines(lines)
    yield from check_adapters(devices)
    for node in nodes(lines):
        yield check_node(node, user, groups, opens=os.access(node, os.R_OK | os.W_OK))


def _robot(address: str | None, say: Callable[[str], None]) -> Iterator[Check]:
    if address is None:
        yield Check("robot", NOT_THERE, "not asked for", "--robot /dev/ttyUSB0, or --robot tcp:host:port")
        return
    say(f"listening to the robot on {address} for {LISTEN_S:g} s (it is not armed)")
    yield from check_robot(address)


def _spec(camera: str | None, cameras: list[VideoDevice]) -> str | None:
    """The cameras to open: those that were named, or the one Minoru that is there."""
    return camera or ("minoru" if check_minoru(cameras).state == OK else None)


def _ports(camera: str | None, cameras: list[VideoDevice], devices: list[UsbDevice]) -> list[UsbDevice]:
    """The USB devices of the cameras that are named, or of the Minoru, or of all where there are two; else none."""
    names = camera.split(",") if camera and camera != "minoru" else []
    named = {os.path.realpath(name) for name in names}
    chosen = [each for each in cameras if os.path.realpath(each.node) in named]
    if not names:
        nodes = check_minoru(cameras).values.get("nodes", [])
        chosen = [each for each in cameras if each.node in nodes] or (cameras if len(cameras) == 2 else [])
    folders = {each.usb_port.resolve() for each in chosen if each.usb_port is not None}
    return [device for device in devices if device.folder in folders]


def _pairs(
    wanted: Wanted,
    spec: str | None,
    size_px: tuple[int, int],
    file: CalibrationFile | None,
    say: Callable[[str], None],
) -> Iterator[Check]:
    if spec is None:
        yield Check("camera pairs", NOT_THERE, "not asked for", "--camera minoru, LEFT,RIGHT or http://host:port/")
        return
    say(f"watching the cameras {spec} for {LISTEN_S:g} s")
    try:
        with open_cameras(spec, size_px=size_px, fps=wanted.fps, swap=wanted.swap) as pairs:
            measured, last = measure(pairs, LISTEN_S)
            problem, own = pairs.problem(), pairs.about.get(CAMERA_JSON)
    except StereogridError as error:
        what, remedy = split_trouble(str(error), f"a camera that is there: ls {DEV}/v4l/by-path")
        yield Check("camera pairs", PROBLEM, what, remedy)
        return
    # Web servers and files have a rate of their own.
    asked = spec == "minoru" or spec.startswith("/dev/")
    yield from judge(measured, wanted.fps if asked else None, problem)
    if last is not None:
        yield from _fit(file, own, last, measured.size_px)


def _fit(
    file: CalibrationFile | None, own: dict[str, Any] | None, pair: RawPair, size_px: tuple[int, int]
) -> Iterator[Check]:
    """Whether a pair fits the file or, where none was given, what the cameras say of themselves."""
    rig: Rig | None = file
    if file is not None:
        size = check_size(file, size_px)
        yield size
        rig = file if size.state == OK else None
    elif own is not None:
        check, rig = check_own(own, size_px)
        yield check
    if rig is not None:
        yield check_fit(rig, pair)
