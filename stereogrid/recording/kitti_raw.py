"""KITTI raw drives: pictures, rectified (`sync`) or as the cameras gave them (`extract`), and an OXTS unit's poses."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from ..camera import Rectification, StereoCamera
from ..errors import InvalidInputError, RecordingError
from ..geometry import FloatArray, inverse
from .kitti import T_reference_left
from .kitti_raw_files import (
    CALIBRATIONS,
    CAM_TO_CAM,
    CAMERAS,
    IMU_TO_VELO,
    PAIRS,
    VELO_TO_CAM,
    find_calibration,
    find_drive,
    matrix,
    numbered,
    poses_of_oxts,
    read_calibration,
    read_oxts,
    read_stamps_ns,
    read_transform,
    rigid,
)
from .odometry_path import OdometryPath
from .picture_files import PICTURES, PictureFolders
from .raw_recording import PairingLimits, RawDrive

EXTRACT = "_extract"
"""Drives whose names end so hold pictures as the cameras gave them, which have nothing to do with each other's number.
"""


class KittiRawRecording(PictureFolders):
    """The pairs of a KITTI raw drive: its grey cameras 0 and 1 where they are there, else its colour cameras 2 and 3.

    In a `sync` drive pictures are rectified, and what has the same number belongs together: a pair's stamp is its left
    picture's, its pose that of the OXTS file of its number, or, where that is missing, between those of its neighbours
    (PairingLimits.max_gap_s). In an `extract` drive everything has a stamp of its own:
    pictures are paired, placed between OXTS reports and rectified (RawRecording).

    `base` is the OXTS unit: x forward, y left, z up, .93 m above the road. The world is level, its origin and heading
    are those of the first OXTS pose that can be read. The recording claims these poses; there is no separate truth.
    Raises RecordingError, naming the file and line, when something is missing or wrong; pictures, stamps and OXTS files
    without a partner are left out and counted.
    """

    def __init__(self, folder: str | Path, *, limits: PairingLimits | None = None) -> None:
        self.path, self.left_out = Path(folder), {}
        drive = find_drive(self.path)
        if drive is None:
            raise RecordingError(f"{folder}: no KITTI raw drive: no {CAMERAS[0]}/data in it")
        self._is_extract = drive.resolve().name.endswith(EXTRACT)
        left, right = _pair(drive)
        calibration = find_calibration(drive)
        self.beside = (drive, *(calibration / name for name in CALIBRATIONS))
        self.metadata = {"drive": drive.resolve().name, "cameras": f"{CAMERAS[left]}, {CAMERAS[right]}"}
        self._files = self._pictures_of(drive, left, right)
        path = self._oxts_path(drive / "oxts", drive / CAMERAS[left] / "timestamps.txt")
        with self._opening():
            rig, T_base_cam = _rig(calibration, (left, right), raw=self._is_extract)
            told = RawDrive(self._stamps_ns(), rig, T_base_cam, path, f"{drive / 'oxts'}")
            self._lay(told, limits or PairingLimits())
            self._check_first()

    def _pictures_of(self, drive: Path, left: int, right: int) -> tuple[dict[int, Path], dict[int, Path]]:
        """The pictures of both sides by their stamps; in a `sync` drive all by those of the left camera."""
        folders = [drive / CAMERAS[left], drive / CAMERAS[right]]
        clocks = folders if self._is_extract else [folders[0], folders[0]]
        return (
            self._stamped(numbered(folders[0] / "data", PICTURES), clocks[0] / "timestamps.txt", "pictures"),
            self._stamped(numbered(folders[1] / "data", PICTURES), clocks[1] / "timestamps.txt", "pictures"),
        )

    def _oxts_path(self, oxts: Path, left_clock: Path) -> OdometryPath:
        """The OXTS unit's poses, by its own stamps; in a `sync` drive by those of the left camera."""
        clock = oxts / "timestamps.txt" if self._is_extract else left_clock
        files = self._stamped(numbered(oxts / "data", (".txt",)), clock, "OXTS files")
        read = {stamp_ns: read_oxts(path) for stamp_ns, path in sorted(files.items())}
        known = {stamp_ns: values for stamp_ns, values in read.items() if values is not None}
        self._leave_out("OXTS files without a pose", len(read) - len(known))
        if not known:
            raise RecordingError(f"{oxts / 'data'}: no file holds a position and an orientation")
        poses = poses_of_oxts(np.stack(list(known.values())))
        return OdometryPath.of(np.array(list(known), np.int64), poses, ["oxts"] * len(known))

    def _stamped(self, files: Mapping[int, Path], clock: Path, what: str) -> dict[int, Path]:
        """Numbered files by the stamps in the row of their number; those without a stamp of their own are counted."""
        stamps_ns, found = read_stamps_ns(clock), dict[int, Path]()
        for number, path in sorted(files.items()):
            stamp_ns = stamps_ns.get(number)
            if stamp_ns is not None and stamp_ns not in found:
                found[stamp_ns] = path
            else:
                fault = f"{what} without a stamp" if stamp_ns is None else f"{what} with an earlier one's stamp"
                self._leave_out(fault, self.left_out.get(fault, 0) + 1)
        if not found:
            raise RecordingError(f"{clock}: has {len(stamps_ns)} stamps, none for the {len(files)} {what}")
        return found


def is_kitti_raw(path: Path) -> bool:
    """True for a raw drive, the folder of one of its cameras, or of a date with drives."""
    try:
        return path.is_dir() and find_drive(path) is not None
    except RecordingError:
        return True  # several: opening it says which


def _pair(drive: Path) -> tuple[int, int]:
    """The numbers of the first pair of cameras that is there."""
    for pair in PAIRS:
        if all((drive / CAMERAS[camera] / "data").is_dir() for camera in pair):
            return pair
    names = " or ".join(f"{CAMERAS[left]} and {CAMERAS[right]}" for left, right in PAIRS)
    raise RecordingError(f"{drive}: expected data of two cameras: {names}")


def _rig(calibration: Path, pair: tuple[int, int], *, raw: bool) -> tuple[Rectification | StereoCamera, FloatArray]:
    """What rectifies raw pictures, or the camera of rectified ones; and T_base_cam (4, 4) of the left one."""
    missing = [name for name in CALIBRATIONS if not (calibration / name).is_file()]
    if missing:
        raise RecordingError(f"{calibration}: no {', '.join(missing)}")
    path = calibration / CAM_TO_CAM
    held = read_calibration(path)

    def of(name: str, *shape: int) -> tuple[FloatArray, FloatArray]:
        left, right = (matrix(held, f"{name}_{camera:02d}", shape, path) for camera in pair)
        return left, right

    P = of("P_rect", 3, 4)
    width_px, height_px = _size_px(of("S_rect", 2), path)
    try:
        if raw:
            raw_width_px, raw_height_px = _size_px(of("S", 2), path)
            R = tuple(rigid(each, np.zeros(3), path)[:3, :3] for each in of("R_rect", 3, 3))
            rectification = Rectification.from_matrices(
                of("K", 3, 3), of("D", 5), (R[0], R[1]), P, (width_px, height_px), (raw_height_px, raw_width_px)
            )
            rig: Rectification | StereoCamera = rectification
            camera = rectification.camera
        else:
            rig = camera = StereoCamera.from_projections(*P, (width_px, height_px))
    except InvalidInputError as error:
        raise RecordingError(f"{path}: {error}") from error
    T_reference_cam = T_reference_left(camera, P[0])
    T_rect_cam0 = rigid(matrix(held, "R_rect_00", (3, 3), path), np.zeros(3), path)
    T_cam0_velo, T_velo_imu = (read_transform(calibration / name) for name in (VELO_TO_CAM, IMU_TO_VELO))
    return rig, inverse(T_rect_cam0 @ T_cam0_velo @ T_velo_imu) @ T_reference_cam


def _size_px(sizes: tuple[FloatArray, FloatArray], path: Path) -> tuple[int, int]:
    """(width, height) of both cameras' pictures; RecordingError unless they are the same and a size."""
    if not np.array_equal(*sizes) or not all(size > 0 and size == int(size) for size in sizes[0]):
        raise RecordingError(f"{path}: pictures of {sizes[0].tolist()} and {sizes[1].tolist()} px; expected one size")
    return int(sizes[0][0]), int(sizes[0][1])
