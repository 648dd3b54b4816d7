"""Calibrations as OpenCV's own samples write them (cv2.FileStorage): raw cameras, and how they were rectified.

Read by a YAML and an XML parser of others: OpenCV's own corrupts the memory of the process on forged files.
"""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from ..errors import InvalidInputError, RecordingError
from ..geometry import FloatArray, as_floats, from_rotation, rotation_angle_rad
from ..plainyaml import plain_text
from .rig import MAX_RECTIFYING_TURN_DEG, StereoCalibration

OPENCV_SUFFIXES = (".yml", ".yaml", ".xml")
MOST_BYTES = 256 << 10
MOST_NUMBERS = 1000
"""In a matrix; those of two cameras have 16 at most."""
NAMES = {
    "M1": ("M1", "K1", "cameraMatrix1"),
    "D1": ("D1", "distCoeffs1"),
    "M2": ("M2", "K2", "cameraMatrix2"),
    "D2": ("D2", "distCoeffs2"),
    "R": ("R",),
    "T": ("T",),
}
"""What it is called in different programs' files."""
_TAG = re.compile(r"!!opencv[-_]matrix")
_FORBIDDEN = re.compile(r"<!(?:DOCTYPE|ENTITY)", re.IGNORECASE)
Nodes = Mapping[str, Any]


def read_opencv(path: Path) -> StereoCalibration:
    """T in metres. Raises InvalidInputError, without the file's name, for what is missing or cannot be true."""
    nodes = _xml(path) if path.suffix == ".xml" else _yaml(path)
    found = {name: _matrix(nodes, aliases) for name, aliases in NAMES.items()}
    missing = [name for name, matrix in found.items() if matrix is None]
    if missing:
        raise InvalidInputError(f"lacks {', '.join(missing)}: a calibration of two cameras has {', '.join(NAMES)}")
    M1, D1, M2, D2, R, T = (as_floats(matrix) for matrix in found.values() if matrix is not None)
    if R.shape != (3, 3) or T.size != 3:
        raise InvalidInputError(f"R must be (3, 3) and T of 3 numbers, not {R.shape} and {T.size}")
    _check_rectified(nodes, M1)
    return StereoCalibration((M1, M2), (D1.ravel(), D2.ravel()), from_rotation(R, T.ravel()), _size_px(nodes))


def _yaml(path: Path) -> Nodes:
    try:
        text = _TAG.sub("", plain_text(path, most_bytes=MOST_BYTES))
        nodes = YAML(typ="safe").load(text)
    except RecordingError as error:
        fault = str(error).removeprefix(f"{path}: ")
        raise InvalidInputError("is no file of OpenCV's" if fault.startswith("no YAML") else fault) from None
    except (YAMLError, ValueError, TypeError, LookupError):
        raise InvalidInputError("is no file of OpenCV's") from None
    if not isinstance(nodes, dict):
        raise InvalidInputError("is no file of OpenCV's")
    return nodes


def _xml(path: Path) -> Nodes:
    """Its nodes: a matrix as a table of its children's texts, a number or a list as text."""
    try:
        if path.stat().st_size > MOST_BYTES:
            raise InvalidInputError(f"has more than {MOST_BYTES:,} bytes")
        text = path.read_text(encoding="utf-8")
        if _FORBIDDEN.search(text):
            raise InvalidInputError("defines entities, which no file of OpenCV's does")
        root = ElementTree.fromstring(text)
    except OSError as error:
        raise InvalidInputError(f"cannot be read ({error.strerror})") from None
    except (UnicodeDecodeError, ElementTree.ParseError, ValueError) as error:
        if isinstance(error, InvalidInputError):
            raise
        raise InvalidInputError("is no file of OpenCV's") from None
    return {node.tag: {child.tag: child.text for child in node} if len(node) else node.text for node in root}


def _check_rectified(nodes: Nodes, M1: FloatArray) -> None:
    """How the file's own program rectified, where it says so, must be possible: else its cameras are wrong too."""
    R1, P1 = _matrix(nodes, ("R1",)), _matrix(nodes, ("P1",))
    if R1 is not None and R1.shape == (3, 3):
        turn_deg = float(np.degrees(rotation_angle_rad(from_rotation(R1))))
        if turn_deg > MAX_RECTIFYING_TURN_DEG:
            raise InvalidInputError(
                f"its rectification turns the left picture by {turn_deg:.0f} degrees (R1[0][0] = {R1[0, 0]:.2f}), more "
                f"than {MAX_RECTIFYING_TURN_DEG:g}: these are not two cameras side by side"
            )
    if P1 is not None and P1.shape == (3, 4) and not 0.5 < P1[0, 0] / M1[0, 0] < 2.0:
        raise InvalidInputError(
            f"its rectification turns a focal length of {M1[0, 0]:.0f} px into {P1[0, 0]:.0f} px: it cannot be true"
        )


def _matrix(nodes: Nodes, names: tuple[str, ...]) -> FloatArray | None:
    """The matrix of the first of these names that the file has; None when it has none."""
    for name in names:
        node = nodes.get(name)
        if not isinstance(node, Mapping) or "data" not in node:
            continue
        try:
            shape = int(node["rows"]), int(node["cols"])
            numbers = _numbers(node["data"])
        except (KeyError, TypeError, ValueError, OverflowError):
            raise InvalidInputError(f"its {name} is no matrix of numbers with rows and cols") from None
        if shape[0] * shape[1] != len(numbers) or min(shape) < 1:
            raise InvalidInputError(f"its {name} has {len(numbers)} numbers for {shape[0]} x {shape[1]}")
        return np.array(numbers).reshape(shape)
    return None


def _numbers(data: object) -> list[float]:
    words: list[Any] = data.split() if isinstance(data, str) else data if isinstance(data, list) else [None]
    if len(words) > MOST_NUMBERS:
        raise ValueError
    # OpenCV writes .Nan and .Inf.
    return [float(re.sub(r"^([+-]?)\.(?=[a-zA-Z])", r"\1", str(word))) for word in words]


def _size_px(nodes: Nodes) -> tuple[int, int]:
    for names in (("image_width", "image_height"), ("imageWidth", "imageHeight"), ("width", "height")):
        width, height = (_whole(nodes.get(name)) for name in names)
        if width is not None and height is not None:
            return width, height
    for name in ("image_size", "imageSize", "size"):
        node = nodes.get(name)
        words = node.split() if isinstance(node, str) else node
        if isinstance(words, list) and len(words) == 2:
            width, height = map(_whole, words)
            if width is not None and height is not None:
                return width, height
    raise InvalidInputError("does not say the size of the pictures: add image_width and image_height")


def _whole(value: object) -> int | None:
    text = str(value).strip()
    return int(text) if re.fullmatch(r"\d{1,6}", text) else None
