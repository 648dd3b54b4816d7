"""Independent checks: bytes that other programs sent, AriaCoda's client and AMRISim's robot."""

import json
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from arcos import Code, Command, ConfigReply, Identity, PacketParser, Sip, packet, vel2
from arcos.handshake import SYNC0, SYNC1, SYNC2

NAMES = {
    "type": None,
    "xpos": "x_raw",
    "ypos": "y_raw",
    "thpos": "heading_raw",
    "lvel": "left_mmps",
    "rvel": "right_mmps",
    "battery_dV": "battery_dv",
    "stall_bumpers": "stall_bumpers",
    "control": "control_raw",
    "flags": "flags",
    "compass": "compass_raw",
    "sonar_count": None,
    "sonar": None,
    "gripper": "gripper",
    "anport": "analog_port",
    "analog": "analog",
    "digin": "digital_in",
    "digout": "digital_out",
    "battery2_dV": "battery2_dv",
    "charge": "charge",
    "rotvel_ddeg": "turn_ddegps",
    "fault": "fault",
    "latvel": "sideways_mmps",
    "temp": "temperature_c",
    "soc": "charge_percent",
    "left_over": None,
}
"""The capture's names of a SIP's fields, and ours."""
OTHER_CODES = {"ENCODER": 19, "IOREQUEST": 40, "BATTERYINFO": 62, "GYRO": 58, "SOUND": 90}


@pytest.fixture(scope="module")
def arcos_data(real_data: Callable[[str], Path]) -> Path:
    return real_data("arcos")


@pytest.fixture(scope="module")
def session(arcos_data: Path) -> dict[str, Any]:
    text = (arcos_data / "ariacoda_simpleMotion_vs_AMRISim.json").read_text()
    loaded: dict[str, Any] = json.loads(text)
    return loaded


@pytest.fixture(scope="module")
def streams(arcos_data: Path) -> dict[str, bytes]:
    return {way: (arcos_data / f"ariacoda_simpleMotion_vs_AMRISim.{way}.bin").read_bytes() for way in ("c2r", "r2c")}


def command_of(name: str) -> bytes:
    """The bytes that we send for a vector's name, such as "VEL -250", "OPEN noarg" or "VEL2 left=1 right=2"."""
    syncs = {"SYNC0/PULSE": SYNC0, "SYNC1": SYNC1, "SYNC2": SYNC2}
    if name in syncs:
        return syncs[name]
    words = name.split()
    if words[0] == "wrap":
        return packet(bytes.fromhex(words[1]))
    if words[0] == "VEL2":
        left, right = (int(word.split("=")[1]) for word in words[1:])
        return vel2(left, right).packet()
    code = OTHER_CODES.get(words[0]) or Code["E_STOP" if words[0] == "ESTOP" else words[0]]
    if words[0] == "SAY":
        return Command(code, bytes.fromhex(words[1])).packet()
    return Command(code, int(words[1]) if words[1:] and words[1] != "noarg" else None).packet()


def test_commands_are_ariacodas_byte_for_byte(arcos_data: Path) -> None:
    lines = (arcos_data / "ariacoda_command_vectors.jsonl").read_text().splitlines()
    vectors = [json.loads(line) for line in lines]
    assert len(vectors) == 63
    assert {v["name"]: command_of(v["name"]).hex() for v in vectors} == {v["name"]: v["hex"] for v in vectors}
    bodies = [bytes.fromhex(v["hex"])[3:-2] for v in vectors if not v["name"].startswith("wrap")]
    assert [Command.decode(body).body() for body in bodies] == bodies


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=40)
@given(st.data())
def test_the_session_has_no_bad_packet_however_it_is_split(
    session: dict[str, Any], streams: dict[str, bytes], data: st.DataObject
) -> None:
    for way, stream in streams.items():
        places = data.draw(st.lists(st.integers(0, len(stream)), max_size=200))
        parser = PacketParser()
        edges = [0, *sorted(places), len(stream)]
        found = [body for a, b in pairwise(edges) for body in parser.feed(stream[a:b])]
        expected = [p["hex"] for p in session["packets"] if p["dir"] == way]
        assert [packet(body).hex() for body in found] == expected
        assert (parser.bad, parser.skipped, parser.pending) == (0, 0, 0)


def test_the_session_is_found_byte_by_byte_amid_garbage_and_false_headers(
    session: dict[str, Any], streams: dict[str, bytes]
) -> None:
    garbage = (b"", b"\xfa", b"\xfa\xfb", b"\xfb\xfa\xfb\x01", b"WMS2\r", b"\xfa\xfb\x06\x0b;\xfa\0\0\0")
    for way in streams:
        sent = [bytes.fromhex(p["hex"]) for p in session["packets"] if p["dir"] == way]
        noisy = b"".join(garbage[k % len(garbage)] + each for k, each in enumerate(sent))
        parser = PacketParser()
        found = [body for byte in noisy for body in parser.feed(bytes([byte]))]
        assert [packet(body) for body in found] == sent
        assert parser.skipped == len(noisy) - len(b"".join(sent)) and parser.pending == 0


def test_the_clients_commands_are_understood(session: dict[str, Any]) -> None:
    for each in (p for p in session["packets"] if p["dir"] == "c2r"):
        command = Command.decode(bytes.fromhex(each["hex"])[3:-2])
        names = each["cmd"].split("/")
        assert command.code in [Code.__members__.get(name, OTHER_CODES.get(name)) for name in names]
        assert command.argument == each["arg"]


def test_every_sip_says_what_the_capture_says_and_is_encoded_again_to_the_same_bytes(session: dict[str, Any]) -> None:
    reports = [p for p in session["packets"] if "sip" in p]
    assert len(reports) > 290
    for each in reports:
        body, expected = bytes.fromhex(each["hex"])[3:-2], each["sip"]
        sip = Sip.decode(body)
        assert set(expected) == set(NAMES)
        ours = {theirs: getattr(sip, name) for theirs, name in NAMES.items() if name is not None}
        assert ours == {theirs: expected[theirs] for theirs in ours}
        assert [list(sonar) for sonar in sip.sonars] == expected["sonar"]
        assert sip.moving == (expected["type"] == 0x33)
        assert len(sip.rest) == expected["left_over"]
        assert sip.body() == body


def test_the_robots_replies_are_understood(session: dict[str, Any]) -> None:
    bodies = {p["type"]: bytes.fromhex(p["hex"])[3:-2] for p in session["packets"] if "type" in p}
    identity = Identity.decode(bodies["0x2"])
    assert identity == Identity("AMRISim", "Pioneer", "p3at-sh")
    assert identity.body() == bodies["0x2"]
    config = ConfigReply.decode(bodies["0x20"])
    assert config.body() == bodies["0x20"]
    assert (config.name, config.version, config.sip_cycle_ms, config.watchdog_ms) == ("AMRISim", "S.0", 100, 2000)
    assert (config.max_speed_mmps, config.acceleration_mmps2, config.auto_baud) == (3000, 300, 2)
