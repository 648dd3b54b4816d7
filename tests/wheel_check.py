"""Build the wheel, install it alone in a clean environment, and map a recording and export it from another folder.

`python tests/wheel_check.py UV`: UV is the uv to build and install with. It proves the rule that stereogrid needs
neither pybullet nor sim/ nor experiments/: the recording is made here, the map there.
"""

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from stereogrid import StereoCamera
from stereogrid.geometry import R_BASE_OPTICAL, from_rotation, from_yaw
from stereogrid.observation import Observation, Odometry
from stereogrid.recording.mcap import McapWriter

REPOSITORY = Path(__file__).resolve().parents[1]
WALL_M = 2.0
CAMERA = StereoCamera(focal_px=200.0, cx_px=79.5, cy_px=59.5, baseline_m=0.1, width_px=160, height_px=120)


def main(uv: str) -> None:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_wall(folder / "wall.mcap")
        call(uv, "build", "--quiet", "--wheel", "--out-dir", folder / "dist", REPOSITORY)
        call(uv, "venv", "--quiet", "--python", sys.executable, folder / "env")
        python = folder / "env" / "bin" / "python"
        wheel = next((folder / "dist").glob("*.whl"))
        call(uv, "pip", "install", "--quiet", "--python", python, wheel)
        for absent in ("pybullet", "sim", "arcos", "experiments", "embreex"):
            if call(python, "-c", f"import {absent}", cwd=folder, may_fail=True) == 0:
                sys.exit(f"the wheel's environment must not hold {absent}")
        call(folder / "env" / "bin" / "stereogrid", "map", "wall.mcap", "--out", "wall.sgrid", cwd=folder)
        call(folder / "env" / "bin" / "stereogrid", "export", "wall.sgrid", "wall.bt", cwd=folder)
        call(folder / "env" / "bin" / "stereogrid", "info", "wall.bt", cwd=folder)
        metrics = json.loads((folder / "runs" / "latest" / "metrics.json").read_text())
        known = metrics["scores"]["known_cells"]["value"]
        if known < 1000 or not (folder / "wall.sgrid").exists():
            sys.exit(f"the map has only {known} known cells")
    print(f"{wheel.name} alone maps a recording: {known:.0f} known cells")  # noqa: T201


def write_wall(path: Path) -> None:
    """A drive of five pairs towards a textured wall WALL_M ahead of its start."""
    texture = np.random.default_rng(0).integers(0, 256, (400, 400), dtype=np.uint8).repeat(4, 0).repeat(4, 1)
    T_base_cam = from_rotation(R_BASE_OPTICAL, [0.0, 0.0, 0.5])
    with McapWriter(path, CAMERA, T_base_cam) as writer:
        for n in range(5):
            T_odom_base = from_yaw(0.0, [0.1 * n, 0.0, 0.0])
            disparity = round(CAMERA.focal_baseline_px_m / (WALL_M - 0.1 * n))
            left = texture[500 : 500 + CAMERA.height_px, 500 : 500 + CAMERA.width_px]
            right = texture[500 : 500 + CAMERA.height_px, 500 + disparity : 500 + disparity + CAMERA.width_px]
            writer.write(
                Observation(0.1 * n, left.copy(), right.copy(), Odometry(T_odom_base), T_odom_base @ T_base_cam)
            )


def call(*command: object, cwd: Path | None = None, may_fail: bool = False) -> int:
    """Run a command with nothing of this checkout on its path; its exit code."""
    clean = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "VIRTUAL_ENV")}
    words = [str(word) for word in command]
    result = subprocess.run(words, cwd=cwd, env=clean, check=False, capture_output=may_fail)
    if result.returncode and not may_fail:
        sys.exit(f"{' '.join(words)} failed with exit code {result.returncode}")
    return result.returncode


if __name__ == "__main__":
    main(sys.argv[1])
