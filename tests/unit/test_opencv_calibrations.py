"""Calibrations that OpenCV wrote are read, and those that cannot be true are refused with the reason."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from stereogrid.calibration import load_calibration
from stereogrid.errors import ConfigError

K = np.array([[445.0, 0, 161.0], [0, 446.0, 118.0], [0, 0, 1]])
RIG: dict[str, Any] = {
    "image_width": 320,
    "image_height": 240,
    "M1": K,
    "D1": np.array([[-0.1, 0.02, 0, 0, 0.0]]),
    "M2": K + np.diag([6.0, 6.0, 0.0]),
    "D2": np.zeros((1, 5)),
    "R": Rotation.from_rotvec([0, 0.01, 0]).as_matrix(),
    "T": np.array([[-0.06], [0.0], [0.0005]]),
}


def written(path: Path, **changes: Any) -> Path:
    """A file as OpenCV writes it; None leaves a part out."""
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    for name, value in (RIG | changes).items():
        if value is not None:
            storage.write(name, value)
    storage.release()
    return path


@pytest.mark.parametrize("name", ["rig.yml", "rig.yaml", "rig.xml"])
def test_a_rig_of_opencv_is_read(tmp_path: Path, name: str) -> None:
    found = load_calibration(written(tmp_path / name)).calibration
    np.testing.assert_array_equal(found.K[0], K)
    np.testing.assert_array_equal(found.distortion[0], RIG["D1"].ravel())
    np.testing.assert_allclose(found.T_right_left[:3, 3], [-0.06, 0, 0.0005])
    assert found.size_px == (320, 240) and found.errors is None


def test_other_programs_names_are_known(tmp_path: Path) -> None:
    path = written(
        tmp_path / "rig.yml", M1=None, M2=None, D1=None, D2=None, cameraMatrix1=K, cameraMatrix2=K,
        distCoeffs1=np.zeros((5, 1)), distCoeffs2=np.zeros((5, 1)), image_width=None, width=320, height=240,
    )  # fmt: skip
    assert load_calibration(path).calibration.size_px == (320, 240)


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"T": None, "R": None}, "lacks R, T: a calibration of two cameras has"),
        ({"image_width": None}, "does not say the size of the pictures"),
        ({"T": RIG["T"] * 1000}, "baseline is 60000 mm"),
        ({"T": -RIG["T"]}, "are left and right swapped"),
        ({"R": np.eye(2)}, r"R must be \(3, 3\)"),
        ({"R": 2 * np.eye(3)}, "T_right_left is not rigid"),
        ({"M1": K * np.nan}, "left intrinsics"),
        # The Minoru's on the web, fx 445 and 451.
        ({"R1": Rotation.from_rotvec([0, np.arccos(0.38), 0]).as_matrix()}, r"by 68 degrees \(R1\[0\]\[0\] = 0.38\)"),
        ({"P1": np.diag([1787.0, 1787.0, 1.0]) @ np.eye(3, 4)}, "focal length of 445 px into 1787 px"),
    ],
)
def test_what_cannot_be_true_is_refused_with_file_and_reason(
    tmp_path: Path, changes: dict[str, Any], reason: str
) -> None:
    with pytest.raises(ConfigError, match=rf"rig\.yml: .*{reason}"):
        load_calibration(written(tmp_path / "rig.yml", **changes))


@pytest.mark.parametrize("content", [b"", b"a: [1", b"\xff\xfe", b"%YAML:1.0\n---\nM1: 3\n", b"<xml", b"[]"])
def test_what_is_no_such_file_is_named(tmp_path: Path, content: bytes) -> None:
    for name in ("rig.yml", "rig.xml"):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(ConfigError, match=rf"{name}: (is no file of OpenCV's|lacks )"):
            load_calibration(tmp_path / name)
    with pytest.raises(ConfigError, match=r"none\.yml: cannot be read"):
        load_calibration(tmp_path / "none.yml")


def test_opencvs_own_samples_lack_the_rotation(real_data: Callable[[str], Path]) -> None:
    with pytest.raises(ConfigError, match=r"intrinsics\.yml: lacks R, T"):
        load_calibration(real_data("calibration") / "intrinsics.yml")
    with pytest.raises(ConfigError, match=r"stereo_calib\.xml: lacks M1"):
        load_calibration(real_data("calibration") / "stereo_calib.xml")


@pytest.mark.parametrize(
    ("name", "text", "reason"),
    [
        ("rig.xml", '<!DOCTYPE a [<!ENTITY b "c">]><opencv_storage>&b;</opencv_storage>', "defines entities"),
        (
            "rig.xml",
            "<opencv_storage><M1><rows>3</rows><cols>3</cols><data>1 2</data></M1></opencv_storage>",
            "2 numbers",
        ),
        ("rig.yml", "%YAML:1.0\n---\na: &x [1]\nb: *x\n", "has aliases"),
        ("rig.yml", "M1: !!python/object/apply:os.system [true]\n", "is no file of OpenCV's"),
        (
            "rig.yml",
            "M1: !!opencv-matrix\n  rows: 99999999\n  cols: 1\n  data: [ 1. ]\n",
            "has 1 numbers for 99999999 x 1",
        ),
    ],
)
def test_a_forged_file_is_refused_without_opencvs_parser(tmp_path: Path, name: str, text: str, reason: str) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(ConfigError, match=reason):
        load_calibration(tmp_path / name)


def test_intrinsics_that_are_no_camera_matrix_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"left intrinsics must be \[\[fx, s, cx\]"):
        load_calibration(written(tmp_path / "rig.yml", M1=np.array([[445.0, 0, 161], [0, 446, 118], [0, 0, 0]])))
