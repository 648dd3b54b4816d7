"""`python -m sim`: what a user types and what comes back."""

import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("pybullet")
pytest.importorskip("embreex")

from sim.__main__ import app
from stereogrid.cli import run as run_command
from stereogrid.recording.mcap import McapRecording


def run(*arguments: str) -> int:
    """The exit code of the command, in this process: starting another one takes seconds."""
    return run_command(app, list(arguments))


def test_help_shows_an_example(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("record", "--help") == 0
    assert "python -m sim record corridor --out drive.mcap" in " ".join(capsys.readouterr().out.split())


def test_record_writes_a_recording(tmp_path: Path) -> None:
    out = tmp_path / "drive.mcap"
    command = [sys.executable, "-m", "sim", "record", "corridor", "--out", str(out)]
    options = ["--distance", "0.3", "--width", "160", "--height", "120"]
    result = subprocess.run([*command, *options], capture_output=True, text=True, timeout=120, check=False)
    assert result.returncode == 0, result.stderr
    recording = McapRecording(out)
    assert len(recording) >= 2 and recording.camera.width_px == 160 and recording.is_complete


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("maze", "--out", "{out}"), "no world named 'maze'; choose from: corridor"),
        (("corridor", "--out", "{out}", "--baseline", "-1"), "baseline_m must be positive"),
        (("corridor", "--out", "{out}/nowhere/drive.mcap"), "no such folder"),
        (("corridor", "--out", "{out}.txt"), "its name must end with .mcap"),
        (("corridor", "--out", "{out}", "--payload", "1000"), "payload_kg must be 0 to 12"),
        (("corridor", "--out", "{out}", "--width", "100000"), "width must be 16 to 4096 px"),
        (("corridor", "--out", "{out}", "--camera-height", "-1"), "height must be over 0"),
        (
            ("corridor", "--out", "{out}", "--renderer", "crayon"),
            "no renderer named 'crayon'; choose from: bullet, raster",
        ),
        (("corridor", "--out", "{out}", "--people", "-1"), "people must be >= 0"),
    ],
)
def test_bad_input_gets_one_line_and_leaves_no_file(
    arguments: tuple[str, ...],
    message: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert run("record", *(a.format(out=tmp_path / "drive.mcap") for a in arguments)) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert message in line
    assert not list(tmp_path.iterdir())
