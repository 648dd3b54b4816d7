"""What lies in a plain folder of left and right pictures: which picture is of which moment, and what else is there."""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path

import numpy as np

from ..calibration import Mount, load_calibration
from ..camera import Rectification, StereoCamera
from ..errors import ConfigError, InvalidInputError, RecordingError
from ..geometry import R_BASE_OPTICAL, FloatArray, from_rotation
from ..textrows import Stamps, check_increasing, rows_of_words, stamp_ns
from ..tomlfile import config_from_table, read_table
from .euroc_files import is_euroc
from .images import picture_size
from .picture_files import PICTURES, PictureFiles, picture_names

FOLDERS = (("left", "right"), ("cam0", "cam1"), ("image_left", "image_right"))
CALIBRATIONS = ("rig", "camera", "calibration", "stereo")
CALIBRATION_SUFFIXES = (".toml", ".yml", ".yaml", ".xml")
TRAJECTORIES = {
    f"{stem}{of}{suffix}": of.removeprefix("_") or "camera"
    for of in ("", "_base", "_optical")
    for stem in ("trajectory", "poses")
    for suffix in (".txt", ".tum")
}
"""Names of trajectories, and what each is of."""
UNITS_NS = (1, 10**3, 10**6)
TODAY_NS = (6 * 10**17, 42 * 10**17)
"""A whole number is a stamp where it lies between 1989 and 2103 in one of these units [ns]; any other counts."""
_SIDE = re.compile(r"(.*?)(?<![a-z])(left|right)(?![a-z])(.*)", re.IGNORECASE)
_NUMBER = re.compile(r"\d+(?:\.\d+)?")

Sides = tuple[dict[str, Path], dict[str, Path]]
"""The pictures of the left and of the right camera, by what their names say of the moment."""


def is_folder(path: Path) -> bool:
    """True for a folder with a side's folder of pictures, or with pictures that have left or right in their names.

    Cameras that bring their own YAML are EuRoC's.
    """
    if not path.is_dir() or is_euroc(path):
        return False
    return any((path / name).is_dir() for both in FOLDERS for name in both) or any(map(_side, _pictures_in(path)))


def find_sides(folder: Path) -> Sides:
    """The pictures in a folder a side, or in one folder with left and right in their names."""
    for both in FOLDERS:
        found = [name for name in both if (folder / name).is_dir()]
        if len(found) == 1:
            missing = both[found[0] == both[0]]
            raise RecordingError(f"{folder}: no folder {missing} beside {found[0]}: add the pictures of that camera")
        if found:
            left, right = (_by_moment(folder / each, picture_names(folder / each)) for each in both)
            return left, right
    names = _pictures_in(folder)
    sides: Sides = (
        _by_moment(folder, [name for name in names if _side(name) == "left"]),
        _by_moment(folder, [name for name in names if _side(name) == "right"]),
    )
    for side, files in zip(("left", "right"), sides, strict=True):
        if not files:
            raise RecordingError(f"{folder}: no pictures of the {side} camera; expected {side}_*.png beside the others")
    return sides


def _by_moment(folder: Path, names: Iterable[str]) -> dict[str, Path]:
    files: dict[str, Path] = {}
    for name in names:
        first = files.setdefault(_moment(name), folder / name)
        if first.name != name:
            raise RecordingError(f"{folder}: {first.name} and {name} are of one moment by their names: keep one")
    return files


def _pictures_in(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir() if path.suffix.lower() in PICTURES)


def _side(name: str) -> str:
    """left or right, where a picture's name says it; else nothing."""
    found = _SIDE.fullmatch(Path(name).stem)
    return found.group(2).lower() if found else ""


def _moment(name: str) -> str:
    found = _SIDE.fullmatch(Path(name).stem)
    return found.group(1) + found.group(3) if found else Path(name).stem


def name_stamp_ns(moment: str) -> int | None:
    """The stamp [ns] that a name's last number is: seconds with a point, or whole ns, us or ms; None for a counter."""
    numbers = _NUMBER.findall(moment)
    if not numbers:
        return None
    if "." in numbers[-1]:
        return stamp_ns(numbers[-1], moment)
    value, (first, last) = Decimal(numbers[-1]), TODAY_NS
    return next((int(value) * unit_ns for unit_ns in UNITS_NS if first <= value * unit_ns < last), None)


def in_order(moments: Iterable[str]) -> list[str]:
    """Names by their last numbers, as counters count: 2 before 10."""
    numbered = [(Decimal((_NUMBER.findall(moment) or ["-1"])[-1]), moment) for moment in moments]
    return [moment for _, moment in sorted(numbered)]


def read_times(path: Path) -> Stamps:
    """One stamp a row, in seconds or, if too large for that, ns, us or ms. Raises RecordingError, naming the line."""
    rows = rows_of_words(path)
    stamps = []
    for where, words in rows:
        if len(words) != 1:
            raise RecordingError(f"{where}: {len(words)} words, expected one stamp a row")
        whole_ns = name_stamp_ns(words[0]) if words[0].isdigit() else None
        stamps.append(stamp_ns(words[0], where) if whole_ns is None else whole_ns)
    stamps_ns = np.array(stamps, np.int64)
    check_increasing(stamps_ns, rows)
    return stamps_ns


def stamped(sides: Sides, stamp_of: Mapping[str, int]) -> tuple[PictureFiles, int]:
    """The pictures by their stamps, and how many have the stamp of an earlier one."""
    files: tuple[dict[int, Path], dict[int, Path]] = {}, {}
    for side, of_side in zip(sides, files, strict=True):
        for moment in in_order(side):
            of_side.setdefault(stamp_of[moment], side[moment])
    return files, sum(len(side) - len(of_side) for side, of_side in zip(sides, files, strict=True))


@dataclass(frozen=True)
class FolderCamera:
    """What rectifies the pictures, or the camera of rectified ones; mount (4, 4): its T_base_cam, where it is told."""

    rig: Rectification | StereoCamera
    mount: FloatArray | None

    @property
    def T_base_cam(self) -> FloatArray:
        """(4, 4): the mount; without one, `base` sits at the camera."""
        return from_rotation(R_BASE_OPTICAL) if self.mount is None else self.mount


@dataclass(frozen=True)
class _CameraFile:
    """A TOML file of a rectified pair. Without a size, it is the pictures'; [mount] as in a rig.toml."""

    focal_px: float
    cx_px: float
    cy_px: float
    baseline_m: float
    width_px: int | None = None
    height_px: int | None = None
    mount: Mount | None = None


def find_calibration(folder: Path) -> Path:
    """The one calibration in a folder. Raises RecordingError where there is none, or more than one."""
    found = sorted(path for path in folder.iterdir() if path.suffix.lower() in CALIBRATION_SUFFIXES)
    found = [path for path in found if path.stem in CALIBRATIONS] or found
    if len(found) == 1:
        return found[0]
    if found:
        raise RecordingError(f"{folder}: more than one calibration: {', '.join(path.name for path in found)}; keep one")
    raise RecordingError(
        f"{folder}: no calibration: add rig.toml (as python -m hardware calibrate writes it), OpenCV's calibration.yml "
        "or .xml, or, for rectified pictures, camera.toml with focal_px, cx_px, cy_px and baseline_m"
    )


def read_camera(path: Path, picture: Path) -> FolderCamera:
    """A rig of raw cameras, or a rectified pair whose size may be that of a picture. Raises ConfigError naming path."""
    if path.suffix.lower() != ".toml" or "format" in (table := read_table(path)):
        known = load_calibration(path)
        return FolderCamera(known.calibration.rectification(), known.T_base_cam)
    try:
        told = config_from_table(_CameraFile, table)
        size = (told.width_px, told.height_px) if told.width_px and told.height_px else picture_size(picture)[::-1]
        camera = StereoCamera(told.focal_px, told.cx_px, told.cy_px, told.baseline_m, *size)
    except (ConfigError, InvalidInputError) as error:
        raise ConfigError(f"{path}: {error}") from None
    return FolderCamera(camera, told.mount.T_base_cam if told.mount else None)


def find_trajectory(folder: Path) -> tuple[Path, str]:
    """The one trajectory in a folder, and what it is of: camera, base or optical."""
    found = [(folder / name, of) for name, of in TRAJECTORIES.items() if (folder / name).is_file()]
    if len(found) == 1:
        return found[0]
    if found:
        raise RecordingError(
            f"{folder}: more than one trajectory: {', '.join(path.name for path, _ in found)}; keep one"
        )
    raise RecordingError(
        f"{folder}: no trajectory: add trajectory.txt, a row `stamp x y z qx qy qz qw` a pose of the left camera, or "
        "trajectory_base.txt of the robot's base; where the rig stood still, say so (--poses standing)"
    )


def check_count(stamps_ns: Sequence[int] | Stamps, moments: Sequence[str], path: Path) -> None:
    """Raise RecordingError unless a file has a row for each picture whose name is a mere counter."""
    if len(stamps_ns) != len(moments):
        raise RecordingError(
            f"{path}: {len(stamps_ns)} rows for {len(moments)} pictures of a camera, {moments[0]} to {moments[-1]}, "
            "whose names tell no stamps: expected one row a picture, or add times.txt with the stamp of each picture"
        )
