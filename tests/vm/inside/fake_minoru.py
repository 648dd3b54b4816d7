"""Two USB cameras that say they are a Minoru's, on the real uvcvideo driver: a gadget (configfs, f_uvc) on a virtual
device controller (usbip-vudc), joined to a virtual host controller (vhci-hcd) by a socket.

They are found, opened, and their controls set; they give no pictures, since the virtual controllers carry no
isochronous transfers."""

import contextlib
import fcntl
import select
import socket
import struct
import threading
import time
from collections.abc import Callable
from pathlib import Path

from kernel_side import load, mount, wait_until

CONFIGFS = Path("/sys/kernel/config")
VIDEO = Path("/sys/class/video4linux")
VENDOR_ID = 0x0AC8
PRODUCT_IDS = (0x3410, 0x3420)
WIDTH_PX, HEIGHT_PX, FPS = 320, 240, 30
FRAME_BYTES = WIDTH_PX * HEIGHT_PX * 2
INTERVAL_100NS = 10_000_000 // FPS
USB_SPEED_HIGH = 3

# linux/videodev2.h, linux/usb/g_uvc.h
VIDIOC_SUBSCRIBE_EVENT, VIDIOC_DQEVENT = 0x4020565A, 0x80885659
UVCIOC_SEND_RESPONSE = 0x40405501
EVENT_BYTES = 136
UVC_EVENT_SETUP, UVC_EVENT_DATA = 0x08000004, 0x08000005
# linux/usb/video.h
SET_CUR, GET_CUR, GET_MIN, GET_MAX, GET_RES, GET_LEN, GET_INFO, GET_DEF = 0x01, *range(0x81, 0x88)
AUTO_EXPOSURE, BRIGHTNESS = (1, 2), (2, 2)
"""(entity, selector) of the controls that f_uvc's descriptors claim: the camera terminal's, the processing unit's."""
EXPOSURE_MANUAL, EXPOSURE_APERTURE_PRIORITY = 1, 8


class FakeCamera:
    """One camera; plug() and unplug() as often as one likes. controls: (entity, selector) to what the host set last."""

    def __init__(self, index: int, product_id: int) -> None:
        self.index = index
        self.controls = {AUTO_EXPOSURE: EXPOSURE_APERTURE_PRIORITY, BRIGHTNESS: 100 + index}
        self._asked = (0, 0)
        self._wires: list[socket.socket] = []
        self._port = 0
        gadget = CONFIGFS / f"usb_gadget/camera{index}"
        _describe(gadget, product_id)
        controller = Path(f"/sys/devices/platform/usbip-vudc.{index}")
        (gadget / "UDC").write_text(controller.name)
        self._socket = controller / "usbip_sockfd"
        (node,) = controller.glob("gadget.*/video4linux/video*")
        threading.Thread(target=self._answer, args=(Path("/dev") / node.name,), daemon=True).start()

    def plug(self, controller: int = 0) -> None:
        """Into the port of that virtual host controller; returns when its two nodes are there."""
        before = len(uvc_nodes())
        self._wires = [device, host] = list(socket.socketpair())
        _soon(lambda: self._socket.write_text(str(device.fileno())))
        self._port = 30 * controller + self.index
        device_id = 0x10001 + self.index
        _vhci("attach").write_text(f"{self._port} {host.fileno()} {device_id} {USB_SPEED_HIGH}")
        wait_until(lambda: len(uvc_nodes()) == before + 2, "a camera's two nodes")

    def unplug(self) -> None:
        """Returns when its nodes are gone. Again: nothing."""
        if not self._wires:
            return
        before = len(uvc_nodes())
        _vhci("detach").write_text(str(self._port))
        wait_until(lambda: len(uvc_nodes()) == before - 2, "a camera's end")
        for wire in self._wires:
            wire.close()
        self._wires = []
        # The device's side notices the closed socket, and may be plugged in again then.
        time.sleep(0.5)

    def _answer(self, output: Path) -> None:
        """The camera's firmware: agrees to the mode that the host asks for, keeps the controls."""
        with output.open("rb+", buffering=0) as node:
            for kind in (UVC_EVENT_DATA, UVC_EVENT_SETUP):
                fcntl.ioctl(node, VIDIOC_SUBSCRIBE_EVENT, struct.pack("I28x", kind))
            while True:
                select.select([], [], [node])
                event = fcntl.ioctl(node, VIDIOC_DQEVENT, bytes(EVENT_BYTES))
                kind = struct.unpack_from("I", event)[0]
                if kind == UVC_EVENT_DATA:
                    self._keep(event[8:])
                elif kind == UVC_EVENT_SETUP:
                    # The host may be gone by now.
                    with contextlib.suppress(OSError):
                        fcntl.ioctl(node, UVCIOC_SEND_RESPONSE, self._response(event[8:16]))

    def _keep(self, data: bytes) -> None:
        if self._asked in self.controls:
            length = struct.unpack_from("i", data)[0]
            self.controls[self._asked] = int.from_bytes(data[4 : 4 + length], "little")

    def _response(self, request: bytes) -> bytes:
        _, code, value, index, length = struct.unpack("<BBHHH", request)
        self._asked = (index >> 8, value >> 8)
        if code == SET_CUR:
            data = b""
        elif code == GET_INFO:
            data = b"\3"
        elif self._asked in self.controls:
            data = self._control(code).to_bytes(length, "little")
        else:
            data = struct.pack("<H", 34) if code == GET_LEN else _mode()
        return struct.pack("i60s", length if code == SET_CUR else min(length, len(data)), data)

    def _control(self, code: int) -> int:
        if code == GET_CUR:
            return self.controls[self._asked]
        if self._asked == BRIGHTNESS:
            return {GET_LEN: 2, GET_MIN: 0, GET_MAX: 255, GET_RES: 1, GET_DEF: 128}[code]
        both = EXPOSURE_MANUAL | EXPOSURE_APERTURE_PRIORITY
        return {GET_LEN: 1, GET_RES: both, GET_DEF: EXPOSURE_APERTURE_PRIORITY}.get(code, both)


def prepare(cameras: int) -> None:
    """The modules, and configfs."""
    load("usb_f_uvc")
    load("uvcvideo")
    load("usbip-vudc", f"num={cameras}")
    load("vhci-hcd")
    mount("configfs", CONFIGFS)


def uvc_nodes() -> list[str]:
    """The names of the nodes that the driver uvcvideo made."""
    return sorted(path.name for path in VIDEO.glob("video*") if "vhci_hcd" in str(path.resolve()))


def _soon(act: Callable[[], object]) -> None:
    """Until it works: a gadget is ready a little after its firmware runs."""

    def works() -> bool:
        try:
            act()
        except OSError:
            return False
        return True

    wait_until(works, "the gadget")


def _vhci(name: str) -> Path:
    return Path("/sys/devices/platform/vhci_hcd.0") / name


def _mode() -> bytes:
    """A probe (UVC 1.1): hint, format, frame, interval, rates of keys and Ps, quality, window, delay, bytes of a frame
    and of a payload, clock, framing and versions."""
    return struct.pack("<HBBIHHHHHIII4B", 1, 1, 1, INTERVAL_100NS, 0, 0, 0, 0, 0, FRAME_BYTES, 1024, 0, 0, 0, 0, 0)


def _describe(gadget: Path, product_id: int) -> None:
    uvc = gadget / "functions/uvc.0"
    frame = uvc / "streaming/mjpeg/m/240p"
    for folder in (gadget / "strings/0x409", gadget / "configs/c.1", frame):
        folder.mkdir(parents=True)
    for path, text in {
        gadget / "idVendor": hex(VENDOR_ID),
        gadget / "idProduct": hex(product_id),
        gadget / "strings/0x409/manufacturer": "Vimicro Corp.",
        gadget / "strings/0x409/product": "Venus USB2.0 Camera",
        frame / "wWidth": str(WIDTH_PX),
        frame / "wHeight": str(HEIGHT_PX),
        frame / "dwFrameInterval": f"{INTERVAL_100NS}\n",
        frame / "dwDefaultFrameInterval": str(INTERVAL_100NS),
        frame / "dwMaxVideoFrameBufferSize": str(FRAME_BYTES),
    }.items():
        path.write_text(text)
    for part, speeds in {"control": ("fs", "ss"), "streaming": ("fs", "hs", "ss")}.items():
        header = uvc / part / "header/h"
        header.mkdir()
        if part == "streaming":
            (header / "m").symlink_to(frame.parent)
        for speed in speeds:
            (uvc / part / "class" / speed / "h").symlink_to(header)
    (gadget / "configs/c.1/uvc.0").symlink_to(uvc)
