"""What a robot, its cameras and a browser send."""

from pathlib import Path

import cv2
import numpy as np
from target import Target

from arcos import Command, ConfigReply, Identity, PacketParser, Sip, Sonar, packet
from arcos.commands import Code
from hardware.cameras.controls import parse_controls
from hardware.cameras.grey import from_jpeg
from hardware.cameras.multipart import MultipartParser
from hardware.errors import HardwareError
from stereogrid.jpeg_header import jpeg_size_px

IDENTITY = Identity("stereogrid", "Pioneer", "p3at-sh")
SIP = Sip(False, *([7] * 10), sonars=(Sonar(1, 500), Sonar(2, 600)), gripper=1, analog_port=2, analog=3)


def _stream(_: Path) -> list[bytes]:
    bodies = [SIP.body(), IDENTITY.body(), Command(Code.PULSE).body(), Command(Code.VEL, 300).body()]
    return [b"".join(map(packet, bodies)), packet(SIP.body()) * 3]


def read_stream(data: bytes, _: Path) -> None:
    """However the bytes are split, the packets are the same ones."""
    whole = PacketParser()
    bodies = whole.feed(data) + whole.give_up()
    pieces, found = PacketParser(), []
    for start in range(0, len(data), 7):
        found += pieces.feed(data[start : start + 7])
    found += pieces.give_up()
    if bodies != found:
        raise AssertionError(f"{len(bodies)} packets from the whole, {len(found)} from the pieces")
    for body in bodies:
        read_body(body, _)


def _bodies(_: Path) -> list[bytes]:
    return [
        SIP.body(),
        ConfigReply().body(),
        IDENTITY.body(),
        Command(Code.VEL, -300).body(),
        Command(Code.SAY, b"hm").body(),
    ]


def read_body(data: bytes, _: Path) -> None:
    """As each kind of body; what is read is written as it can be read again."""
    for kind in (Sip, ConfigReply, Identity, Command):
        try:
            read = kind.decode(data)
        except ValueError as error:
            if type(error).__name__ != "ArcosError":
                raise
            continue
        if kind.decode(read.body()) != read:
            raise AssertionError(f"{read} is not what its own body says")


def _jpegs(_: Path) -> list[bytes]:
    image = np.random.default_rng(0).integers(0, 256, (24, 32), dtype=np.uint8)
    flags = ([], [cv2.IMWRITE_JPEG_PROGRESSIVE, 1], [cv2.IMWRITE_JPEG_RST_INTERVAL, 1])
    return [cv2.imencode(".jpg", image, each)[1].tobytes() for each in flags]


def read_jpeg(data: bytes, _: Path) -> None:
    """A picture of a network camera."""
    jpeg_size_px(data)
    from_jpeg(data)


def _multipart(folder: Path) -> list[bytes]:
    jpeg = _jpegs(folder)[0]
    sized = f"--frame\r\nContent-Type: image/jpeg\r\nContent-Length: {len(jpeg)}\r\n\r\n".encode() + jpeg + b"\r\n"
    return [sized * 2, (b"--frame\r\nContent-Type: image/jpeg\r\n\r\n" + jpeg + b"\r\n") * 2 + b"--frame--"]


def read_multipart(data: bytes, _: Path) -> None:
    """However the bytes are split, the parts are the same ones."""
    found = []
    for size in (len(data) or 1, 11):
        parser, parts = MultipartParser("frame"), []
        try:
            for start in range(0, len(data), size):
                parts += parser.feed(data[start : start + size])
        except HardwareError:
            parts.append(None)
        found.append(parts)
    if found[0] != found[1] and None not in found[0] + found[1]:
        raise AssertionError(f"{len(found[0])} parts from the whole, {len(found[1])} from the pieces")


CONTROLS = b"""
User Controls

                     brightness 0x00980900 (int)    : min=-64 max=64 step=1 default=0 value=0
         white_balance_automatic 0x0098090c (bool)   : default=1 value=1

Camera Controls

                  auto_exposure 0x009a0901 (menu)   : min=0 max=3 default=3 value=3 (Aperture Priority Mode)
"""


def read_controls(data: bytes, _: Path) -> None:
    """What v4l2-ctl prints."""
    parse_controls(data.decode(errors="replace"))


TARGETS = {
    "arcos-stream": Target(_stream, read_stream),
    "arcos-body": Target(_bodies, read_body),
    "jpeg": Target(_jpegs, read_jpeg),
    "multipart": Target(_multipart, read_multipart),
    "v4l2-controls": Target(lambda _: [CONTROLS], read_controls),
}
