"""A plain folder of left and right pictures with a calibration and a trajectory."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import chain
from pathlib import Path

import numpy as np

from ..errors import RecordingError, unknown_name
from ..geometry import R_BASE_OPTICAL, from_rotation, inverse
from ..textrows import Stamps
from ..trajectory import Trajectory, read_tum
from . import folder_files as files
from .odometry_path import OdometryPath
from .picture_files import PictureFolders
from .raw_recording import PairingLimits, RawDrive

OF = ("camera", "base", "optical")
STANDING_PERIOD_NS = 100_000_000
UPRIGHT = 0.5
"""Cosine of how far a camera may be from upright on the whole before it is doubted: 60 degrees."""


class FolderRecording(PictureFolders):
    """Pairs from left/ and right/ (or cam0/ and cam1/), or from left_* and right_* in one folder.

    calibration: in place of the folder's own rig.toml, OpenCV file or camera.toml (a rectified pair). trajectory: a TUM
    file in place of the folder's own; of: whether it is of the rectified left "camera"; of the "base", for which the
    calibration must tell the mount; or "optical": of that camera in a world as SLAM programs have it, y down, z ahead,
    where else z is up. A folder's own tells it by its name: trajectory.txt, trajectory_base.txt, _optical.txt.
    standing: the rig stood still all the time, so that no trajectory is needed.

    Stamps: from times.txt, a row a picture; else from names that are seconds with a point, or ns, us or ms; else, if
    names are mere counters, row by row from the trajectory. Without a mount, `base` sits at the camera.
    Raises RecordingError or ConfigError, naming what is missing or wrong and what to add.
    """

    def __init__(
        self,
        folder: str | Path,
        *,
        calibration: str | Path | None = None,
        trajectory: str | Path | None = None,
        of: str = "camera",
        standing: bool = False,
        limits: PairingLimits | None = None,
    ) -> None:
        if of not in OF:
            raise unknown_name("kind of trajectory", of, OF)
        self.path, self.metadata, self.left_out = Path(folder), {}, {}
        sides = files.find_sides(self.path)
        first = sides[0][files.in_order(sides[0])[0]]
        self.beside = tuple(Path(each) for each in (calibration, trajectory) if each is not None)
        camera = files.read_camera(Path(calibration or files.find_calibration(self.path)), first)
        told, path = None, self.path
        if not standing:
            path, of = (Path(trajectory), of) if trajectory is not None else files.find_trajectory(self.path)
            told = _base_trajectory(path, of, camera)
        self._files, repeats = files.stamped(sides, self._moments_ns(sides, told, path))
        self._leave_out("pictures with the stamp of an earlier one", repeats)
        with self._opening():
            moves = None if told is None else _path(told)
            drive = RawDrive(self._stamps_ns(), camera.rig, camera.T_base_cam, moves, path.name)
            self._lay(drive, limits or PairingLimits())
            self._check_first()

    def notes(self) -> Iterator[str]:
        """Also whether the trajectory's world may be one whose z is not up."""
        yield from super().notes()
        up = -float(self.poses[:, 2, 1].mean())
        if up < UPRIGHT:
            off_deg = float(np.degrees(np.arccos(np.clip(up, -1, 1))))
            yield (
                f"doubtful: the camera's up is {off_deg:.0f} degrees off the z of its trajectory, which should be up; "
                "one with z ahead is to be named trajectory_optical.txt"
            )

    def _moments_ns(self, sides: files.Sides, told: Trajectory | None, path: Path) -> dict[str, int]:
        """The stamp of each moment that a picture's name tells of."""
        moments = files.in_order({*chain(*sides)})
        times = self.path / "times.txt"
        if times.is_file():
            return _row_by_row(files.read_times(times), moments, times)
        by_name = [files.name_stamp_ns(moment) for moment in moments]
        known = [stamp for stamp in by_name if stamp is not None]
        if len(known) == len(moments):
            return dict(zip(moments, known, strict=True))
        if told is not None:
            return _row_by_row(told.stamps_ns, moments, path)
        return {moment: number * STANDING_PERIOD_NS for number, moment in enumerate(moments)}


def _row_by_row(stamps_ns: Stamps, moments: list[str], path: Path) -> dict[str, int]:
    files.check_count(stamps_ns, moments, path)
    return dict(zip(moments, stamps_ns.tolist(), strict=True))


def _base_trajectory(path: Path, of: str, camera: files.FolderCamera) -> Trajectory:
    """A trajectory of the base, from one of what it is of."""
    told = read_tum(path)
    if of == "optical":
        told = replace(told, poses=from_rotation(R_BASE_OPTICAL) @ told.poses)
    if of != "base":
        return replace(told, poses=told.poses @ inverse(camera.T_base_cam))
    if camera.mount is None:
        raise RecordingError(
            f"{path}: is of the base, and where the camera sits on it is not known: add [mount] with x_m, y_m, z_m and "
            "pitch_deg to rig.toml or camera.toml, or give a trajectory of the left camera"
        )
    return told


def _path(told: Trajectory) -> OdometryPath:
    return OdometryPath.of(told.stamps_ns, told.poses, ["world"] * len(told.stamps_ns))
