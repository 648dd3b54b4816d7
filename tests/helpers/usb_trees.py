"""Trees of files as Linux's sysfs and udev show USB cameras, for tests of discovery."""

from dataclasses import dataclass, field
from pathlib import Path

from hardware.cameras.kernel import CAPTURE, Capabilities

HOST = "pci0000:00/0000:00:14.0"
META_CAPTURE = 0x800000
"""V4L2_CAP_META_CAPTURE of videodev2.h."""


@dataclass
class UsbTree:
    """sysfs: the folder /sys/class/video4linux; dev: /dev. `query` answers for the nodes as their kernel would."""

    root: Path
    caps: dict[str, int] = field(default_factory=dict)
    refused: dict[str, OSError] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.sysfs.mkdir(parents=True)
        (self.dev / "v4l/by-path").mkdir(parents=True)
        (self.dev / "v4l/by-id").mkdir(parents=True)

    @property
    def sysfs(self) -> Path:
        return self.root / "sys/class/video4linux"

    @property
    def dev(self) -> Path:
        return self.root / "dev"

    def plug(self, port: str, usb_id: str, first: int, label: str = "USB 2.0 Camera") -> None:
        """A UVC camera in a port as "1-1.2", with a node for pictures and one for metadata, from video<first> on."""
        device = self.root / "sys/devices" / HOST / f"usb{port.partition('-')[0]}" / _ports(port)
        interface = device / f"{port}:1.0"
        interface.mkdir(parents=True)
        for name, text in zip(("idVendor", "idProduct"), usb_id.split(":"), strict=True):
            (device / name).write_text(text + "\n")
        for index, caps in enumerate((CAPTURE, META_CAPTURE)):
            self.node(first + index, interface, label, index, caps)
        usb_path = f"pci-0000:00:14.0-usb-0:{port.split('-')[1]}:1.0-video-index"
        by_id = f"usb-Vimicro_Corp._{label.replace(' ', '_')}-video-index"
        for index in (0, 1):
            for folder, name in (("by-path", usb_path), ("by-id", by_id)):
                link = self.dev / "v4l" / folder / f"{name}{index}"
                link.unlink(missing_ok=True)
                link.symlink_to(f"../../video{first + index}")

    def node(self, number: int, device: Path, label: str, index: int, caps: int) -> None:
        """One /dev/video node of a device's folder."""
        folder = device / "video4linux" / f"video{number}"
        folder.mkdir(parents=True)
        (folder / "name").write_text(label + "\n")
        (folder / "index").write_text(f"{index}\n")
        (folder / "device").symlink_to("../../../" + device.name)
        (self.sysfs / folder.name).symlink_to(folder)
        (self.dev / folder.name).touch()
        self.caps[str(self.dev / folder.name)] = caps

    def unplug(self, first: int) -> None:
        """Both nodes of a camera go, as sysfs shows it."""
        for number in (first, first + 1):
            (self.sysfs / f"video{number}").unlink()
            (self.dev / f"video{number}").unlink()

    def query(self, node: str) -> Capabilities:
        """VIDIOC_QUERYCAP of a node here."""
        if node in self.refused:
            raise self.refused[node]
        return Capabilities("uvcvideo", "camera", "usb-1", self.caps[node])


def _ports(port: str) -> Path:
    """1-1.2.4 hangs on 1-1.2, that on 1-1."""
    bus, _, rest = port.partition("-")
    numbers = rest.split(".")
    return Path(*(f"{bus}-{'.'.join(numbers[: k + 1])}" for k in range(len(numbers))))
