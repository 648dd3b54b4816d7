"""Calibrations as files that people read: what a rig is, how well it was measured, and where it sits on the robot."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from datetime import datetime, timezone
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from ..camera import StereoCamera
from ..errors import ConfigError, InvalidInputError
from ..files import written_beside
from ..geometry import FloatArray, as_floats
from ..observation import Image
from ..tomlfile import config_from_table, read_table
from .chessboard import Chessboard
from .mount import Mount
from .opencv_file import OPENCV_SUFFIXES, read_opencv
from .rig import CalibrationErrors, StereoCalibration

FORMAT = "stereogrid calibration"
VERSION = 1
Rows = tuple[tuple[float, ...], ...]


@dataclass(frozen=True)
class CameraNames:
    """What was plugged in: the --camera that was asked for and whether its two cameras were swapped; left and right:
    the cameras' own names, paths or files."""

    source: str = ""
    swap: bool = False
    left: str = ""
    right: str = ""


@dataclass(frozen=True, eq=False)
class CalibrationFile:
    """A calibration with what else its file says. T_base_cam (4, 4): of the rectified left camera, where it is known;
    board: what it was calibrated with; date: as ISO 8601 writes it."""

    calibration: StereoCalibration
    T_base_cam: FloatArray | None = None
    board: Chessboard | None = None
    cameras: CameraNames = field(default_factory=CameraNames)
    date: str = ""

    @property
    def camera(self) -> StereoCamera:
        """The rectified pair."""
        return self.calibration.rectification().camera

    def rectify(self, left: Image, right: Image) -> tuple[Image, Image]:
        """The rectified pair of a raw one, each (H, W) uint8."""
        return self.calibration.rectification().rectify(left, right)


@dataclass(frozen=True)
class _Side:
    """[left], [right]."""

    K: Rows
    distortion: tuple[float, ...]


@dataclass(frozen=True)
class _Document:
    """The file. T_right_left: p_right = T_right_left @ p_left."""

    format: str
    version: int
    size_px: tuple[int, ...]
    left: _Side
    right: _Side
    T_right_left: Rows
    date: str = ""
    n_pairs: int = 0
    left_out: tuple[str, ...] = ()
    cameras: CameraNames = field(default_factory=CameraNames)
    board: Chessboard | None = None
    errors: CalibrationErrors | None = None
    mount: Mount | None = None

    @cached_property
    def calibration(self) -> StereoCalibration:
        """Raises InvalidInputError where no two cameras can be so."""
        if len(self.size_px) != 2 or min(self.size_px) < 1:
            raise InvalidInputError(f"size_px must be the pictures' width and height, not {list(self.size_px)}")
        return StereoCalibration(
            (_matrix(self.left.K, "left.K", 3), _matrix(self.right.K, "right.K", 3)),
            (as_floats(self.left.distortion), as_floats(self.right.distortion)),
            _matrix(self.T_right_left, "T_right_left", 4),
            (self.size_px[0], self.size_px[1]),
            self.errors,
            self.n_pairs,
            self.left_out,
        )


def load_calibration(path: str | Path) -> CalibrationFile:
    """Read a file that save_calibration wrote, or OpenCV's .yml or .xml with M1, D1, M2, D2, R, T and the size.

    Raises ConfigError, naming the file and the reason, when it cannot be read, says what no file of this version says,
    or holds numbers that no two cameras side by side can have.
    """
    try:
        if Path(path).suffix.lower() in OPENCV_SUFFIXES:
            return CalibrationFile(read_opencv(Path(path)))
    except InvalidInputError as error:
        raise ConfigError(f"{path}: {error}") from None
    table = read_table(path)
    try:
        _check_version(table)
        document = config_from_table(_Document, table)
        return CalibrationFile(
            document.calibration,
            None if document.mount is None else document.mount.T_base_cam,
            document.board,
            document.cameras,
            document.date,
        )
    except (ConfigError, InvalidInputError) as error:
        raise ConfigError(f"{path}: {error}") from None


def _check_version(table: Mapping[str, Any]) -> None:
    if table.get("format") != FORMAT:
        raise ConfigError(f"is no calibration: format must be {FORMAT!r}, not {table.get('format')!r}")
    version = table.get("version")
    if type(version) is not int or version < 1:
        raise ConfigError(f"version must be {VERSION}, not {version!r}")
    if version > VERSION:
        raise ConfigError(f"is of version {version}, newer than this program, which reads {VERSION}")


def _matrix(rows: Rows, name: str, size: int) -> FloatArray:
    if len(rows) != size or any(len(row) != size for row in rows):
        raise InvalidInputError(f"{name} must be {size} rows of {size} numbers, not {[list(row) for row in rows]}")
    return as_floats(rows)


def save_calibration(
    calibration: StereoCalibration,
    path: str | Path,
    *,
    T_base_cam: FloatArray | None = None,
    board: Chessboard | None = None,
    cameras: CameraNames | None = None,
) -> None:
    """Write a calibration as TOML, beside and then renamed. Raises InvalidInputError when it cannot be written."""
    (K_left, K_right), (D_left, D_right) = calibration.K, calibration.distortion
    parts = [
        f"# Two cameras, as `python -m hardware calibrate` found them.\nformat = {_text(FORMAT)}\nversion = {VERSION}",
        f"date = {_text(datetime.now(timezone.utc).isoformat(timespec='seconds'))}",
        f"size_px = {[int(n) for n in calibration.size_px]}  # width, height",
        "# p_right = T_right_left @ p_left, optical frames (x right, y down, z forward) [m]",
        f"T_right_left = {_rows(calibration.T_right_left)}",
        f"n_pairs = {calibration.n_pairs}",
        f"left_out = {_texts(calibration.left_out)}",
        *(
            f"\n[{side}]\nK = {_rows(K)}\ndistortion = {_numbers(D)}  # as OpenCV orders it: k1, k2, p1, p2, ..."
            for side, K, D in (("left", K_left, D_left), ("right", K_right, D_right))
        ),
        _section("cameras", cameras or CameraNames()),
        _section("board", board) if board else "",
        _section("errors", calibration.errors) if calibration.errors else "",
        "\n# The left lens ahead of the middle between the wheels, left of it, above the ground; pitch > 0 looks down."
        if T_base_cam is not None
        else "\n# Where the left lens sits on the robot is not known. To add: [mount] x_m, y_m, z_m, pitch_deg.",
        _section("mount", Mount.of(T_base_cam)).lstrip() if T_base_cam is not None else "",
    ]
    with written_beside(Path(path)) as temporary:
        temporary.write_text("\n".join(part for part in parts if part) + "\n", encoding="utf-8")


def _section(name: str, values: Any) -> str:
    lines = [f"{each.name} = {_value(getattr(values, each.name))}" for each in fields(values)]
    return "\n".join([f"\n[{name}]", *lines])


def _value(value: str | bool | float | tuple[float, ...]) -> str:
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, bool):
        return str(value).lower()
    return _numbers(as_floats(value)) if isinstance(value, tuple) else repr(value)


def _text(text: str) -> str:
    import tomli_w

    return tomli_w.dumps({"a": text}).partition(" = ")[2].strip()


def _texts(texts: tuple[str, ...]) -> str:
    return "[\n" + "".join(f"  {_text(each)},\n" for each in texts) + "]" if texts else "[]"


def _numbers(values: FloatArray) -> str:
    # repr gives the very number back.
    return f"[{', '.join(repr(float(value)) for value in np.ravel(values))}]"


def _rows(matrix: FloatArray) -> str:
    return "[\n" + "".join(f"  {_numbers(row)},\n" for row in matrix) + "]"
