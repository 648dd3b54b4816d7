"""Cameras are found by their plugs, in trees of files as Linux shows them."""

import errno
from pathlib import Path

import pytest
from usb_trees import UsbTree

from hardware.cameras import kernel
from hardware.cameras.discovery import find_again, find_camera, find_cameras
from hardware.cameras.kernel import CAPTURE, query_capabilities
from hardware.cameras.minoru import find_minoru
from hardware.errors import CameraError


@pytest.fixture
def tree(tmp_path: Path) -> UsbTree:
    return UsbTree(tmp_path)


def minoru(tree: UsbTree, hub: str = "1-1", first: int = 0) -> None:
    tree.plug(f"{hub}.2", "0ac8:3420", first, "Minoru3D: Minoru 3D Webcam")
    tree.plug(f"{hub}.1", "0ac8:3410", first + 2, "Minoru3D: Minoru 3D Webcam")


def test_each_camera_is_listed_once_by_the_node_that_gives_pictures_with_its_plug(tree: UsbTree) -> None:
    minoru(tree)
    tree.plug("1-3", "046d:0825", 10, "HD Webcam")
    cameras = find_cameras(tree.sysfs, tree.dev, tree.query)
    assert [Path(each.node).name for each in cameras] == ["video0", "video2", "video10"]
    assert [each.usb_id for each in cameras] == ["0ac8:3420", "0ac8:3410", "046d:0825"]
    assert [each.usb_port.name for each in cameras if each.usb_port] == ["1-1.2", "1-1.1", "1-3"]
    assert [each.hub.name for each in cameras if each.hub] == ["1-1", "1-1", "usb1"]
    assert cameras[0].by_path == f"{tree.dev}/v4l/by-path/pci-0000:00:14.0-usb-0:1.2:1.0-video-index0"
    assert cameras[0].label == "Minoru3D: Minoru 3D Webcam"


def test_a_node_with_index_0_that_captures_nothing_is_no_camera(tree: UsbTree) -> None:
    output = 0x2
    tree.node(0, tree.root / "sys/devices/platform/loopback.0", "Dummy", 0, output)
    tree.node(1, tree.root / "sys/devices/platform/vivid.0", "vivid", 0, CAPTURE)
    (camera,) = find_cameras(tree.sysfs, tree.dev, tree.query)
    assert (camera.label, camera.usb_id, camera.usb_port, camera.hub) == ("vivid", "", None, None)


def test_a_camera_that_may_not_be_opened_is_listed_with_the_remedy(tree: UsbTree) -> None:
    minoru(tree)
    tree.refused[str(tree.dev / "video0")] = PermissionError(errno.EACCES, "Permission denied")
    trouble, fine = (each.trouble for each in find_cameras(tree.sysfs, tree.dev, tree.query))
    assert "usermod -aG video" in trouble and not fine


def test_a_machine_without_video_has_no_cameras(tmp_path: Path) -> None:
    assert find_cameras(tmp_path / "sys/class/video4linux", tmp_path / "dev") == []


def test_a_minoru_is_two_ids_on_one_hub_in_one_order_whatever_their_nodes(tree: UsbTree) -> None:
    tree.plug("1-3", "0ac8:3420", 0, "a single webcam")
    minoru(tree, first=4)
    first, second = find_minoru(tree.sysfs, tree.dev, tree.query)
    assert (first.usb_id, second.usb_id) == ("0ac8:3410", "0ac8:3420")
    assert (Path(first.node).name, Path(second.node).name) == ("video6", "video4")


@pytest.mark.parametrize(
    ("plugged", "said"),
    [
        ([], "neither 0ac8:3410 nor 0ac8:3420"),
        ([("1-1.2", "0ac8:3420")], "not its twin 0ac8:3410"),
        ([("1-1.1", "0ac8:3410")], "not its twin 0ac8:3420"),
        ([("1-1.2", "0ac8:3420"), ("1-2.1", "0ac8:3410")], "not on the same hub"),
        ([("1-1.2", "046d:0825"), ("1-1.1", "046d:0825")], "neither"),
    ],
)
def test_no_minoru_says_what_is_missing_and_what_was_found(
    tree: UsbTree, plugged: list[tuple[str, str]], said: str
) -> None:
    for k, (port, usb_id) in enumerate(plugged):
        tree.plug(port, usb_id, 2 * k)
    with pytest.raises(CameraError) as caught:
        find_minoru(tree.sysfs, tree.dev, tree.query)
    assert said in str(caught.value)
    for port, usb_id in plugged:
        assert f"{usb_id} 'USB 2.0 Camera' on USB port {port}" in str(caught.value)


def test_two_minorus_must_be_told_apart_by_their_paths(tree: UsbTree) -> None:
    minoru(tree, "1-1", 0)
    minoru(tree, "1-2", 4)
    with pytest.raises(CameraError, match=r"2 Minorus.*by-path"):
        find_minoru(tree.sysfs, tree.dev, tree.query)


def test_a_camera_is_named_by_its_node_or_its_path_but_not_by_its_id(tree: UsbTree) -> None:
    minoru(tree)
    node = str(tree.dev / "video0")
    path = f"{tree.dev}/v4l/by-path/pci-0000:00:14.0-usb-0:1.2:1.0-video-index0"
    by_id = next((tree.dev / "v4l/by-id").glob("*index0"))
    assert find_camera(node, tree.sysfs, tree.dev, tree.query).usb_id == "0ac8:3420"
    assert find_camera(path, tree.sysfs, tree.dev, tree.query).node == node
    with pytest.raises(CameraError, match=r"both cameras of a rig may claim the same one.*by-path.*video2"):
        find_camera(str(by_id), tree.sysfs, tree.dev, tree.query)


def test_a_metadata_node_or_a_missing_one_is_refused_with_the_cameras_there_are(tree: UsbTree) -> None:
    minoru(tree)
    for node, said in (("video1", "second node, for metadata.*video0"), ("video7", "is it plugged in.*video0")):
        with pytest.raises(CameraError, match=said):
            find_camera(str(tree.dev / node), tree.sysfs, tree.dev, tree.query)


def test_a_camera_is_found_again_in_its_plug_whatever_its_node_is_called_now(tree: UsbTree) -> None:
    minoru(tree)
    eye = find_camera(str(tree.dev / "video0"), tree.sysfs, tree.dev, tree.query)
    tree.unplug(0)
    assert find_again(eye, tree.sysfs, tree.dev, tree.query) is None
    tree.plug("1-3", "0ac8:3420", 0, eye.label)
    assert find_again(eye, tree.sysfs, tree.dev, tree.query) is None, "another camera of the same kind has its node"
    for number in (20, 21):
        tree.node(number, eye.plug, eye.label, number - 20, CAPTURE)
    again = find_again(eye, tree.sysfs, tree.dev, tree.query)
    assert again is not None and Path(again.node).name == "video20"


def test_two_cameras_of_one_device_are_told_apart_by_their_labels(tree: UsbTree) -> None:
    device = tree.root / "sys/devices/platform/vivid.0"
    for k in range(2):
        tree.node(k, device, f"vivid-00{k}-vid-cap", 0, CAPTURE)
    cameras = find_cameras(tree.sysfs, tree.dev, tree.query)
    assert [find_again(each, tree.sysfs, tree.dev, tree.query) for each in cameras] == cameras


def test_the_ioctls_are_those_of_linuxs_header() -> None:
    # As a C program prints them that includes linux/videodev2.h, on any architecture but MIPS, PowerPC and SPARC.
    numbers = (kernel._QUERYCAP, kernel._ENUM_FORMATS, kernel._ENUM_SIZES, kernel._ENUM_INTERVALS)
    assert numbers == (0x80685600, 0xC0405602, 0xC02C564A, 0xC034564B)


def test_what_is_no_v4l2_node_answers_no_query() -> None:
    with pytest.raises(OSError) as caught:
        query_capabilities("/dev/null")
    assert caught.value.errno == errno.ENOTTY
