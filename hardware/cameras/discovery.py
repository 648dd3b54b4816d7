"""The V4L2 cameras that are plugged in, from sysfs: which node, which USB id, which plug."""

import errno
import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from ..errors import CameraError
from .kernel import Capabilities, query_capabilities

SYSFS = Path("/sys/class/video4linux")
DEV = Path("/dev")
GROUP_REMEDY = "add yourself to the group video (sudo usermod -aG video $USER), then log in again"


@dataclass(frozen=True)
class VideoDevice:
    """One camera: the node that gives its pictures.

    node: "/dev/video0". plug: the sysfs folder of the device behind it, which is the same after a replug into the
    same port; with `label`, the driver's name for the node, it is what finds the camera again. usb_id "0ac8:3410", ""
    for none; usb_port: the USB device's folder, whose parent is its hub. by_path: its /dev/v4l/by-path name, "" where
    udev makes none. trouble: why it cannot be opened, with the remedy; "" for nothing.
    """

    node: str
    label: str
    plug: Path
    usb_id: str = ""
    usb_port: Path | None = None
    by_path: str = ""
    trouble: str = ""

    @property
    def hub(self) -> Path | None:
        """The folder of the hub that it is plugged into."""
        return None if self.usb_port is None else self.usb_port.parent

    def __str__(self) -> str:
        return " ".join(filter(None, [self.node, self.usb_id, repr(self.label), f"on {self.where}"]))

    @property
    def where(self) -> str:
        """Its plug in few words: the USB port's number, or the device's name."""
        return f"USB port {self.usb_port.name}" if self.usb_port is not None else self.plug.name


Query = Callable[[str], Capabilities]


def find_cameras(sysfs: Path = SYSFS, dev: Path = DEV, query: Query = query_capabilities) -> list[VideoDevice]:
    """All cameras, by the number of their nodes: index 0 and VIDEO_CAPTURE only, since the others carry metadata.

    A node that may not be opened is listed with its trouble, since what it is cannot be asked.
    """
    names = sorted(
        (path for path in sysfs.glob("video*") if path.name[5:].isdigit()), key=lambda path: int(path.name[5:])
    )
    found = (_device(path, dev, query) for path in names)
    return [device for device in found if device is not None]


def find_again(
    device: VideoDevice, sysfs: Path = SYSFS, dev: Path = DEV, query: Query = query_capabilities
) -> VideoDevice | None:
    """The same camera in the same plug, whatever its node is called now; None while it is not there."""
    for each in find_cameras(sysfs, dev, query):
        if (each.plug, each.label) == (device.plug, device.label):
            return each
    return None


def find_camera(name: str, sysfs: Path = SYSFS, dev: Path = DEV, query: Query = query_capabilities) -> VideoDevice:
    """The camera of a name: /dev/video0, or a link of udev's to it. Raises CameraError with what there is."""
    path, cameras = Path(name), find_cameras(sysfs, dev, query)
    if "by-id" in path.parts:
        raise CameraError(
            f"{name}: names by id are refused, since both cameras of a rig may claim the same one: use its by-path name"
            f" (ls -l {dev}/v4l/by-path). {listed(cameras)}"
        )
    node = str(path.resolve())
    for camera in cameras:
        if node == str(Path(camera.node).resolve()):
            return camera
    if path.exists():
        raise CameraError(f"{name} gives no pictures (each camera has a second node, for metadata). {listed(cameras)}")
    raise CameraError(f"{name} is not there: is it plugged in? {listed(cameras)}")


def listed(cameras: list[VideoDevice]) -> str:
    """A sentence for errors: the cameras that were found."""
    if not cameras:
        return "No V4L2 camera was found (lsusb shows whether the USB bus sees it)"
    return "Cameras found: " + "; ".join(str(camera) for camera in cameras)


def open_trouble(node: str, error: OSError) -> str:
    """Why a node cannot be opened, with the remedy."""
    if error.errno in (errno.EACCES, errno.EPERM):
        return f"{node} may not be opened: {GROUP_REMEDY}"
    if error.errno in (errno.ENOENT, errno.ENODEV, errno.ENXIO):
        return f"{node} is gone: plug the camera in again"
    return f"{node} cannot be opened: {error.strerror}"


def _device(path: Path, dev: Path, query: Query) -> VideoDevice | None:
    """The camera of /sys/class/video4linux/video0; None for what is no camera, or was unplugged just now."""
    if _read(path / "index") not in ("0", ""):
        return None
    node = str(dev / path.name)
    trouble = ""
    try:
        if not query(node).captures:
            return None
    except OSError as error:
        if error.errno == errno.ENOTTY:
            return None
        trouble = open_trouble(node, error)
    plug = (path / "device").resolve()
    port = plug.parent if (plug.parent / "idVendor").exists() else None
    usb_id = f"{_read(port / 'idVendor')}:{_read(port / 'idProduct')}" if port is not None else ""
    return VideoDevice(node, _read(path / "name"), plug, usb_id, port, _by_path(node, dev), trouble)


def _by_path(node: str, dev: Path) -> str:
    links = dev / "v4l" / "by-path"
    try:
        names = sorted(links.iterdir())
    except OSError:
        return ""
    return next((str(name) for name in names if os.path.realpath(name) == os.path.realpath(node)), "")


def _read(path: Path) -> str:
    """The one line of a file of sysfs; "" where it is not there (any more)."""
    try:
        return path.read_text(errors="replace").strip()
    except OSError:
        return ""
