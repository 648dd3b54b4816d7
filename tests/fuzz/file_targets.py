"""Texts, configurations, calibrations and maps."""

import hashlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import trimesh
from marked_runs import noisy_runs
from target import Target
from tiny_networks import write_network

from stereogrid.calibration import StereoCalibration, load_calibration, save_calibration
from stereogrid.camera import StereoCamera
from stereogrid.config import MappingConfig, load_config, save_config
from stereogrid.geometry import R_BASE_OPTICAL, from_rotation
from stereogrid.grid import OccupancyGrid
from stereogrid.matching import matcher
from stereogrid.motion import Growth, MotionError, read_runs
from stereogrid.motion.runs_csv import write_runs
from stereogrid.observation import Disparity
from stereogrid.run_record import RunRecord
from stereogrid.scoring.truth import load_ply

CAMERA = StereoCamera(focal_px=170, cx_px=79.5, cy_px=59.5, baseline_m=0.06, width_px=160, height_px=120)
SMALL_GB = 0.1
RUN = RunRecord("map", recording="a.mcap")
DIGEST_BYTES = 32
OPENCV_YML = """%YAML:1.0
---
image_width: 160
image_height: 120
M1: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 170., 0., 79.5, 0., 170., 59.5, 0., 0., 1. ]
D1: !!opencv-matrix
   rows: 1
   cols: 4
   dt: d
   data: [ -0.1, 0.02, 0., 0. ]
M2: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 170., 0., 79.5, 0., 170., 59.5, 0., 0., 1. ]
D2: !!opencv-matrix
   rows: 1
   cols: 4
   dt: d
   data: [ -0.1, 0.02, 0., 0. ]
R: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 1., 0., 0., 0., 1., 0., 0., 0., 1. ]
T: !!opencv-matrix
   rows: 3
   cols: 1
   dt: d
   data: [ -0.06, 0., 0. ]
"""


def small_map() -> OccupancyGrid:
    """A few blocks."""
    grid = OccupancyGrid(cell_m=0.1)
    disparity_px = np.full(CAMERA.shape, 6.0, np.float32)
    grid.integrate(CAMERA, Disparity(disparity_px, np.full_like(disparity_px, 0.2)), from_rotation(R_BASE_OPTICAL))
    return grid


def written(write: Callable[[Path], object], path: Path) -> list[bytes]:
    """What a writer of ours writes."""
    write(path)
    data = path.read_bytes()
    path.unlink()
    return [data]


def _file(name: str, read: Callable[[Path], object]) -> Callable[[bytes, Path], None]:
    """A reader of one file."""

    def read_bytes(data: bytes, folder: Path) -> None:
        (folder / name).write_bytes(data)
        read(folder / name)

    return read_bytes


def _sealed(data: bytes, folder: Path) -> None:
    """As a forger would do it: the checksum is right."""
    body = data[:-DIGEST_BYTES]
    (folder / "map.sgrid").write_bytes(body + hashlib.sha256(body).digest())
    _load(folder / "map.sgrid")


def _load(path: Path) -> None:
    OccupancyGrid.load(path, memory_limit_gb=SMALL_GB).known_cells()


def _rig(folder: Path) -> list[bytes]:
    K, D = CAMERA.K, np.array([-0.1, 0.02, 0.0, 0.0])
    rig = StereoCalibration((K, K), (D, D), from_rotation(np.eye(3), [-0.06, 0, 0]), (160, 120))
    mount = from_rotation(R_BASE_OPTICAL, [0.1, 0.03, 0.4])
    return written(lambda path: save_calibration(rig, path, T_base_cam=mount), folder / "rig.toml")


def _opencv_xml() -> bytes:
    rows = [line for line in OPENCV_YML.splitlines() if "data" in line]
    names = ("M1", "D1", "M2", "D2", "R", "T")
    shapes = ((3, 3), (1, 4), (3, 3), (1, 4), (3, 3), (3, 1))
    body = "".join(
        f'<{name} type_id="opencv-matrix"><rows>{shape[0]}</rows><cols>{shape[1]}</cols><dt>d</dt><data>'
        f"{line.split('[')[1].split(']')[0].replace(',', ' ')}</data></{name}>\n"
        for name, shape, line in zip(names, shapes, rows, strict=True)
    )
    size = "<image_width>160</image_width><image_height>120</image_height>"
    return f'<?xml version="1.0"?>\n<opencv_storage>\n{size}\n{body}</opencv_storage>\n'.encode()


def _runs(folder: Path) -> list[bytes]:
    error = MotionError(along=Growth(1e-3, 0.01), heading=Growth(1e-4, 0.02))
    runs = noisy_runs(error, 2, np.random.default_rng(0), turns=1)
    return written(lambda path: write_runs(path, runs), folder / "runs.csv")


def _network(folder: Path) -> list[bytes]:
    write_network(folder / "network.onnx")
    return [
        b'weights = "network.onnx"\ninputs = [{name = "left", image = "left"}, {name = "right", image = "right"}]\n'
        b"scale = 0.0039\nmean = [0.5]\nstd = [0.2]\npad_multiple = 8\n"
    ]


def _match(path: Path) -> None:
    image = np.random.default_rng(0).integers(0, 256, (24, 64), dtype=np.uint8)
    matcher("onnx", network=path).match(image, image)


def _mesh(_: Path) -> list[bytes]:
    box = trimesh.creation.box()
    return [box.export(file_type="ply"), box.export(file_type="ply", encoding="ascii")]


TARGETS = {
    "config-toml": Target(
        lambda folder: written(lambda path: save_config(MappingConfig(), path), folder / "config.toml"),
        _file("config.toml", lambda path: load_config(MappingConfig, path).build_mapper(CAMERA)),
    ),
    "run-toml": Target(
        lambda folder: written(
            lambda path: RunRecord("map", recording="a.mcap").save(path.parent), folder / "run.toml"
        ),
        _file("run.toml", lambda path: RunRecord.load(path.parent)),
    ),
    "calibration-toml": Target(_rig, _file("rig.toml", lambda path: load_calibration(path).camera)),
    "calibration-yml": Target(
        lambda _: [OPENCV_YML.encode()], _file("rig.yml", lambda path: load_calibration(path).camera)
    ),
    "calibration-xml": Target(lambda _: [_opencv_xml()], _file("rig.xml", lambda path: load_calibration(path).camera)),
    "runs-csv": Target(_runs, _file("runs.csv", read_runs)),
    "onnx-toml": Target(_network, _file("network.toml", _match)),
    "map-sgrid": Target(lambda folder: written(small_map().save, folder / "map.sgrid"), _file("map.sgrid", _load)),
    "map-sgrid-sealed": Target(lambda folder: written(small_map().save, folder / "map.sgrid"), _sealed),
    "map-bt": Target(lambda folder: written(lambda path: _export(path), folder / "map.bt"), _file("map.bt", _load)),
    "map-ot": Target(lambda folder: written(lambda path: _export(path), folder / "map.ot"), _file("map.ot", _load)),
    "mesh-ply": Target(_mesh, lambda data, _: load_ply(data)),
}


def _export(path: Path) -> None:
    from stereogrid import export

    export(small_map(), path)
