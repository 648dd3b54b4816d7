"""Cameras are listed with their plugs, and what the USB cannot carry is told before it fails."""

import errno

import pytest
from usb_bus import UsbBus

from hardware.cameras.discovery import find_cameras
from hardware.doctor.cameras import check_bandwidth, check_devices, check_minoru
from hardware.doctor.usb import usb_devices
from stereogrid.checks import NOT_THERE, OK, PROBLEM, WARNING


@pytest.fixture
def tree(tmp_path):
    return UsbBus(tmp_path)


def cameras(tree):
    return find_cameras(tree.sysfs, tree.dev, tree.query)


def minoru(tree, hub="1-1"):
    tree.plug(f"{hub}.1", "0ac8:3420", 0)
    tree.plug(f"{hub}.2", "0ac8:3410", 2)


def test_a_minoru_is_found_by_its_ids_on_one_hub(tree):
    minoru(tree)
    checks = check_devices(cameras(tree), usb_devices(tree.usb))
    assert [(check.name, check.state) for check in checks] == [
        (f"camera {tree.dev}/video0", OK),
        (f"camera {tree.dev}/video2", OK),
        ("Minoru", OK),
    ]
    assert "0ac8:3420" in checks[0].found and "USB port 1-1.1" in checks[0].found and "by-path" in checks[0].found
    assert checks[2].values["nodes"] == [f"{tree.dev}/video2", f"{tree.dev}/video0"]


def test_the_same_ids_on_two_hubs_are_no_minoru(tree):
    tree.plug("1-1.1", "0ac8:3420", 0)
    tree.plug("1-2.1", "0ac8:3410", 2)
    check = check_minoru(cameras(tree))
    assert check.state == WARNING and "not both of its cameras on one hub" in check.found


def test_a_single_webcam_with_one_of_the_ids_is_no_minoru(tree):
    tree.plug("1-1", "0ac8:3420", 0)
    check = check_minoru(cameras(tree))
    assert check.state == WARNING and "0ac8:3420 is" in check.found


def test_of_two_minorus_none_is_chosen(tree):
    minoru(tree)
    tree.plug("1-2.1", "0ac8:3420", 4)
    tree.plug("1-2.2", "0ac8:3410", 6)
    check = check_minoru(cameras(tree))
    assert (check.state, "LEFT,RIGHT" in check.remedy) == (WARNING, True)


def test_with_nothing_plugged_in_nothing_is_a_problem(tmp_path):
    checks = check_devices(find_cameras(tmp_path / "none"), usb_devices(tmp_path / "none"))
    assert [check.state for check in checks] == [NOT_THERE, NOT_THERE]


def test_a_camera_that_may_not_be_opened_is_a_problem_with_its_group(tree):
    minoru(tree)
    tree.refused[f"{tree.dev}/video0"] = PermissionError(errno.EACCES, "Permission denied")
    check = check_devices(cameras(tree), usb_devices(tree.usb))[0]
    assert check.state == PROBLEM
    assert "may not be opened" in check.found and "usermod -aG video" in check.remedy


def test_a_camera_whose_driver_is_missing_is_a_problem(tree):
    tree.device("1-1", "0ac8:3420")
    checks = check_devices(cameras(tree), usb_devices(tree.usb))
    assert [(check.name, check.state) for check in checks[1:2]] == [("camera without a node", PROBLEM)]
    assert "modprobe uvcvideo" in checks[1].remedy


@pytest.mark.parametrize(
    ("size_px", "fps", "state"),
    [((320, 240), 30, OK), ((640, 480), 15, OK), ((640, 480), 30, WARNING), ((1280, 720), 5, OK)],
)
def test_two_cameras_on_one_bus_share_it(tree, size_px, fps, state):
    minoru(tree)
    (check,) = check_bandwidth(usb_devices(tree.usb), size_px, fps)
    assert (check.state, check.values["cameras"]) == (state, 2)


def test_what_does_not_fit_is_told_with_a_rate_that_does(tree):
    minoru(tree)
    (check,) = check_bandwidth(usb_devices(tree.usb), (640, 480), 30)
    assert "640x480 at 30 Hz as YUYV is 18.4 MB/s a camera; 2 on bus 1 (480 Mbit/s): does not fit" in check.found
    assert check.remedy.startswith("--fps 15 or --size 320x240")


def test_two_cameras_on_two_buses_fit_where_they_would_not_on_one(tree):
    tree.plug("1-1", "0ac8:3420", 0)
    tree.plug("2-1", "0ac8:3410", 2)
    assert [check.state for check in check_bandwidth(usb_devices(tree.usb), (640, 480), 30)] == [OK, OK]


def test_a_usb_3_bus_carries_both(tree):
    tree.plug("2-1", "1234:0001", 0, speed=5000)
    tree.plug("2-2", "1234:0001", 2, speed=5000)
    assert [check.state for check in check_bandwidth(usb_devices(tree.usb), (640, 480), 30)] == [OK]


def test_a_camera_behind_a_slow_hub_is_a_problem(tree):
    tree.plug("1-1", "0ac8:3420", 0, speed=12)
    assert [check.state for check in check_bandwidth(usb_devices(tree.usb), (320, 240), 30)] == [PROBLEM]


def test_without_usb_cameras_there_is_no_bus_to_judge():
    assert check_bandwidth([], (640, 480), 30) == []
