"""Sequences in the layout of KITTI odometry: two folders of rectified images, calib.txt and poses.txt."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from ..camera import StereoCamera
from ..errors import InvalidInputError, RecordingError
from ..geometry import R_BASE_OPTICAL, FloatArray, from_rotation, inverse
from ..observation import Observation
from .file_recording import FileRecording, ObservationAt
from .images import picture_size, read_grey
from .kitti_files import image_names, projections, read_poses, read_stamps
from .track import odometry_track

LAYOUTS = (("image_0", "image_1", 0), ("image_2", "image_3", 2), ("image_l", "image_r", 0))
"""Left folder, right folder, number of the left camera in calib.txt; the first found is read."""


class KittiRecording(FileRecording):
    """The pairs of a KITTI-odometry folder, images read as they are asked for.

    poses: the file of poses; else poses.txt in the folder, else the benchmark's ../../poses/<name>.txt.
    Its rows are camera-to-world, x right, y down, z forward. Our world has z up, x forward and its origin at
    the first left camera; `base` sits at the camera, so T_base_cam is a pure rotation. Without times.txt the
    pairs are 0.1 s apart. The recording claims its poses; there is no separate truth.

    camera; T_base_cam (4, 4); poses (M, 4, 4): the claimed T_world_cam.
    Raises RecordingError, naming the file and line, when names, calibration, poses or times are wrong; an
    image is checked when it is read.
    """

    def __init__(self, folder: str | Path, poses: str | Path | None = None) -> None:
        self.path = Path(folder)
        left, right, row = _layout(self.path)
        names = image_names(self.path / left, self.path / right)
        self._pairs = [(self.path / left / name, self.path / right / name) for name in names]
        self.metadata, self.left_out = {}, {}
        self.stamps_s = np.array(read_stamps(self.path / "times.txt", len(names)))
        P_left, P_right = projections(self.path / "calib.txt", row)
        height_px, width_px = picture_size(self._pairs[0][0])
        try:
            self.camera = StereoCamera.from_projections(P_left, P_right, (width_px, height_px))
        except InvalidInputError as error:
            raise RecordingError(f"{self.path / 'calib.txt'}: {error}") from error
        self.beside = (_poses_file(self.path, poses),)
        T_first_left = read_poses(self.beside[0], len(names)) @ T_reference_left(self.camera, P_left)
        self.T_base_cam = from_rotation(R_BASE_OPTICAL)
        self.poses = self.T_base_cam @ inverse(T_first_left[0]) @ T_first_left
        self._odometry = odometry_track(self.poses @ inverse(self.T_base_cam))

    @contextmanager
    def _reading(self) -> Iterator[ObservationAt]:
        yield self._observation

    def _observation(self, number: int) -> Observation:
        first = self._pairs[0][0]
        left, right = (read_grey(path, self.camera.shape, first) for path in self._pairs[number])
        return Observation(float(self.stamps_s[number]), left, right, self._odometry[number], self.poses[number])


def is_kitti(path: Path) -> bool:
    """True for a folder that holds images or a calibration where KITTI odometry has them."""
    names = {name for left, right, _ in LAYOUTS for name in (left, right)}
    return path.is_dir() and any((path / name).exists() for name in (*names, "calib.txt"))


def _layout(folder: Path) -> tuple[str, str, int]:
    for left, right, row in LAYOUTS:
        found = [name for name in (left, right) if (folder / name).is_dir()]
        if len(found) == 1:
            missing = left if found == [right] else right
            raise RecordingError(f"{folder}: no folder {missing} beside {found[0]}")
        if found:
            return left, right, row
    expected = ", ".join(f"{left} and {right}" for left, right, _ in LAYOUTS)
    raise RecordingError(f"{folder}: no folders of images; expected one pair of {expected}")


def _poses_file(folder: Path, given: str | Path | None) -> Path:
    beside = folder.resolve().parent.parent / "poses" / f"{folder.resolve().name}.txt"
    places = [Path(given)] if given is not None else [folder / "poses.txt", beside]
    for place in places:
        if place.is_file():
            return place
    raise RecordingError(f"{places[0]}: no such file; poses are needed, one row an image")


def T_reference_left(camera: StereoCamera, P_left: FloatArray) -> FloatArray:
    """The left camera (4, 4) as seen from the reference, camera 0, which poses and calibrations are of.

    The left colour camera stands a few centimetres beside it, as the fourth column of its projection P_left tells.
    """
    x, y, z = P_left[:, 3]
    centre = [-(x - camera.cx_px * z) / camera.focal_px, -(y - camera.cy_px * z) / camera.focal_px, -z]
    return from_rotation(np.eye(3), centre)
