"""What is on the USB buses, from sysfs: which device in which port, how fast, and whose driver took it."""

from dataclasses import dataclass
from pathlib import Path

SYSFS = Path("/sys/bus/usb/devices")


@dataclass(frozen=True)
class UsbDevice:
    """One device. port: "1-1.2", bus 1, port 1 of its root hub, port 2 of the hub there; id: "0ac8:3420".

    speed_mbps: 1.5, 12, 480, 5000, ..., 0 where it is not told; ttys: the serial nodes it has, "ttyUSB0"; drivers: of
    its interfaces, that have one; product: what it calls itself, or "".
    """

    port: str
    id: str
    bus: int
    speed_mbps: float
    product: str
    ttys: tuple[str, ...]
    drivers: tuple[str, ...]
    folder: Path


def usb_devices(sysfs: Path = SYSFS) -> list[UsbDevice]:
    """All devices, by their ports, without root hubs; none where there is no USB."""
    # Interfaces have a colon in their names ("1-1.2:1.0"), root hubs are "usb1".
    folders = (path for path in sysfs.glob("*-*") if ":" not in path.name)
    return sorted(filter(None, map(_device, folders)), key=lambda device: device.port)


def _device(folder: Path) -> UsbDevice | None:
    vendor, product = _read(folder / "idVendor"), _read(folder / "idProduct")
    if not vendor:
        return None
    interfaces = sorted(folder.glob(f"{folder.name}:*"))
    return UsbDevice(
        folder.name,
        f"{vendor}:{product}",
        int(_number(folder / "busnum")),
        _number(folder / "speed"),
        _read(folder / "product"),
        tuple(sorted(path.name for each in interfaces for path in [*each.glob("tty[UA]*"), *each.glob("tty/tty*")])),
        tuple(sorted({path.resolve().name for each in interfaces if (path := each / "driver").exists()})),
        folder.resolve(),
    )


def _number(path: Path) -> float:
    try:
        return float(_read(path))
    except ValueError:
        return 0.0


def _read(path: Path) -> str:
    """The one line of a file of sysfs; "" where it is not there (any more)."""
    try:
        return path.read_text(errors="replace").strip()
    except OSError:
        return ""
