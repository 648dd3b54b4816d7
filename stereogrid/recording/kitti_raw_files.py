"""The files of a KITTI raw drive: where they are, its stamps, its calibrations, what its OXTS unit said.

Formats and conventions: A. Geiger et al., Vision meets Robotics: The KITTI Dataset, IJRR 2013, and the dataset's
documentation.
"""

import calendar
import re
from collections.abc import Mapping
from datetime import datetime
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from ..errors import InvalidInputError, RecordingError
from ..geometry import FloatArray, from_rotation, nearest_pose
from ..places import is_directory
from ..textrows import MAX_NS, floats, text_lines

CAMERAS = ("image_00", "image_01", "image_02", "image_03")
PAIRS = ((0, 1), (2, 3))
"""Grey, then colour cameras; the first pair that is there is read."""
CAM_TO_CAM, VELO_TO_CAM, IMU_TO_VELO = CALIBRATIONS = (
    "calib_cam_to_cam.txt",
    "calib_velo_to_cam.txt",
    "calib_imu_to_velo.txt",
)
EARTH_RADIUS_M = 6378137.0
_STAMP = re.compile(r"(\d{4}-\d\d-\d\d[ T]\d\d:\d\d:\d\d)(?:\.(\d{1,9}))?\d*")


def is_drive(path: Path) -> bool:
    """Whether a folder holds the cameras' folders, with their data, of a raw drive."""
    return any(is_directory(path / name / "data") for name in CAMERAS)


def find_drive(path: Path) -> Path | None:
    """The drive that a path means: its folder, one of its cameras' or their data, or a date's with but one drive.

    None where there is none. Raises RecordingError where there are several.
    """
    whole = path.resolve()
    for place in (path, *whole.parents[:2]):
        if (place == path or whole.relative_to(place).parts[0] in CAMERAS) and is_drive(place):
            return place
    children = sorted(child for child in path.iterdir() if is_drive(child)) if path.is_dir() else []
    if len(children) > 1:
        names = ", ".join(child.name for child in children)
        raise RecordingError(f"{path}: holds several KITTI raw drives; choose from: {names}")
    return children[0] if children else None


def find_calibration(drive: Path) -> Path:
    """The folder of the calibration: the drive's own, the one above it (the date's), or one beside it."""
    date, _, _ = drive.resolve().name.partition("_drive_")
    above = drive.resolve().parent
    places = [drive, above, above / date, above / f"{date}_calib" / date, above.parent / f"{date}_calib" / date]
    for place in places:
        if (place / CAM_TO_CAM).is_file():
            return place
    raise RecordingError(
        f"{drive}: no {CAM_TO_CAM} there or in {above}; unpack the date's calibration ({date}_calib.zip) there"
    )


def read_calibration(path: Path) -> Mapping[str, list[float]]:
    """The numbers behind each `name:` of a calibration file; what is no number (calib_time) is passed over."""
    found: dict[str, list[float]] = {}
    for number, line in text_lines(path):
        name, colon, rest = line.partition(":")
        if colon and name.strip() != "calib_time":
            found[name.strip()] = floats(rest.split(), f"{path}:{number}")
    return found


def matrix(held: Mapping[str, list[float]], name: str, shape: tuple[int, ...], path: Path) -> FloatArray:
    """The finite numbers of a name in this shape. Raises RecordingError when there is no such name or no such count."""
    if name not in held:
        raise RecordingError(f"{path}: no {name}, only {', '.join(held) or 'nothing'}")
    values = np.array(held[name])
    if values.size != np.prod(shape) or not np.isfinite(values).all():
        raise RecordingError(f"{path}: {name} has {values.size} numbers, expected {int(np.prod(shape))}, all finite")
    return values.reshape(shape)


def read_transform(path: Path) -> FloatArray:
    """The pose (4, 4) that the R and T of a calibration file make."""
    held = read_calibration(path)
    return rigid(matrix(held, "R", (3, 3), path), matrix(held, "T", (3,), path), path)


def rigid(R: FloatArray, t_m: FloatArray, path: Path) -> FloatArray:
    """The pose (4, 4) of a rotation (3, 3), printed with few digits, and a translation (3,) [m]."""
    try:
        return nearest_pose(from_rotation(R, t_m), "R")
    except InvalidInputError as error:
        raise RecordingError(f"{path}: {error}") from error


def read_stamps_ns(path: Path) -> Mapping[int, int]:
    """The stamp [ns] of each number, `2011-09-26 13:02:25.964389445` in its row, to the nanosecond; taken as UTC.

    An empty row is a number without a stamp. Raises RecordingError, naming the line, for what is none.
    """
    stamps_ns = {}
    for number, line in text_lines(path):
        found = _STAMP.fullmatch(line.strip())
        try:
            if found is None:
                raise ValueError
            second_s = calendar.timegm(datetime.fromisoformat(found[1]).timetuple())
            stamp_ns = second_s * 10**9 + int((found[2] or "").ljust(9, "0"))
            if abs(stamp_ns) >= MAX_NS:
                raise ValueError
        except ValueError:
            raise RecordingError(f"{path}:{number}: {line.strip()[:80]!r} is no date and time of today") from None
        stamps_ns[number - 1] = stamp_ns
    return stamps_ns


def numbered(folder: Path, suffixes: tuple[str, ...]) -> dict[int, Path]:
    """The files of a data folder by their number. Raises RecordingError when there is none, or two have one."""
    if not folder.is_dir():
        raise RecordingError(f"{folder}: no such folder")
    files: dict[int, Path] = {}
    for path in folder.iterdir():
        if path.suffix.lower() in suffixes and re.fullmatch(r"\d{1,10}", path.stem):
            first = files.setdefault(int(path.stem), path)
            if first != path:
                names = " and ".join(sorted((first.name, path.name)))
                raise RecordingError(f"{folder}: {names} have one number: keep one")
    if not files:
        raise RecordingError(f"{folder}: no files 0000000000{suffixes[0]}, ...")
    return files


def read_oxts(path: Path) -> FloatArray | None:
    """latitude, longitude [deg], altitude [m], roll, pitch, yaw [rad]: the first six numbers of an OXTS file.

    None where it does not hold them. Raises RecordingError, naming the line, for a word that is no number.
    """
    lines = text_lines(path)
    values = np.array(floats(lines[0][1].split(), f"{path}:{lines[0][0]}")[:6]) if lines else np.empty(0)
    return values if values.size == 6 and np.isfinite(values).all() and abs(values[0]) < 90 else None


def poses_of_oxts(oxts: FloatArray) -> FloatArray:
    """Poses (M, 4, 4) of the OXTS unit (x forward, y left, z up) from rows (M, 6) as read_oxts gives them.

    Mercator's projection, scaled to be true at the first row's latitude, as the dataset has it. Its world has x east,
    y north, z up; ours the origin at the first pose and x where that pose looks, made level.
    """
    latitude, longitude = np.radians(oxts[:, 0]), np.radians(oxts[:, 1])
    scale_m = EARTH_RADIUS_M * np.cos(latitude[0])
    # ln tan(pi / 4 + latitude / 2) is arsinh tan(latitude), which loses fewer digits; so do differences of longitudes.
    east_m = scale_m * (longitude - longitude[0])
    north_m = scale_m * (np.arcsinh(np.tan(latitude)) - np.arcsinh(np.tan(latitude[0])))
    level = Rotation.from_euler("z", -oxts[0, 5])
    T = np.tile(np.eye(4), (len(oxts), 1, 1))
    T[:, :3, :3] = (level * Rotation.from_euler("ZYX", oxts[:, [5, 4, 3]])).as_matrix()
    T[:, :3, 3] = level.apply(np.stack([east_m, north_m, oxts[:, 2] - oxts[0, 2]], axis=1))
    return T
