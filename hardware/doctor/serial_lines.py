"""The serial lines that a robot may be on: adapters at the USB, and ports of the computer's own."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from stereogrid.checks import NOT_THERE, OK, PROBLEM, Check

from .usb import UsbDevice

ADAPTERS = {
    "067b": ("PL2303", "pl2303"),
    "0403": ("FTDI", "ftdi_sio"),
    "10c4": ("CP210x", "cp210x"),
    "1a86": ("CH340", "ch341"),
}
"""By the vendor of the chip: what it is called, and its driver."""
SERIAL_PRODUCTS = {
    "067b": ("2303", "2304", "23a3", "23b3", "23c3", "23d3", "23e3", "23f3"),
    "0403": ("6001", "6010", "6011", "6014", "6015"),
    "10c4": ("ea60", "ea70", "ea71"),
    "1a86": ("7523", "5523", "7522"),
}


@dataclass(frozen=True)
class SerialLine:
    """device: "/dev/ttyUSB0"; about: what it is; usb_id: "067b:2303", "" of a port of the computer's own."""

    device: str
    about: str
    usb_id: str = ""


def serial_lines() -> list[SerialLine]:
    """What pyserial finds; none without pyserial."""
    try:
        from serial.tools import list_ports
    except ImportError:
        return []
    lines = []
    for port in list_ports.comports():
        usb_id = f"{port.vid:04x}:{port.pid:04x}" if port.vid is not None else ""
        chip = ADAPTERS.get(usb_id[:4], ("",))[0]
        told = [chip, port.product or "", f"serial {port.serial_number}" if port.serial_number else ""]
        lines.append(SerialLine(port.device, " ".join(filter(None, told)) or "a port of the computer's own", usb_id))
    return sorted(lines, key=lambda line: line.device)


def check_lines(lines: Sequence[SerialLine]) -> list[Check]:
    """One check a line, or one that says that there is none."""
    if not lines:
        remedy = "plug in a USB-to-serial adapter (PL2303 or FTDI), or name the robot's --robot tcp:host:port"
        return [Check("serial lines", NOT_THERE, "none", remedy)]
    return [
        Check(
            f"serial line {line.device}",
            OK,
            " ".join(filter(None, [line.about, line.usb_id and f"({line.usb_id})"])),
            "",
            {"device": line.device, "usb_id": line.usb_id},
        )
        for line in lines
    ]


def check_adapters(devices: Sequence[UsbDevice]) -> list[Check]:
    """Adapters that the USB sees, but that have no serial node: for want of a driver, or since another program took
    them."""
    checks = []
    for device in devices:
        vendor, product = device.id.split(":")
        if product not in SERIAL_PRODUCTS.get(vendor, ()) or device.ttys:
            continue
        chip, driver = ADAPTERS[vendor]
        held = f"its driver is {', '.join(device.drivers)}" if device.drivers else "no driver took it"
        remedy = f"sudo modprobe {driver}, plug it in again and read sudo dmesg | tail"
        if vendor in ("10c4", "1a86"):
            remedy = f"sudo apt remove brltty (it takes such adapters for Braille displays), or {remedy}"
        found = f"{device.id} in USB port {device.port} has no /dev/ttyUSB*: {held}"
        checks.append(Check(f"{chip} adapter", PROBLEM, found, remedy, {"port": device.port, "usb_id": device.id}))
    return checks


def nodes(lines: Sequence[SerialLine]) -> list[Path]:
    """The nodes of adapters at the USB: whether those may be opened is worth a check."""
    return [Path(line.device) for line in lines if line.usb_id]
