"""A tree of cameras with the rest of the USB: other devices, their speeds, drivers and serial nodes."""

from pathlib import Path

from usb_trees import HOST, UsbTree, _ports


class UsbBus(UsbTree):
    """usb: the folder /sys/bus/usb/devices, with a link to each device."""

    @property
    def usb(self) -> Path:
        return self.root / "sys/bus/usb/devices"

    def plug(self, port: str, usb_id: str, first: int, label: str = "USB 2.0 Camera", *, speed: int = 480) -> None:
        """See UsbTree."""
        super().plug(port, usb_id, first, label)
        self._tell(port, usb_id, speed)

    def device(
        self, port: str, usb_id: str, *, speed: int = 480, product: str = "", tty: str = "", driver: str = ""
    ) -> None:
        """A device of any kind with one interface; tty: its node, "ttyUSB0" or "ttyACM0"."""
        interface = self._folder(port) / f"{port}:1.0"
        interface.mkdir(parents=True)
        self._tell(port, usb_id, speed)
        if product:
            (self._folder(port) / "product").write_text(f"{product}\n")
        if tty:
            # As the kernel does: of the usbserial kind straight below, of CDC ACM below a folder tty.
            (interface / (tty if tty.startswith("ttyUSB") else f"tty/{tty}")).mkdir(parents=True)
        if driver:
            folder = self.root / "sys/bus/usb/drivers" / driver
            folder.mkdir(parents=True, exist_ok=True)
            (interface / "driver").symlink_to(folder)

    def _folder(self, port: str) -> Path:
        return self.root / "sys/devices" / HOST / f"usb{port.partition('-')[0]}" / _ports(port)

    def _tell(self, port: str, usb_id: str, speed: int) -> None:
        vendor, product = usb_id.split(":")
        told = {"idVendor": vendor, "idProduct": product, "busnum": port.partition("-")[0], "speed": speed}
        for name, value in told.items():
            (self._folder(port) / name).write_text(f"{value}\n")
        self.usb.mkdir(parents=True, exist_ok=True)
        (self.usb / port).symlink_to(self._folder(port))
