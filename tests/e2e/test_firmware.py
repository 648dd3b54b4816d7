"""`python -m sim firmware` as its users meet it: a client over TCP and over a terminal, OpenCV at its cameras."""

import json
import os
import signal
import socket
import subprocess
import sys
import time
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager, suppress
from itertools import chain, pairwise
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from arcos_client import Client, TcpWire, TerminalWire, order

import arcos
from arcos import Code, ConfigReply, Identity, Sip, position_step
from sim.__main__ import app
from sim.firmware.eyes import EyeSettings
from sim.firmware.firmware import Firmware
from sim.firmware.loop import Loop
from sim.firmware.pacer import Pacer
from sim.firmware.serve import serve
from sim.firmware.tcp import TcpLink
from sim.rig import MINORU, mount
from sim.robot.pioneer import TICK_S, Pioneer
from sim.worlds.world import make_world
from stereogrid.cli import run
from stereogrid.errors import InvalidInputError
from stereogrid.mjpeg import MjpegServer

ROOT = Path(__file__).parents[2]


def start(*arguments: str) -> "subprocess.Popen[str]":
    command = [sys.executable, "-m", "sim", "firmware", *arguments]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    return subprocess.Popen(
        command, cwd=ROOT, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )


@contextmanager
def running(*arguments: str, lines: int = 1) -> Iterator[tuple["subprocess.Popen[str]", list[str]]]:
    """The command, once it has printed so many lines; it must still run in the end, and end well on Ctrl-C."""
    process = start(*arguments)
    try:
        assert process.stdout is not None
        said = [process.stdout.readline().strip() for _ in range(lines)]
        assert all(said), process.communicate()[1]
        yield process, said
        assert process.poll() is None, process.communicate()[1]
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=30)
        assert process.returncode == 0, errors
        assert errors.splitlines()[-1] == "stopped" and "Traceback" not in errors
    finally:
        process.kill()
        process.communicate()


def drive_a_metre(client: Client, distance_mm: float) -> None:
    """Forwards and back by MOVE, as the SIPs tell it."""
    client.send(order(Code.ENABLE, 1), order(Code.SETA, 600), order(Code.SETA, -600), order(Code.MOVE, 500))
    there = client.drive_until(lambda sip: position_step(0, sip.x_raw) * distance_mm > 490 and not sip.moving)
    assert position_step(0, there.x_raw) * distance_mm == pytest.approx(500, abs=10)
    client.send(order(Code.VEL, -200))
    client.drive_until(lambda sip: sip.left_mmps < -190)
    client.send(order(Code.E_STOP))
    stopped = client.drive_until(lambda sip: not sip.moving)
    assert stopped.e_stopped and not stopped.motors_on
    client.send(order(Code.CLOSE, 1))


def test_a_client_drives_over_tcp_while_opencv_watches_through_the_cameras(
    capsys: pytest.CaptureFixture[str],
) -> None:
    options = ("corridor", "--port", "0", "--camera", "--camera-port", "0", "--width", "160", "--height", "120")
    with running(*options, "--subclass", "p3at-sh", "--battery", "12.3", lines=2) as (_, said):
        cameras = said[0].removeprefix("cameras: ").split()[0].removesuffix("left.mjpg")
        assert said[1].startswith("p3at-sh in corridor (seed 0): 127.0.0.1:")
        port = int(said[1].rsplit(":", 1)[1])
        views = [cv2.VideoCapture(f"{cameras}{side}.mjpg", cv2.CAP_FFMPEG) for side in ("left", "right")]
        before = [view.read() for view in views]
        assert all(good and picture.shape == (120, 160, 3) and picture.std() > 10 for good, picture in before)

        with urllib.request.urlopen(f"{cameras}camera.json", timeout=20) as answer:
            calibration = json.load(answer)
        assert calibration["focal_px"] == MINORU.focal_px / 4 and calibration["baseline_m"] == MINORU.baseline_m
        assert (calibration["width_px"], calibration["height_px"], calibration["cx_px"]) == (160, 120, 79.5)
        assert np.array_equal(calibration["T_base_cam"], mount(baseline_m=MINORU.baseline_m))

        client = Client(TcpWire(port))
        assert client.connect() == Identity("stereogrid", "Pioneer", "p3at-sh")
        assert client.sip().battery_dv in (122, 123)
        drive_a_metre(client, 1.0)
        with urllib.request.urlopen(f"{cameras}left.jpg", timeout=20) as answer:
            assert 0 <= time.monotonic() - float(answer.headers["X-Timestamp"]) < 60
            after = cv2.imdecode(np.frombuffer(answer.read(), np.uint8), cv2.IMREAD_GRAYSCALE)
        # The robot has moved, and so has the picture.
        assert np.abs(after.astype(float) - before[0][1][:, :, 0]).mean() > 2
        for view in views:
            view.release()
        client.close()

        assert run(app, ["firmware", "corridor", "--port", str(port)]) == 1
        message = f"error: port {port} is in use: choose another one, or end what listens there\n"
        assert capsys.readouterr().err == message


def free_port() -> int:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        return int(free.getsockname()[1])


def test_an_interrupt_while_the_world_is_made_ends_it_too() -> None:
    port = free_port()
    process = start("corridor", "--port", str(port), "--camera", "--camera-port", "0")
    try:
        while process.poll() is None:
            with suppress(ConnectionRefusedError), socket.create_connection(("127.0.0.1", port)):
                break
        process.send_signal(signal.SIGINT)
        said, errors = process.communicate(timeout=60)
        assert (process.returncode, said, errors) == (0, "", "stopped\n")
    finally:
        process.kill()
        process.communicate()


def test_an_interrupt_while_it_is_loaded_ends_it_too(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sim.firmware.serve.serve", lambda *_, **__: pytest.fail("served"))

    @contextmanager
    def held() -> Iterator[Callable[[], bool]]:
        yield lambda: True

    monkeypatch.setattr("stereogrid.interrupts.held_interrupts", held)
    assert run(app, ["firmware", "corridor"]) == 0
    assert capsys.readouterr().err == "stopped\n"


@pytest.mark.parametrize("option", ["--port", "--camera-port"])
def test_a_port_in_use_is_refused_before_the_world_is_made(
    option: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sim.firmware.serve.WorldPlan.make", lambda _: pytest.fail("made"))
    ports = {"--port": "0", "--camera-port": "0"}
    with closing(TcpLink(0)) as taken:
        ports[option] = str(taken.port)
        assert run(app, ["firmware", "corridor", "--camera", *chain(*ports.items())]) == 1
    errors = capsys.readouterr().err
    assert f"port {taken.port} " in errors and errors.startswith("error: ") and errors.count("\n") == 1


def test_a_first_picture_that_fails_leaves_no_port_open(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object, **__: object) -> None:
        raise InvalidInputError("no picture")

    monkeypatch.setattr("sim.rig.StereoRig.look", fail)
    eyes = EyeSettings(free_port(), 160, 120)
    with pytest.raises(InvalidInputError, match="no picture"):
        serve("corridor", port=0, eyes=eyes)
    with MjpegServer(eyes.port, {}) as again:
        assert again.port == eyes.port


def test_a_client_drives_over_a_terminal() -> None:
    with running("corridor", "--pty") as (_, said):
        path = said[0].rsplit(" ", 1)[1]
        client = Client(TerminalWire(path))
        client.send(b"WMS2\r")
        assert client.connect().subclass == "p3at"
        config = ConfigReply.decode(client.ask(order(Code.CONFIG, 1), lambda body: body[0] == 0x20))
        assert config.auto_baud == 2
        client.send(order(Code.HOSTBAUD, 2))
        drive_a_metre(client, arcos.robot_of("p3at").distance_mm)
        client.close()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("corridr", "--port", "0"), "no world named 'corridr'; did you mean 'corridor'? choose from: corridor"),
        (("corridor", "--subclass", "p2at"), "no robot named 'p2at'; did you mean 'p3at'? choose from: p3at, p3at-sh"),
        (("corridor", "--port", "70000"), "a port must be 0 to 65535, not 70000"),
        (("corridor", "--camera", "--fps", "0"), "pictures a second must be more than 0 and at most 120, not 0.0"),
        (("corridor", "--port", "0", "--battery", "40"), "a battery's voltage must be"),
        (("corridor", "--seed", "-1"), "seed must be >= 0, not -1"),
    ],
)
def test_bad_input_is_one_line_that_says_what(
    arguments: tuple[str, ...], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(app, ["firmware", *arguments]) == 1
    errors = capsys.readouterr().err
    assert errors.startswith(f"error: {message}") and errors.count("\n") == 1


@pytest.fixture(scope="module")
def session(real_data: Callable[[str], Path]) -> dict[str, Any]:
    text = (real_data("arcos") / "ariacoda_simpleMotion_vs_AMRISim.json").read_text()
    loaded: dict[str, Any] = json.loads(text)
    return loaded


class Clock:
    """Time that passes only by sleeping."""

    now_s = 0.0

    def __call__(self) -> float:
        return self.now_s

    def sleep(self, duration_s: float) -> None:
        self.now_s += duration_s


def replay(loop: Loop, client: Client, session: dict[str, Any]) -> None:
    """Send what AriaCoda's client sent, at its times by the robot's clock; in the handshake, wait for each answer."""
    for k, each in enumerate(p for p in session["packets"] if p["dir"] == "c2r"):
        while loop.body.time_s < each["t"] or len(client.bodies) < min(k, 3):
            loop.step()
            client.listen(0.001)
        client.send(bytes.fromhex(each["hex"]))
    for _ in range(10):
        loop.step()
        client.listen(0.001)


def test_ariacodas_client_drives_the_robot_with_the_bytes_that_it_sent_to_another_simulator(
    session: dict[str, Any],
) -> None:
    clock = Clock()
    with Pioneer(make_world("corridor", 0)) as body, closing(TcpLink(0)) as link:
        client = Client(TcpWire(link.port))
        pacer = Pacer(TICK_S, clock=clock, sleep=clock.sleep)
        replay(Loop(body, Firmware("p3at-sh"), link, pacer), client, session)
        client.close()
        assert not body.motors_on
    theirs = [bytes.fromhex(p["hex"])[3:-2] for p in session["packets"] if p["dir"] == "r2c"]
    ours = client.bodies
    assert client.parser.bad == 0 and client.parser.skipped == 0
    assert ours[:2] == theirs[:2] == [b"\0", b"\1"]
    assert Identity.decode(ours[2]).subclass == Identity.decode(theirs[2]).subclass == "p3at-sh"
    assert {body[0] for body in ours} == {0x00, 0x01, 0x02, 0x20, 0x32, 0x33}

    sips = [Sip.decode(body) for body in ours if Sip.is_sip(body)]
    model = next(Sip.decode(body) for body in theirs if Sip.is_sip(body))
    assert len(sips) == pytest.approx(300, abs=15)
    assert {len(sip.body()) for sip in sips} == {len(model.body())}
    assert [sonar.number for sonar in sips[0].sonars] == [sonar.number for sonar in model.sonars]
    assert not sips[0].motors_on and sips[100].motors_on

    # What the program does: 5 s at 250 mm/s, turns at 10 and at -10 deg/s, 5 s at 150 mm/s.
    assert max(sip.left_mmps for sip in sips) == pytest.approx(250, abs=5)
    assert (max(sip.turn_ddegps for sip in sips), min(sip.turn_ddegps for sip in sips)) == pytest.approx(
        (100, -100), abs=8
    )
    travelled_mm = sum(position_step(a.x_raw, b.x_raw) for a, b in pairwise(sips))
    assert 1500 < travelled_mm < 2200
