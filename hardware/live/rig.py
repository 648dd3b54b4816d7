"""Which rig it is that sends pairs: by its calibration file, or by what its server says of itself."""

from collections.abc import Mapping
from dataclasses import replace

from stereogrid.calibration import CalibrationFile, Mount, RectifiedRig, Rig
from stereogrid.errors import InvalidInputError, StereogridError

from ..cameras.pairs import StereoPairs
from ..errors import CameraError


def rig_of(cameras: StereoPairs, calibration: CalibrationFile | None, mount: str = "") -> Rig:
    """The rig that these cameras are, with its T_base_cam.

    calibration: None where a server tells of rectified pictures (camera.json). mount: where the left camera stands on
    the robot, which overrules what those say; see Mount.parse.
    Raises CameraError, ConfigError or InvalidInputError where anything is missing or does not fit.
    """
    rig = calibration or _said(cameras)
    size = rig.camera.width_px, rig.camera.height_px
    if size != cameras.size_px:
        raise CameraError(
            f"{'the calibration' if calibration else 'camera.json'} is of pictures of {size[0]} x {size[1]} pixels, "
            f"{cameras.name} gives {cameras.size_px[0]} x {cameras.size_px[1]}: choose --size {size[0]}x{size[1]} (of "
            "network cameras, where they are served), or calibrate anew"
        )
    if mount:
        return replace(rig, T_base_cam=Mount.parse(mount).T_base_cam)
    if rig.T_base_cam is None:
        raise InvalidInputError(
            "the calibration does not say where the left camera stands on the robot: "
            "give --mount x,y,z or x,y,z,pitch,yaw,roll [m, degrees]"
        )
    return rig


def _said(cameras: StereoPairs) -> RectifiedRig:
    about = cameras.about.get("camera.json")
    if not isinstance(about, Mapping):
        raise CameraError(f"{cameras.name}: nothing says what these cameras see: give --calibration rig.toml")
    try:
        return RectifiedRig.from_table(about)
    except StereogridError as error:
        raise CameraError(f"{cameras.name}: camera.json: {error}") from error


def parse_size(text: str) -> tuple[int, int]:
    """(width, height) [px] from "320x240"."""
    parts = text.lower().split("x")
    if len(parts) != 2 or not all(part.isascii() and part.isdigit() and int(part) > 0 for part in parts):
        raise InvalidInputError(f"--size must be WIDTHxHEIGHT, as 320x240, not {text!r}")
    return int(parts[0]), int(parts[1])
