"""Sequences in EuRoC's (ASL's) layout: raw pictures of two cameras and the poses of a body that carries them."""

from pathlib import Path

from ..calibration import StereoCalibration
from ..errors import RecordingError
from ..geometry import R_BASE_OPTICAL, FloatArray, from_rotation, inverse
from .euroc_files import CAMERAS, Sensor, find_places, find_truth, read_pictures, read_sensor, read_truth, root_of
from .odometry_path import OdometryPath
from .picture_files import PictureFolders
from .raw_recording import PairingLimits, RawDrive


class EurocRecording(PictureFolders):
    """The pairs of cam0 (left) and cam1 (right), rectified while they are read (RawRecording).

    folder: mav0 or the one above; or the flat layout cam0/<ns>.png, cam0_sensor.yaml, groundtruth*.csv. truth: the file
    of poses in place of the folder's own. standing: the rig stood still all the time, so that no poses are needed.

    The body's axes are the maker's own (EuRoC's x is up). `base` therefore sits where the body is, its axes those of
    the rectified left camera: x where it looks, y to its left, z up in its picture. So T_world_cam is the camera's true
    pose and z of `base` is up whenever the camera is level. The world is the ground truth's, z up. The recording claims
    these poses; there is no separate truth. Pairs beyond the ground truth are left out and counted.
    Raises RecordingError, naming the file and key or line, when something is missing or wrong.
    """

    def __init__(
        self,
        folder: str | Path,
        truth: str | Path | None = None,
        *,
        standing: bool = False,
        limits: PairingLimits | None = None,
    ) -> None:
        self.path, self.metadata, self.left_out = Path(folder), {}, {}
        places = find_places(self.path)
        left, right = (read_sensor(path) for path in places.sensors)
        read = [read_pictures(*each) for each in zip(places.pictures, places.lists, strict=True)]
        self._files = read[0][0], read[1][0]
        for what in read[0][1]:
            self._leave_out(what, sum(left_out[what] for _, left_out in read))
        with self._opening():
            if left.size_px != right.size_px:
                raise RecordingError(f"{self.path}: {CAMERAS[0]} is {left.size_px} px, {CAMERAS[1]} {right.size_px}")
            rectification = _calibration(left, right).rectification()
            T_body_cam = left.T_body_cam @ from_rotation(rectification.R_rect_left.T)
            T_body_base = from_rotation(T_body_cam[:3, :3] @ R_BASE_OPTICAL.T)
            told = None if standing else self._path(Path(truth or find_truth(self.path)), T_body_base)
            self.beside = (root_of(self.path), *(() if truth is None else (Path(truth),)))
            T_base_cam = inverse(T_body_base) @ T_body_cam
            drive = RawDrive(self._stamps_ns(), rectification, T_base_cam, told, "the ground truth")
            self._lay(drive, limits or PairingLimits())
            self._check_first()

    def _path(self, truth: Path, T_body_base: FloatArray) -> OdometryPath:
        told = read_truth(truth)
        root = root_of(self.path)
        self.metadata = {"ground truth": str(truth.relative_to(root) if truth.is_relative_to(root) else truth)}
        return OdometryPath.of(told.stamps_ns, told.poses @ T_body_base, ["world"] * len(told.stamps_ns))


def _calibration(left: Sensor, right: Sensor) -> StereoCalibration:
    T_right_left = inverse(right.T_body_cam) @ left.T_body_cam
    return StereoCalibration((left.K, right.K), (left.distortion, right.distortion), T_right_left, left.size_px)
