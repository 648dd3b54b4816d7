"""What can go wrong with things that have plugs; cli.run makes one line of each."""

from stereogrid.errors import StereogridError


class HardwareError(StereogridError):
    """Something that is plugged in, or should be, does not do what it must."""


class RobotError(HardwareError):
    """The robot does not answer, or may not move."""


class CameraError(HardwareError):
    """A camera is missing, busy or gives no pictures."""
