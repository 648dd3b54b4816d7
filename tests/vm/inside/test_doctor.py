"""The doctor sees the kernel's own devices: cameras that give pictures, and a Minoru on a real USB bus."""

import json

import pytest
from fake_minoru import FakeCamera
from vivid import SIZE_PX, Vivid

from hardware.__main__ import app
from hardware.cameras.discovery import find_cameras
from hardware.doctor.cameras import check_bandwidth, check_devices
from hardware.doctor.usb import usb_devices
from stereogrid.cli import run


def test_cameras_that_give_pictures_are_measured(vivid: Vivid, capsys: pytest.CaptureFixture[str]) -> None:
    size = f"{SIZE_PX[0]}x{SIZE_PX[1]}"
    code = run(app, ["doctor", "--json", "--camera", f"{vivid.left},{vivid.right}", "--size", size])
    told = json.loads(capsys.readouterr().out)
    checks = {check["name"]: check for check in told["checks"]}
    assert code == 0, [check for check in told["checks"] if check["state"] == "problem"]
    for node in (vivid.left, vivid.right):
        assert checks[f"camera {node}"]["state"] == "ok"
    assert checks["camera pairs"]["values"]["size_px"] == list(SIZE_PX)
    assert checks["camera pairs"]["values"]["rate_hz"] > 1
    # The left camera sees white, the right one black, with counters on both.
    assert checks["pictures"]["state"] == "warning"
    assert checks["pictures"]["values"]["left"] > 200 and checks["pictures"]["values"]["right"] < 100, checks[
        "pictures"
    ]


def test_a_minoru_is_seen_on_its_bus_and_what_does_not_fit_it_is_told(minoru: tuple[FakeCamera, FakeCamera]) -> None:
    for camera in minoru:
        camera.plug()
    devices = [device for device in usb_devices() if device.id.startswith("0ac8:")]
    assert sorted(device.id for device in devices) == ["0ac8:3410", "0ac8:3420"]
    assert all(device.speed_mbps == 480 and "uvcvideo" in device.drivers for device in devices)
    checks = check_devices(find_cameras(), usb_devices())
    assert (checks[-1].name, checks[-1].state) == ("Minoru", "ok"), checks
    assert [check.state for check in check_bandwidth(devices, (320, 240), 30.0)] == ["ok"]
    (full,) = check_bandwidth(devices, (640, 480), 30.0)
    assert (full.state, full.values["cameras"]) == ("warning", 2)


def test_half_a_minoru_is_a_warning(minoru: tuple[FakeCamera, FakeCamera]) -> None:
    minoru[1].plug()
    assert check_devices(find_cameras(), usb_devices())[-1].state == "warning"
