"""The cameras that are plugged in, and whether the USB carries two of them."""

from collections.abc import Sequence
from itertools import groupby

from stereogrid.checks import NOT_THERE, OK, PROBLEM, WARNING, Check, split_trouble

from ..cameras.discovery import VideoDevice
from ..cameras.minoru import IDS
from .usb import UsbDevice

USB2_BYTES = 24e6
"""A second. What two cameras get of a USB 2 bus in uncompressed pictures, as a rule: it carries 60 MB/s, at most 80 %
of that for streams, and a camera reserves its share in steps of up to 24.6 MB/s."""
FULL_SPEED_MBPS = 12
SUPER_SPEED_MBPS = 5000
YUYV_BYTES = 2


def check_devices(cameras: Sequence[VideoDevice], devices: Sequence[UsbDevice]) -> list[Check]:
    """One check a camera, or one that says that there is none; then cameras without a node, and the Minoru."""
    checks = [_camera(camera) for camera in cameras]
    if not cameras:
        checks = [Check("cameras", NOT_THERE, "no V4L2 camera", "plug them in; lsusb shows whether the USB sees them")]
    have_nodes = {camera.usb_port.resolve() for camera in cameras if camera.usb_port is not None}
    for device in devices:
        if device.id in IDS and device.folder not in have_nodes:
            found = f"{device.id} in USB port {device.port} has no /dev/video*"
            remedy = "sudo modprobe uvcvideo, plug it in again and read sudo dmesg | tail"
            checks.append(Check("camera without a node", PROBLEM, found, remedy))
    return [*checks, check_minoru(cameras)]


def _camera(camera: VideoDevice) -> Check:
    name = f"camera {camera.node}"
    found = " ".join(filter(None, [camera.usb_id, repr(camera.label), f"in {camera.where}", camera.by_path]))
    values = {"node": camera.node, "usb_id": camera.usb_id, "by_path": camera.by_path, "where": camera.where}
    if not camera.trouble:
        return Check(name, OK, found, values=values)
    what, remedy = split_trouble(camera.trouble, "plug it in again")
    return Check(name, PROBLEM, f"{found}: {what}", remedy, values)


def check_minoru(cameras: Sequence[VideoDevice]) -> Check:
    """Whether a Minoru is there: its two cameras, on one hub of their own."""
    by_hub: dict[object, dict[str, str]] = {}
    for camera in cameras:
        if camera.usb_id in IDS:
            by_hub.setdefault(camera.hub, {})[camera.usb_id] = camera.node
    rigs = [found for found in by_hub.values() if set(found) == {*IDS}]
    if len(rigs) == 1:
        nodes = [rigs[0][usb_id] for usb_id in IDS]
        found = f"{' and '.join(nodes)}; which is left is for you to say: cover one, and see (--swap)"
        return Check("Minoru", OK, found, values={"nodes": nodes})
    if len(rigs) > 1:
        return Check(
            "Minoru", WARNING, f"{len(rigs)} of them", "name two cameras: --camera LEFT,RIGHT by their by-path"
        )
    if not by_hub:
        return Check("Minoru", NOT_THERE, f"neither {' nor '.join(IDS)}")
    there = ", ".join(f"{usb_id} is {node}" for found in by_hub.values() for usb_id, node in found.items())
    found = f"not both of its cameras on one hub: {there}"
    return Check(
        "Minoru", WARNING, found, "plug it in again, without a hub; or it is another make: --camera LEFT,RIGHT"
    )


def check_bandwidth(ports: Sequence[UsbDevice], size_px: tuple[int, int], fps: float) -> list[Check]:
    """Whether two cameras in these ports fit their buses as uncompressed pictures (YUYV); an estimate.

    None of the kernel's limits is asked for: what is measured, with --camera, is what holds.
    """
    rate = YUYV_BYTES * size_px[0] * size_px[1] * fps
    asked = f"{size_px[0]}x{size_px[1]} at {fps:g} Hz as YUYV is {rate / 1e6:.1f} MB/s a camera"
    checks = []
    for bus, group in groupby(sorted(ports, key=lambda device: device.bus), key=lambda device: device.bus):
        on_bus = list(group)
        slowest = min(device.speed_mbps for device in on_bus)
        together = rate * len(on_bus)
        values = {"bus": bus, "cameras": len(on_bus), "bytes_per_s": together, "speed_mbps": slowest}
        found = f"{asked}; {len(on_bus)} on bus {bus} ({slowest:g} Mbit/s)"
        name = f"USB bus {bus}"
        if 0 < slowest <= FULL_SPEED_MBPS:
            remedy = "a port and a cable of USB 2: not through a keyboard or an old hub"
            checks.append(Check(name, PROBLEM, f"{found}: too slow for pictures", remedy, values))
        elif together > USB2_BYTES and slowest < SUPER_SPEED_MBPS:
            checks.append(Check(name, WARNING, f"{found}: does not fit", _smaller(size_px, fps, len(on_bus)), values))
        else:
            checks.append(Check(name, OK, f"{found}: fits", values=values))
    return checks


def _smaller(size_px: tuple[int, int], fps: float, cameras: int) -> str:
    """The remedy: a rate at which they fit, a smaller picture, and for two single cameras another bus."""
    rate = next(
        (each for each in (15, 10, 5) if YUYV_BYTES * size_px[0] * size_px[1] * each * cameras <= USB2_BYTES), 0
    )
    choices = [f"--fps {rate}"] if rate and rate < fps else []
    choices += ["--size 320x240"] if size_px[0] * size_px[1] > 320 * 240 else []
    return " or ".join([*choices, "each camera on a bus of its own (two single cameras; not the Minoru)"])
