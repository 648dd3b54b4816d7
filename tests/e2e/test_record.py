"""`python -m hardware record` as its users meet it: over real sockets, ended in every way, mapped from afterwards."""

import os
import resource
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from crooked_rig import crooked_rig, ideal_pair, raw_pair
from kinematic_body import KinematicBody
from recorded_rig import CAMERA, RIG
from rosbags.highlevel import AnyReader
from served_robot import ServedRobot

from arcos import Code
from hardware.__main__ import app
from sim.firmware.tcp import TcpLink
from stereogrid.calibration import save_calibration
from stereogrid.cli import app as stereogrid
from stereogrid.cli import run
from stereogrid.matching import matcher
from stereogrid.mjpeg import MjpegServer, jpeg
from stereogrid.recording import RawMcapRecording, open_recording

ROOT = Path(__file__).parents[2]
CAMERA_JSON = {**vars(CAMERA), "T_base_cam": RIG.T_base_cam.tolist()}
PUSHED_MPS = 0.2


class PushedBody(KinematicBody):
    """Its motors are off, and somebody pushes it."""

    def coast(self) -> None:
        self._tick(np.full(2, PUSHED_MPS))
        self.coasting = True


@contextmanager
def cameras(about: dict[str, Any] | None = None, fps: float = 20.0) -> Iterator[str]:
    """The URL of two cameras that see a wall, through lenses that bend it."""
    left, right = map(jpeg, raw_pair(crooked_rig()))
    stop = threading.Event()
    with MjpegServer(0, about or {}) as server:

        def publish() -> None:
            while not stop.wait(1 / fps):
                server.publish(left, right, time.monotonic())

        thread = threading.Thread(target=publish)
        thread.start()
        try:
            yield server.url
        finally:
            stop.set()
            thread.join()


def start(out: Path, *arguments: str, limit_bytes: int | None = None) -> "subprocess.Popen[str]":
    def limited() -> None:
        if limit_bytes is not None:
            resource.setrlimit(resource.RLIMIT_FSIZE, (limit_bytes, limit_bytes))

    command = [sys.executable, "-m", "hardware", "record", "--out", str(out), *arguments]
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "PYTHONUNBUFFERED": "1"}
    return subprocess.Popen(
        command, cwd=ROOT, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        preexec_fn=limited,
    )  # fmt: skip


def ended(process: "subprocess.Popen[str]") -> tuple[int, str, str]:
    try:
        said, status = process.communicate(timeout=60)
    finally:
        process.kill()
    assert "Traceback" not in status, status
    return process.returncode, said, status


def test_a_robot_that_is_pushed_is_recorded_raw_and_read_rectified_where_it_was(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    save_calibration(crooked_rig(), tmp_path / "rig.toml", T_base_cam=RIG.T_base_cam)
    out = tmp_path / "drive.mcap"
    with cameras() as url, ServedRobot(TcpLink(0), PushedBody()) as robot:
        given = ("--robot", f"tcp:127.0.0.1:{robot.link.port}", "--camera", url, "--duration", "3")
        code, said, status = ended(start(out, *given, "--calibration", str(tmp_path / "rig.toml")))
        ordered = robot.commands(Code.ENABLE, Code.VEL, Code.RVEL, Code.VEL2, Code.MOVE)
    assert code == 0, status
    assert {argument for _, argument in ordered} <= {0}, "a recording moves nothing"
    assert f"{out}: " in said and "DROPPED" not in said
    assert " 12.9 V, " in status and " pairs/s, skew 0 ms" in status and " GB free" in status

    recording = open_recording(out)
    assert isinstance(recording, RawMcapRecording) and recording.is_complete and len(recording) >= 10
    assert recording.metadata["calibration.toml"] == (tmp_path / "rig.toml").read_text()
    first, *_, last = recording
    for seen, ideal in zip((first.left, first.right), ideal_pair(), strict=True):
        assert np.abs(seen - ideal).mean() < 4, "JPEG costs two grey values, a picture that is not rectified twenty"
    pushed_m = last.odometry.travelled_m - first.odometry.travelled_m
    assert pushed_m == pytest.approx(PUSHED_MPS * (last.stamp_s - first.stamp_s), rel=0.15)
    np.testing.assert_allclose(last.T_world_cam, last.odometry.T_odom_base @ RIG.T_base_cam, atol=1e-9)
    assert run(stereogrid, ["info", str(out)]) == 0
    told = capsys.readouterr().out
    assert f"mcap: {len(recording)} observations in " in told and "calibration.toml: # Two cameras" in told
    with AnyReader([out]) as bag:
        assert all(bag.deserialize(data, connection.msgtype) for connection, _, data in bag.messages())


@pytest.mark.parametrize("ends", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_an_interrupt_or_a_closed_terminal_ends_it_with_a_finished_file(tmp_path: Path, ends: signal.Signals) -> None:
    out = tmp_path / "pictures.mcap"
    with cameras(CAMERA_JSON) as url:
        process = start(out, "--camera", url)
        wait_for(lambda: out.exists() and out.stat().st_size > 200_000)
        process.send_signal(ends)
        code, said, status = ended(process)
    assert code == 0 and said.startswith(f"{out}: ") and "no robot" in said, status
    recording = RawMcapRecording(out, standing=True)
    assert recording.is_complete and len(recording) == int(said.split(" pairs")[0].split()[-1])
    assert recording.camera.focal_px == CAMERA.focal_px


def wait_for(true: Callable[[], bool]) -> None:
    until_s = time.monotonic() + 60
    while not true():
        assert time.monotonic() < until_s, "it records nothing"
        time.sleep(0.02)


def test_a_full_disk_ends_it_with_one_line_and_a_readable_file(tmp_path: Path) -> None:
    out = tmp_path / "pictures.mcap"
    with cameras(CAMERA_JSON) as url:
        code, said, status = ended(start(out, "--camera", url, limit_bytes=300_000))
    assert code == 1 and said == ""
    assert status.splitlines()[-1].startswith(f"error: {out}: cannot be written: File too large; kept: {out}: 0.3 MB, ")
    assert 200_000 < out.stat().st_size <= 300_000
    assert len(list(RawMcapRecording(out, standing=True))) > 3


def one_line(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    assert run(app, ["record", *arguments]) == 1
    errors = capsys.readouterr().err
    assert errors.startswith("error: ") and errors.count("\n") == 1
    return errors


def test_bad_input_is_one_line_and_leaves_no_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    mine, out = tmp_path / "mine.mcap", tmp_path / "a.mcap"
    mine.write_text("mine")
    save_calibration(crooked_rig(), tmp_path / "rig.toml")
    rig = ("--calibration", str(tmp_path / "rig.toml"))
    assert "exists already" in one_line(capsys, "--out", str(mine), "--camera", "minoru")
    assert mine.read_text() == "mine"
    assert "no such folder" in one_line(capsys, "--out", str(tmp_path / "b" / "a.mcap"), "--camera", "minoru")
    with cameras() as url:
        given = ("--out", str(out), "--camera", url)
        assert "--duration must be > 0 s, not 0" in one_line(capsys, *given, "--duration", "0")
        assert "rig.yaml: cannot be read" in one_line(capsys, *given, "--calibration", str(tmp_path / "rig.yaml"))
        assert "--mount x,y,z" in one_line(capsys, *given, *rig)
        assert "--size must be WIDTHxHEIGHT" in one_line(capsys, *given, *rig, "--size", "wide")
        assert "camera.json: missing key 'focal_px'" in one_line(capsys, *given)
        assert "nobody" in one_line(capsys, *given, *rig, "--mount", "0.1,0,0.4", "--robot", "tcp:127.0.0.1:1")
    assert not out.exists()


def test_two_video_files_are_recorded_to_their_end(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    save_calibration(crooked_rig(), tmp_path / "rig.toml", T_base_cam=RIG.T_base_cam)
    files = [tmp_path / f"{side}.avi" for side in ("left", "right")]
    for file, picture in zip(files, raw_pair(crooked_rig()), strict=True):
        writer = cv2.VideoWriter(str(file), cv2.VideoWriter.fourcc(*"MJPG"), 25.0, (160, 120), isColor=False)
        for _ in range(10):
            writer.write(picture)
        writer.release()
    given = ("--camera", ",".join(map(str, files)), "--calibration", str(tmp_path / "rig.toml"))
    assert run(app, ["record", "--out", str(tmp_path / "a.mcap"), *given]) == 0
    assert "10 pairs, no robot" in capsys.readouterr().out
    recording = RawMcapRecording(tmp_path / "a.mcap", standing=True)
    np.testing.assert_allclose(np.diff(recording.stamps_s), 1 / 25, atol=1e-3)
    assert np.abs(next(iter(recording)).left - ideal_pair()[0]).mean() < 4


def test_without_a_robot_it_is_mapped_only_from_one_place(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "pictures.mcap"
    with cameras(CAMERA_JSON) as url:
        assert run(app, ["record", "--out", str(out), "--camera", url, "--duration", "0.5"]) == 0
    capsys.readouterr()
    assert run(stereogrid, ["map", str(out), "--runs", str(tmp_path)]) == 1
    assert "recorded without a robot" in capsys.readouterr().err


def test_a_drive_of_the_simulated_robot_is_recorded(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "sim", "firmware", "corridor", "--port", "0", "--camera", "--camera-port", "0"]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    with subprocess.Popen(
        [*command, "--width", "160", "--height", "120"], env=environment, stdout=subprocess.PIPE, text=True
    ) as firmware:
        assert firmware.stdout is not None
        try:
            url = firmware.stdout.readline().split()[1].removesuffix("left.mjpg")
            port = firmware.stdout.readline().rsplit(":", 1)[1].strip()
            given = ("--robot", f"tcp:127.0.0.1:{port}", "--camera", url, "--duration", "3")
            code, _, status = ended(start(tmp_path / "drive.mcap", *given))
        finally:
            firmware.send_signal(signal.SIGINT)
    assert code == 0, status
    recording = open_recording(tmp_path / "drive.mcap")
    *_, last = recording
    np.testing.assert_allclose(last.T_world_cam, recording.T_base_cam, atol=1e-3)
    seen = matcher("bm", num_disparities=32).match(last.left, last.right)
    depth_m = recording.camera.depth_m(seen.disparity_px[seen.valid])
    assert seen.density > 0.1 and 0.5 < np.median(depth_m) < 8
