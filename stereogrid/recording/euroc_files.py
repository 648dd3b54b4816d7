"""Where a folder in EuRoC's (ASL's) layout has what, and what its files say, each checked as a stranger's."""

import reprlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InvalidInputError, RecordingError
from ..geometry import FloatArray, as_floats, as_pose, inverse
from ..plainyaml import read_yaml
from ..textrows import rows_of_words, stamp_ns, table
from ..trajectory import Trajectory, stamped_poses
from .picture_files import picture_names

CAMERAS = ("cam0", "cam1")
TRUTHS = ("state_groundtruth_estimate0", "vicon0", "mocap0")
"""The folders of reference poses, the best first; leica0 has positions alone."""
RAD_TAN = ("radial-tangential", "radtan", "plumb_bob")
MAX_YAML_BYTES = 100_000


@dataclass(frozen=True)
class Places:
    """Of the left and the right camera: folders of pictures, lists of them (which may be missing), sensor.yaml."""

    pictures: tuple[Path, Path]
    lists: tuple[Path, Path]
    sensors: tuple[Path, Path]


@dataclass(frozen=True)
class Sensor:
    """A raw camera. K (3, 3) [px]; distortion as OpenCV orders it; size_px (width, height); T_body_cam (4, 4)."""

    K: FloatArray
    distortion: FloatArray
    size_px: tuple[int, int]
    T_body_cam: FloatArray


def is_euroc(path: Path) -> bool:
    """True for a folder mav0, for one that holds it, or for one with cameras or a truth where EuRoC has them."""
    signs = ("mav0", "cam0/data", "cam1/data", *TRUTHS)
    cameras = (f"{name}{sign}" for name in CAMERAS for sign in ("/sensor.yaml", "_sensor.yaml"))
    return path.is_dir() and any((path / name).exists() for name in (*signs, *cameras))


def root_of(folder: Path) -> Path:
    """The folder that holds cam0 and cam1."""
    return folder / "mav0" if (folder / "mav0").is_dir() else folder


def find_places(folder: Path) -> Places:
    """Of pictures and calibrations in ASL's layout, or in the flat one: cam0/<ns>.png, cam0_sensor.yaml."""
    root = root_of(folder)
    cameras = [root / name for name in CAMERAS]
    pictures = [camera / "data" if (camera / "data").is_dir() else camera for camera in cameras]
    flat = [root / f"{name}_sensor.yaml" for name in CAMERAS]
    inside = [camera / "sensor.yaml" for camera in cameras]
    sensors = [b if b.is_file() and not a.is_file() else a for a, b in zip(inside, flat, strict=True)]
    lists = [camera / "data.csv" for camera in cameras]
    return Places(*((left, right) for left, right in (pictures, lists, sensors)))


def find_truth(folder: Path) -> Path:
    """The file of reference poses. Raises RecordingError where there is none, or no one alone."""
    root = root_of(folder)
    for name in TRUTHS:
        if (root / name / "data.csv").is_file():
            return root / name / "data.csv"
    found = sorted(root.glob("groundtruth*.csv"))
    if len(found) == 1:
        return found[0]
    if found:
        raise RecordingError(f"{root}: more than one ground truth: {', '.join(path.name for path in found)}")
    expected = ", ".join(f"{name}/data.csv" for name in TRUTHS)
    only = "leica0 tells positions alone; " if (root / "leica0").is_dir() else ""
    raise RecordingError(f"{root}: no ground truth: {only}expected {expected} or groundtruth*.csv")


def read_truth(path: Path) -> Trajectory:
    """T_world_body of `ns, x, y, z, qw, qx, qy, qz, ...` rows, for the body of the sensor.yaml beside it, if any.

    Raises RecordingError, naming the line, for NaN, no unit quaternion, stamps that go back or too few numbers.
    """
    rows = [(where, words[:8]) for where, words in rows_of_words(path, commas=True)]
    for where, words in rows:
        if len(words) < 8:
            raise RecordingError(f"{where}: {len(words)} numbers, expected ns, x, y, z, qw, qx, qy, qz, ...")
    if not rows:
        raise RecordingError(f"{path}: no poses")
    values = table(rows)
    told = stamped_poses(rows, values[:, 1:4], np.roll(values[:, 4:8], -1, axis=1), unit_ns=1)
    sensor = path.with_name("sensor.yaml")
    if not sensor.is_file():
        return told
    # Vicon tells of its marker, which is not where the body is.
    keys = read_keys(sensor)
    return Trajectory(told.stamps_ns, told.poses @ inverse(_T_BS(keys, sensor))) if "T_BS" in keys else told


def read_pictures(pictures: Path, names: Path) -> tuple[dict[int, Path], dict[str, int]]:
    """The file of each picture by its stamp [ns], and how many could not be used, by the reason.

    names: the list `ns, file name`, without which the pictures' names are their stamps.
    """
    if names.is_file():
        rows = rows_of_words(names, commas=True)
        listed = [(where, words[0], words[1] if len(words) > 1 else "") for where, words in rows]
    else:
        listed = [(str(pictures / name), Path(name).stem, name) for name in picture_names(pictures)]
    there = set(picture_names(pictures))
    files: dict[int, Path] = {}
    for where, word, name in listed:
        if name in there:
            files.setdefault(stamp_ns(word, where, unit_ns=1), pictures / name)
    n_there = sum(name in there for _, _, name in listed)
    if not files:
        raise RecordingError(f"{names}: none of its {len(listed)} pictures is in {pictures}")
    return files, {
        "pictures that are listed but not there": len(listed) - n_there,
        "pictures with the stamp of an earlier one": n_there - len(files),
    }


def read_sensor(path: Path) -> Sensor:
    """A camera's sensor.yaml. Raises RecordingError, naming the file and key, for what is no pinhole camera of it."""
    keys = read_keys(path)
    model, distortion = (_key(keys, name, path) for name in ("camera_model", "distortion_model"))
    if model != "pinhole" or distortion not in RAD_TAN:
        raise RecordingError(
            f"{path}: a camera {_short(model)} with distortion {_short(distortion)}; only pinhole with "
            f"{' or '.join(RAD_TAN)} can be rectified here: rectify the pictures first, and give them as a plain folder"
        )
    fx, fy, cx, cy = _numbers(keys, "intrinsics", path, (4,))
    width, height = _numbers(keys, "resolution", path, (2,))
    return Sensor(
        np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1.0]]),
        _numbers(keys, "distortion_coefficients", path, (4, 5, 8)),
        (int(width), int(height)),
        _T_BS(keys, path),
    )


def read_keys(path: Path) -> dict[str, Any]:
    """The keys of a sensor.yaml. Raises RecordingError naming the file."""
    if not path.is_file():
        raise RecordingError(f"{path}: no such file; it says what the sensor is and where it sits")
    return read_yaml(path, most_bytes=MAX_YAML_BYTES)


def _T_BS(keys: dict[str, Any], path: Path) -> FloatArray:
    matrix = _key(keys, "T_BS", path)
    nested = matrix if isinstance(matrix, dict) else {"T_BS": matrix}
    numbers = _numbers(nested, "data" if isinstance(matrix, dict) else "T_BS", path, (16,))
    try:
        return as_pose(numbers.reshape(4, 4), "T_BS")
    except InvalidInputError as error:
        raise RecordingError(f"{path}: {error}") from None


def _numbers(keys: dict[str, Any], name: str, path: Path, counts: tuple[int, ...]) -> FloatArray:
    value = _key(keys, name, path)
    try:
        numbers = as_floats(value).ravel()
    except (TypeError, ValueError):
        numbers = np.empty(0)
    if numbers.size not in counts or not np.isfinite(numbers).all():
        expected = " or ".join(map(str, counts))
        raise RecordingError(f"{path}: {name} must be {expected} finite numbers, not {_short(value)}")
    return numbers


def _key(keys: dict[str, Any], name: str, path: Path) -> Any:
    if name not in keys:
        raise RecordingError(f"{path}: no key {name}; it has {_short(', '.join(map(str, keys)))}")
    return keys[name]


def _short(value: object) -> str:
    text = reprlib.Repr()
    text.maxstring = text.maxother = 120
    return text.repr(value)
