"""Small folders in EuRoC's layout: a body whose x is up drives past a bright point, seen through lenses that bend."""

from pathlib import Path

import cv2
import numpy as np

from stereogrid.geometry import from_rotation, from_yaw, inverse, quaternion_wxyz

FIRST_NS = 1_403_715_273_262_142_976
PERIOD_NS, TRUTH_PERIOD_NS = 50_000_000, 20_000_000
SIZE_PX = (160, 120)
POINT_M = np.array([2.5, 0.2, 0.7])
K = (np.array([[100.5, 0, 79.0], [0, 100.2, 60.5], [0, 0, 1]]), np.array([[99.8, 0, 80.5], [0, 99.6, 58.5], [0, 0, 1]]))
DISTORTION = (np.array([-0.2, 0.05, 1e-3, -1e-3]), np.array([-0.21, 0.06, -1e-3, 5e-4]))
# Of the body's x up, y right, z forward: the camera's x is the body's y, its y the body's -x.
R_BODY_CAM = np.array([[0, -1.0, 0], [1, 0, 0], [0, 0, 1]])


def _turned(x_rad: float, y_rad: float, z_rad: float) -> np.ndarray:
    return cv2.Rodrigues(np.array([x_rad, y_rad, z_rad]))[0]


T_BODY_CAM = (
    from_rotation(R_BODY_CAM @ _turned(0.02, -0.01, 0.015), [-0.02, -0.06, 0.01]),
    from_rotation(R_BODY_CAM @ _turned(0.015, 0.005, 0.01), [-0.018, 0.05, 0.008]),
)
# The body lies in the world as it does when its z looks along the world's x, a little down.
R_LEVEL = np.array([[0, 0, 1.0], [0, -1, 0], [1, 0, 0]]) @ _turned(0, -0.2, 0)


def T_world_body(after_s: float) -> np.ndarray:
    """At a moment after the first picture: .6 m/s ahead and a turn, both even."""
    T = from_yaw(0.1 * after_s) @ from_rotation(R_LEVEL)
    T[:3, 3] = [0.6 * after_s, 0.1 * after_s, 0.9]
    return T


def picture(side: int, after_s: float) -> np.ndarray:
    """The raw picture (120, 160) of the point, a blob of some pixels."""
    T_cam_world = inverse(T_world_body(after_s) @ T_BODY_CAM[side])
    rotation = cv2.Rodrigues(T_cam_world[:3, :3])[0]
    seen, _ = cv2.projectPoints(POINT_M[None], rotation, T_cam_world[:3, 3], K[side], DISTORTION[side])
    column, row = seen.ravel()
    x, y = np.meshgrid(np.arange(SIZE_PX[0]), np.arange(SIZE_PX[1]))
    return (250 * np.exp(-((x - column) ** 2 + (y - row) ** 2) / 8)).astype(np.uint8)


def sensor_yaml(side: int) -> str:
    """As the data set's own, with OpenCV's first line."""
    fx, fy, cx, cy = (float(K[side][place]) for place in ((0, 0), (1, 1), (0, 2), (1, 2)))
    return (
        f"%YAML:1.0\nsensor_type: camera\ncomment: made up\nT_BS:\n  cols: 4\n  rows: 4\n"
        f"  data: {T_BODY_CAM[side].ravel().tolist()}\nrate_hz: 20\nresolution: {list(SIZE_PX)}\n"
        f"camera_model: pinhole\nintrinsics: [{fx}, {fy}, {cx}, {cy}] #fu, fv, cu, cv\n"
        f"distortion_model: radial-tangential\ndistortion_coefficients: {DISTORTION[side].tolist()}\n"
    )


def truth_csv(n: int) -> str:
    """Reports .01 s before the first picture and every .02 s, until the last one."""
    lines = ["#timestamp, p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], q_RS_z [], v"]
    for k in range(1 + (n * PERIOD_NS + 10_000_000) // TRUTH_PERIOD_NS):
        after_ns = k * TRUTH_PERIOD_NS - 10_000_000
        T = T_world_body(after_ns / 1e9)
        numbers = [*T[:3, 3], *quaternion_wxyz(T), 0.0]
        lines.append(",".join([str(FIRST_NS + after_ns), *(f"{number:.12f}" for number in numbers)]))
    return "\n".join(lines) + "\n"


def write_euroc(folder: Path, n: int = 6) -> Path:
    """folder/mav0 with n pairs; returns folder."""
    root = folder / "mav0"
    for side in (0, 1):
        data = root / f"cam{side}" / "data"
        data.mkdir(parents=True)
        names = [f"{FIRST_NS + i * PERIOD_NS}.png" for i in range(n)]
        for i, name in enumerate(names):
            cv2.imwrite(str(data / name), picture(side, i * PERIOD_NS / 1e9))
        rows = "".join(f"{name[:-4]},{name}\r\n" for name in names)
        (data.parent / "data.csv").write_text(f"#timestamp [ns],filename\r\n{rows}")
        (data.parent / "sensor.yaml").write_text(sensor_yaml(side))
    (root / "state_groundtruth_estimate0").mkdir()
    (root / "state_groundtruth_estimate0" / "data.csv").write_text(truth_csv(n))
    return folder


def write_flat(folder: Path, n: int = 6) -> Path:
    """The same as cam0/<ns>.png, cam0_sensor.yaml and groundtruth_made_up.csv."""
    write_euroc(folder, n)
    for side in (0, 1):
        camera = folder / "mav0" / f"cam{side}"
        (camera / "sensor.yaml").rename(folder / f"cam{side}_sensor.yaml")
        (camera / "data").rename(folder / f"cam{side}")
        (camera / "data.csv").unlink()
        camera.rmdir()
    truth = folder / "mav0" / "state_groundtruth_estimate0"
    (truth / "data.csv").rename(folder / "groundtruth_made_up.csv")
    truth.rmdir()
    (folder / "mav0").rmdir()
    return folder
