"""`python -m sim`: what a user types and what comes back."""

import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("pybullet")
pytest.importorskip("embreex")

from stereogrid.recording.mcap import McapRecording


def run(*arguments: str) -> "subprocess.CompletedProcess[str]":
    return subprocess.run(
        [sys.executable, "-m", "sim", *arguments], capture_output=True, text=True, timeout=120, check=False
    )


def test_help_shows_an_example() -> None:
    result = run("record", "--help")
    assert result.returncode == 0
    assert "python -m sim record corridor --out drive.mcap" in " ".join(result.stdout.split())


def test_record_writes_a_recording(tmp_path: Path) -> None:
    out = tmp_path / "drive.mcap"
    result = run("record", "corridor", "--out", str(out), "--distance", "0.3", "--width", "160", "--height", "120")
    assert result.returncode == 0, result.stderr
    recording = McapRecording(out)
    assert len(recording) >= 2 and recording.camera.width_px == 160 and recording.is_complete


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("maze", "--out", "{out}"), "no world named 'maze'; choose from: corridor"),
        (("corridor", "--out", "{out}", "--baseline", "-1"), "baseline_m must be positive"),
        (("corridor", "--out", "{out}/nowhere/drive.mcap"), "no such folder"),
    ],
)
def test_bad_input_gets_one_line_and_leaves_no_file(tmp_path: Path, arguments: tuple[str, ...], message: str) -> None:
    result = run("record", *(a.format(out=tmp_path / "drive.mcap") for a in arguments))
    assert result.returncode == 1
    (line,) = result.stderr.splitlines()
    assert message in line
    assert not list(tmp_path.iterdir())
