"""The Minoru is found on the kernel's own uvcvideo driver, by what its two USB cameras say they are."""

from pathlib import Path

import pytest
from fake_minoru import AUTO_EXPOSURE, BRIGHTNESS, EXPOSURE_MANUAL, FakeCamera, uvc_nodes

from hardware.cameras import open_cameras
from hardware.cameras.controls import lock_controls
from hardware.cameras.discovery import find_again, find_camera, find_cameras
from hardware.cameras.minoru import find_minoru
from hardware.errors import CameraError

Pair = tuple[FakeCamera, FakeCamera]


def test_both_cameras_are_found_by_usb_id_whichever_was_plugged_in_first(minoru: Pair) -> None:
    first, second = minoru
    second.plug()
    first.plug()
    nodes = uvc_nodes()
    assert len(nodes) == 4
    found = find_minoru()
    assert [camera.usb_id for camera in found] == ["0ac8:3410", "0ac8:3420"]
    # Each camera's first node captures; the second one has its metadata.
    assert [camera.node for camera in found] == [f"/dev/{nodes[2]}", f"/dev/{nodes[0]}"]
    # The gadgets' own nodes, which take pictures in, are no cameras.
    assert len(find_cameras()) == 2


def test_one_half_of_a_minoru_is_no_minoru_and_says_what_is_missing(minoru: Pair) -> None:
    minoru[1].plug()
    with pytest.raises(CameraError, match="0ac8:3420 is there, but not its twin 0ac8:3410") as refused:
        find_minoru()
    assert "\n" not in str(refused.value)


def test_the_same_ids_on_two_hubs_are_no_minoru(minoru: Pair) -> None:
    minoru[0].plug()
    minoru[1].plug(controller=1)
    with pytest.raises(CameraError, match="not on the same hub"):
        find_minoru()


def test_a_camera_is_found_again_in_its_plug_whatever_its_node_is_called_then(minoru: Pair) -> None:
    first, second = minoru
    first.plug()
    second.plug()
    before = find_minoru()
    first.unplug()
    second.unplug()
    assert find_cameras() == [] and find_again(before[0]) is None
    # In the other order: the node that was the one's is the other's now.
    second.plug()
    assert find_again(before[0]) is None
    first.plug()
    again = [find_again(camera) for camera in before]
    assert [camera.usb_id for camera in again] == ["0ac8:3410", "0ac8:3420"]
    assert [camera.node for camera in again] == [camera.node for camera in reversed(before)]


def test_a_by_path_name_is_its_camera_and_a_by_id_name_is_refused(minoru: Pair) -> None:
    for camera in minoru:
        camera.plug()
    camera = find_minoru()[0]
    for kind in ("by-path", "by-id"):
        link = Path(f"/dev/v4l/{kind}/usb-Vimicro_Corp._Venus_USB2.0_Camera-video-index0")
        link.parent.mkdir(parents=True, exist_ok=True)
        link.symlink_to(camera.node)
        if kind == "by-path":
            assert find_camera(str(link)).plug == camera.plug
        else:
            with pytest.raises(CameraError, match=r"by id are refused.* use its by-path name"):
                find_camera(str(link))


def test_exposure_and_values_are_locked_alike_in_both_cameras_firmware(minoru: Pair) -> None:
    for camera in minoru:
        camera.plug()
    first, second = minoru
    assert first.controls[AUTO_EXPOSURE] != EXPOSURE_MANUAL
    assert first.controls[BRIGHTNESS] != second.controls[BRIGHTNESS]
    chosen, _ = lock_controls(tuple(camera.node for camera in find_minoru()), 1 / 30)
    assert chosen["auto_exposure"] == 1
    for camera in minoru:
        assert camera.controls == {AUTO_EXPOSURE: EXPOSURE_MANUAL, BRIGHTNESS: first.controls[BRIGHTNESS]}


def test_a_minoru_that_gives_no_pictures_is_refused_in_one_line(minoru: Pair) -> None:
    for camera in minoru:
        camera.plug()
    with pytest.raises(CameraError) as refused:
        open_cameras("minoru")
    said = str(refused.value)
    assert "gives no pictures" in said and "left camera" in said and "\n" not in said
