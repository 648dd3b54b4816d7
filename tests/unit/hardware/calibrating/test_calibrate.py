"""`python -m hardware calibrate` from files: what it finds, what it says, and one line for what is wrong."""

import shutil
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner

from hardware.__main__ import app
from hardware.calibrating.outcome import seen_share
from stereogrid.calibration import BoardViews, Chessboard, load_calibration
from stereogrid.cli import run
from stereogrid.errors import StereogridError


def calibrated(*words: object) -> str:
    """What the command prints; raises what it raises."""
    result = CliRunner().invoke(app, ["calibrate", *map(str, words)])
    if isinstance(result.exception, StereogridError):
        raise result.exception
    assert result.exit_code == 0, result.output
    return result.output


def number(told: str, what: str) -> float:
    """The first number of that row of the printed table."""
    (line,) = [line for line in told.splitlines() if line.strip().startswith(what)]
    return float(line.replace(what, "", 1).split()[0].rstrip(","))


@pytest.fixture
def real(real_data: Callable[[str], Path], tmp_path: Path) -> Path:
    """A folder of its own with the real pairs."""
    folder = tmp_path / "boards"
    folder.mkdir()
    for path in real_data("calibration").glob("*.jpg"):
        shutil.copy(path, folder)
    return folder


def test_real_pairs_become_a_calibration_and_a_report(real: Path, tmp_path: Path) -> None:
    out = tmp_path / "rig.toml"
    told = calibrated(real, "--out", out, "--camera-height", 0.4, "--camera-pitch", 5)
    assert number(told, "stereo rms") <= 0.45
    assert number(told, "epipolar |dy| mean") <= 0.15
    assert number(told, "baseline") == pytest.approx(83.6, rel=0.01)
    assert "left out:" not in told and "warning: the boards were in" in told
    found = load_calibration(out)
    assert found.calibration.n_pairs == 13
    assert found.T_base_cam is not None and found.T_base_cam[2, 3] == 0.4
    assert found.board == Chessboard(9, 6, 0.025) and found.cameras.left == str(real / "left01.jpg")
    page = (tmp_path / "rig-report" / "report.html").read_text(encoding="utf-8")
    assert page.count("data:image/png;base64,") == 2 and "left08.jpg" in page and "83.17 mm" in page

    # Calibrated again without a word of it, the cameras still sit where they did.
    assert f"kept as {out} has it" in calibrated(real, "--out", out)
    np.testing.assert_allclose(load_calibration(out).T_base_cam, found.T_base_cam, atol=1e-9)


def test_what_cannot_be_used_is_named_and_the_rest_is_used(real: Path, tmp_path: Path) -> None:
    (real / "right03.jpg").unlink()
    cv2.imwrite(str(real / "left05.jpg"), np.full((480, 640), 90, np.uint8))
    # Right of another moment: far worse than the others.
    shutil.copy(real / "right02.jpg", real / "right09.jpg")
    with pytest.raises(StereogridError, match=r"corners do not fit: .* left09.jpg: its corners .* as far as usual"):
        calibrated(real, "--out", tmp_path / "rig.toml")
    told = calibrated(real, "--out", tmp_path / "rig.toml", "--drop-bad")
    assert [line.split(" its")[0] for line in told.splitlines() if line.startswith("left out:")] == [
        "left out: left03.jpg: has no right picture beside it",
        "left out: left05.jpg: no board of 9x6 inner corners in the left image",
        "left out: left09.jpg:",
    ]
    assert number(told, "pairs used") == 10 and number(told, "stereo rms") <= 0.45


def test_swapped_pictures_are_refused_and_may_be_swapped_back(real: Path, tmp_path: Path) -> None:
    for path in sorted(real.glob("left*")):
        other = path.with_name(path.name.replace("left", "right"))
        path.rename(real / "aside")
        other.rename(path)
        (real / "aside").rename(other)
    with pytest.raises(StereogridError, match="are left and right swapped"):
        calibrated(real, "--out", tmp_path / "rig.toml")
    assert not (tmp_path / "rig.toml").exists()
    calibrated(real, "--out", tmp_path / "rig.toml", "--swap")
    assert load_calibration(tmp_path / "rig.toml").cameras.swap


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["--columns", 8, "--rows", 5], "none of 13 pairs is there a board of 8x5 inner corners"),
        (["--square", 25], r"baseline is 83\d+\.\d mm.* given in metres"),
        (["--square", 0], "square_m must be positive"),
        (["--rows", 2], "at least 3 rows"),
        (["--camera-height", -1], "z_m, the lens above the ground"),
        (["--out", "rig.yml"], "the calibration is a .toml"),
        (["--out", "none/rig.toml"], "no such folder"),
    ],
)
def test_a_wrong_option_is_named_and_nothing_is_written(
    real: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: list[object], reason: str
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(StereogridError, match=reason):
        calibrated(real, *words)
    assert list(tmp_path.iterdir()) == [real]


def test_pictures_of_two_sizes_are_named(real: Path, tmp_path: Path) -> None:
    small = cv2.resize(cv2.imread(str(real / "right02.jpg"), cv2.IMREAD_GRAYSCALE), (320, 240))
    cv2.imwrite(str(real / "right02.jpg"), small)
    with pytest.raises(StereogridError, match=r"left02.jpg: the right image is 320x240 px, .* left01.jpg 640x480"):
        calibrated(real, "--out", tmp_path / "rig.toml")


def test_either_pictures_or_cameras_are_asked_for(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(app, ["calibrate"]) == 1
    assert capsys.readouterr().err == (
        "error: give pictures of a chessboard or a folder of them, or --camera; one of the two\n"
    )


def test_a_part_of_the_picture_that_no_board_reached_is_told() -> None:
    board = Chessboard(4, 3, 0.03)
    everywhere = np.stack(np.meshgrid(np.linspace(1, 638, 40), np.linspace(1, 478, 30)), axis=-1).reshape(-1, 12, 2)
    names = tuple(map(str, range(len(everywhere))))
    assert seen_share(BoardViews(board, (640, 480), names, (everywhere, everywhere))) == 1
    half = everywhere * [0.5, 1]
    assert seen_share(BoardViews(board, (640, 480), names, (everywhere, half))) == 0.5


def test_a_simulated_rig_is_recovered(tmp_path: Path) -> None:
    pytest.importorskip("embreex")
    from sim.chessboard import ChessboardSession, write_pairs

    session = ChessboardSession(seed=3)
    write_pairs(session, tmp_path / "boards")
    told = calibrated(tmp_path / "boards", "--out", tmp_path / "rig.toml")
    assert "warning" not in told
    found, truth = load_calibration(tmp_path / "rig.toml").calibration, session.truth()
    for K, true_K in zip(found.K, truth.K, strict=True):
        assert K[0, 0] == pytest.approx(true_K[0, 0], rel=0.005)
    assert found.baseline_m == pytest.approx(truth.baseline_m, rel=0.01)
