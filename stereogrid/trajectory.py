"""Trajectories as evo, KITTI's and TUM's tools read and write them, checked line by line.

TUM: `stamp x y z qx qy qz qw` a row [s, m], poses in whatever world the file is of. KITTI: the first three rows of a
pose (4, 4) a row of 12 numbers, the camera (x right, y down, z forward) seen from where it was first, without stamps.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from .errors import InvalidInputError, RecordingError, unknown_name
from .files import written_beside
from .geometry import FloatArray, as_pose, inverse
from .textrows import Row, Stamps, check_increasing, floats, rows_of_words, stamp_ns, table

FORMATS = {"tum": (".tum", ".txt"), "kitti": (".kitti",)}
"""The suffixes of each format."""

QUATERNION_TOLERANCE = 1e-3
"""Largest deviation of a quaternion's norm from 1: TUM's own files print four digits."""


@dataclass(frozen=True)
class Trajectory:
    """stamps_ns (M,): increasing [ns]; poses (M, 4, 4)."""

    stamps_ns: Stamps
    poses: FloatArray


def read_tum(path: str | Path) -> Trajectory:
    """Read a TUM trajectory. Raises RecordingError, naming the line: NaN, a quaternion that is no unit, stamps that go
    back, a row that is not of 8 numbers; or a file without rows."""
    rows = rows_of_words(Path(path))
    _check_width(rows, path, 8, "stamp x y z qx qy qz qw")
    values = table(rows)
    return stamped_poses(rows, values[:, 1:4], values[:, 4:8], unit_ns=10**9)


def stamped_poses(rows: Sequence[Row], t_m: FloatArray, xyzw: FloatArray, *, unit_ns: int) -> Trajectory:
    """Of rows that start with a stamp in unit_ns: positions (M, 3) and quaternions (M, 4). Errors as read_tum's."""
    norms = np.linalg.norm(xyzw, axis=1)
    wrong = np.flatnonzero(abs(norms - 1) > QUATERNION_TOLERANCE)
    if len(wrong):
        raise RecordingError(f"{rows[wrong[0]][0]}: the quaternion has the norm {norms[wrong[0]]:.4g}, expected 1")
    stamps_ns = np.array([stamp_ns(words[0], where, unit_ns=unit_ns) for where, words in rows], np.int64)
    check_increasing(stamps_ns, rows)
    poses = np.tile(np.eye(4), (len(rows), 1, 1))
    poses[:, :3, :3], poses[:, :3, 3] = Rotation.from_quat(xyzw).as_matrix(), t_m
    return Trajectory(stamps_ns, poses)


def read_kitti(path: str | Path) -> FloatArray:
    """Poses (M, 4, 4) of a KITTI trajectory. Raises RecordingError, naming the line: a row that is not of 12 numbers,
    NaN, a pose that is not rigid; or a file without rows."""
    rows = rows_of_words(Path(path))
    _check_width(rows, path, 12, "a 3x4 matrix, row by row")
    return np.stack([_pose_of_row(*row) for row in rows])


def _pose_of_row(where: str, words: Sequence[str]) -> FloatArray:
    try:
        return as_pose(np.vstack([np.reshape(floats(words, where), (3, 4)), [0, 0, 0, 1]]))
    except InvalidInputError as error:
        raise RecordingError(f"{where}: {error}") from error


def save_tum(path: str | Path, stamps_s: FloatArray, poses: FloatArray) -> None:
    """Write stamps (M,) [s] and poses (M, 4, 4) as a TUM trajectory, beside and then renamed.

    Raises InvalidInputError when there is no pose, one is not finite, stamps do not increase or it cannot be written.
    """
    _check_poses(path, poses)
    if not (np.diff(stamps_s) > 0).all():
        raise InvalidInputError(f"{path}: the stamps of a trajectory must increase")
    xyzw = Rotation.from_matrix(poses[:, :3, :3]).as_quat(canonical=True)
    numbers = np.hstack([poses[:, :3, 3], xyzw])
    rows = (f"{stamp_s:.9f} {words_of(row)}" for stamp_s, row in zip(stamps_s.tolist(), numbers, strict=True))
    _write(path, ["# stamp [s] x y z [m] qx qy qz qw", *rows])


def save_kitti(path: str | Path, poses: FloatArray) -> None:
    """Write poses (M, 4, 4) of an optical frame, as seen from the first of them, as a KITTI trajectory.

    Raises InvalidInputError when there is no pose, one is not finite or it cannot be written.
    """
    _check_poses(path, poses)
    # No comment: KITTI's own tools know of none.
    _write(path, [words_of(T[:3].ravel()) for T in inverse(poses[0]) @ poses])


def format_of(path: Path, name: str | None = None) -> str:
    """tum or kitti: the name, where it is given, or the file's suffix. Raises InvalidInputError for another."""
    if name is not None:
        if name not in FORMATS:
            raise unknown_name("format of trajectories", name, FORMATS)
        return name
    for known, suffixes in FORMATS.items():
        if path.suffix.lower() in suffixes:
            return known
    choices = ", ".join(suffix for suffixes in FORMATS.values() for suffix in suffixes)
    raise InvalidInputError(
        f"{path}: no trajectory has the suffix {path.suffix!r}; choose from: {choices}; or name the format"
    )


def _check_poses(path: str | Path, poses: FloatArray) -> None:
    if not len(poses) or not np.isfinite(poses).all():
        raise InvalidInputError(f"{path}: a trajectory has poses, all finite")


def _check_width(rows: Sequence[Row], path: str | Path, width: int, meaning: str) -> None:
    if not rows:
        raise RecordingError(f"{path}: no poses; expected rows of {width} numbers ({meaning})")
    for where, words in rows:
        if len(words) != width:
            raise RecordingError(f"{where}: {len(words)} numbers, expected {width} ({meaning})")


def words_of(numbers: FloatArray) -> str:
    """All digits that there are: what is read again is the same."""
    return " ".join(map(repr, numbers.tolist()))


def _write(path: str | Path, lines: Sequence[str]) -> None:
    with written_beside(Path(path)) as temporary:
        temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")
