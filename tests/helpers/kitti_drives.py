"""Small KITTI raw drives past dots of light, whose true poses and places are known."""

from dataclasses import dataclass
from datetime import datetime, timedelta, timezone
from pathlib import Path

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from stereogrid.geometry import inverse, transform

SIZE_PX, RAW_SIZE_PX = (160, 100), (176, 112)
K_RECT = np.array([[110.0, 0, 78.3], [0, 110.0, 51.2], [0, 0, 1]])
K_RAW = np.array([[118.0, 0, 86.1], [0, 117.5, 57.0], [0, 0, 1]])
DISTORTION = np.array([-0.2, 0.06, 0.001, -0.0008, -0.01])
SHIFTS_M = ((0.0, 0, 0), (-0.54, 0, 0), (0.06, -0.0003, 0.003), (-0.47, 0.002, 0.003))
"""From camera 0 to each rectified camera, in the rectified frame."""
TURNS_RAD = ((0.004, -0.011, 0.006), (-0.006, 0.012, -0.003), (0.003, 0.004, 0.005), (-0.002, 0.009, 0.001))
LATITUDE_DEG, LONGITUDE_DEG, ALTITUDE_M, YAW_RAD = 49.011, 8.424, 112.8, 0.7
EARTH_RADIUS_M = 6378137.0
START = datetime(2011, 9, 26, 13, 2, 25, tzinfo=timezone.utc)
START_NS = 1317042145 * 10**9
DOTS_M = np.array([[9.0, 1.5, 0.4], [10.0, -1.8, 0.9], [8.0, 0.2, -0.6], [11.0, 2.6, 1.6], [12.0, -0.6, 1.9]])
"""In the world whose origin and heading are those of the first pose."""


def _rigid(rotation_rad, t_m):
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = Rotation.from_rotvec(rotation_rad).as_matrix(), t_m
    return T


T_VELO_IMU = _rigid([0.01, -0.02, 0.015], [-0.81, 0.32, -0.8])
T_CAM0_VELO = _rigid([0.006, 0.004, -0.01], [-0.004, -0.076, -0.27])
T_CAM0_VELO[:3, :3] = np.array([[0, -1, 0], [0, 0, -1], [1, 0, 0]]) @ T_CAM0_VELO[:3, :3]


def T_rect_imu() -> np.ndarray:
    """Of camera 0's rectified frame."""
    return _rigid(TURNS_RAD[0], [0, 0, 0]) @ T_CAM0_VELO @ T_VELO_IMU


def T_world_imu(time_s: float) -> np.ndarray:
    """The true pose: a bend to the left over uneven ground."""
    T = np.eye(4)
    T[:3, :3] = Rotation.from_euler("ZYX", angles_rad(time_s)).as_matrix()
    T[:3, 3] = [2.0 * time_s, 0.3 * time_s**2, 0.05 * time_s]
    return T


def angles_rad(time_s: float) -> list[float]:
    """Yaw, from the first heading on, pitch and roll."""
    return [0.2 * time_s, 0.02 + 0.03 * time_s, -0.03 + 0.05 * time_s]


@dataclass
class KittiDrive:
    """What to write: raw pictures of an `extract` drive, or rectified ones; of which cameras; n pairs."""

    extract: bool = False
    cameras: tuple[int, int] = (0, 1)
    n: int = 5

    def write(self, root: Path) -> Path:
        """Write <root>/2011_09_26/ and return its drive's folder."""
        date = root / "2011_09_26"
        drive = date / f"2011_09_26_drive_0001_{'extract' if self.extract else 'sync'}"
        for camera, offset_ns in zip(self.cameras, (0, 400_000), strict=True):
            folder = drive / f"image_{camera:02d}"
            (folder / "data").mkdir(parents=True)
            stamps_ns = [100_000_000 * k + 2_345_678 + offset_ns for k in range(self.n)]
            for k, stamp_ns in enumerate(stamps_ns):
                # A sync drive's poses are those of the OXTS packet of the same number.
                time_s = stamp_ns / 1e9 if self.extract else 0.1 * k
                cv2.imwrite(str(folder / "data" / f"{k:010d}.png"), self._picture(camera, time_s))
            (folder / "timestamps.txt").write_text("".join(f"{stamp(ns)}\n" for ns in stamps_ns))
        period_ns = 10_000_000 if self.extract else 100_000_000
        write_oxts(drive / "oxts", [period_ns * k for k in range(self.n * 100_000_000 // period_ns)])
        write_calibration(date)
        return drive

    def _picture(self, camera: int, time_s: float) -> np.ndarray:
        points = transform(T_rect_imu() @ inverse(T_world_imu(time_s)), DOTS_M) + SHIFTS_M[camera]
        if not self.extract:
            seen = points @ K_RECT.T
            return drawn(seen[:, :2] / seen[:, 2:], SIZE_PX)
        turned = points @ Rotation.from_rotvec(TURNS_RAD[camera]).as_matrix()
        seen, _ = cv2.projectPoints(turned, np.zeros(3), np.zeros(3), K_RAW, DISTORTION)
        return drawn(seen[:, 0], RAW_SIZE_PX)


def stamp(after_ns: int) -> str:
    """As KITTI writes it, nanoseconds after START."""
    second, ns = divmod(after_ns, 10**9)
    return f"{START + timedelta(seconds=second):%Y-%m-%d %H:%M:%S}.{ns:09d}"


def drawn(places_px: np.ndarray, size_px: tuple[int, int]) -> np.ndarray:
    """A dot of light at each place (N, 2)."""
    x, y = np.meshgrid(np.arange(size_px[0]), np.arange(size_px[1]))
    away = (x - places_px[:, 0, None, None]) ** 2 + (y - places_px[:, 1, None, None]) ** 2
    return np.clip(250 * np.exp(-away / 2 / 1.5**2).sum(axis=0), 0, 255).round().astype(np.uint8)


def dot_at(image: np.ndarray, place_px: np.ndarray) -> np.ndarray:
    """Where the dot nearest to a place really is: its centroid (2,) [px]."""
    column, row = np.round(place_px).astype(int)
    window = image[row - 5 : row + 6, column - 5 : column + 6].astype(float)
    y, x = np.mgrid[row - 5 : row + 6, column - 5 : column + 6]
    return np.array([(window * x).sum(), (window * y).sum()]) / window.sum()


def write_oxts(folder: Path, stamps_ns: list[int]) -> None:
    """Packets by the inverse of Mercator's projection."""
    (folder / "data").mkdir(parents=True)
    scale_m = EARTH_RADIUS_M * np.cos(np.radians(LATITUDE_DEG))
    for k, stamp_ns in enumerate(stamps_ns):
        T, (yaw, pitch, roll) = T_world_imu(stamp_ns / 1e9), angles_rad(stamp_ns / 1e9)
        east_m, north_m, up_m = Rotation.from_euler("z", YAW_RAD).apply(T[:3, 3])
        north_m += scale_m * np.log(np.tan((90 + LATITUDE_DEG) * np.pi / 360))
        latitude_deg = 360 / np.pi * np.arctan(np.exp(north_m / scale_m)) - 90
        longitude_deg = LONGITUDE_DEG + np.degrees(east_m / scale_m)
        values = [latitude_deg, longitude_deg, ALTITUDE_M + up_m, roll, pitch, YAW_RAD + yaw, *range(24)]
        (folder / "data" / f"{k:010d}.txt").write_text(" ".join(f"{value:.17g}" for value in values) + "\n")
    (folder / "timestamps.txt").write_text("".join(f"{stamp(ns)}\n" for ns in stamps_ns))


def write_calibration(folder: Path) -> None:
    """The three files of a date."""
    for name, T in (("imu_to_velo", T_VELO_IMU), ("velo_to_cam", T_CAM0_VELO)):
        lines = ["calib_time: 15-Mar-2012 11:37:16", f"R: {row(T[:3, :3])}", f"T: {row(T[:3, 3])}"]
        (folder / f"calib_{name}.txt").write_text("\n".join(lines) + "\n")
    lines = ["calib_time: 09-Jan-2012 13:57:47", "corner_dist: 9.950000e-02"]
    for camera in range(4):
        P = K_RECT @ np.column_stack([np.eye(3), SHIFTS_M[camera]])
        values = {
            "S": RAW_SIZE_PX,
            "K": K_RAW,
            "D": DISTORTION,
            "S_rect": SIZE_PX,
            "R_rect": Rotation.from_rotvec(TURNS_RAD[camera]).as_matrix(),
            "P_rect": P,
        }
        lines += [f"{name}_{camera:02d}: {row(np.asarray(value, float))}" for name, value in values.items()]
    (folder / "calib_cam_to_cam.txt").write_text("\n".join(lines) + "\n")


def row(values: np.ndarray) -> str:
    """As KITTI prints them, with more digits."""
    return " ".join(f"{value:.12e}" for value in values.ravel())
