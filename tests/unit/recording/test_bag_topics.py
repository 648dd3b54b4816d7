"""Topics are found by the names that drivers give them."""

import numpy as np
import pytest
from drawn_bags import CAMERA

from stereogrid.calibration import StereoCalibration
from stereogrid.errors import InvalidInputError
from stereogrid.geometry import from_rotation
from stereogrid.recording import Given, MissingTopicsError
from stereogrid.recording.contents import Contents
from stereogrid.recording.raw_topics import find_topics, pairs_of

IMAGE, PACKED, INFO = "sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage", "sensor_msgs/msg/CameraInfo"
ODOMETRY, POSE = "nav_msgs/msg/Odometry", "geometry_msgs/msg/PoseStamped"


def holding(types: dict[str, str], n: int = 3) -> Contents:
    """A file with n messages on each topic."""
    places = {topic: dict.fromkeys(range(n), object()) for topic in types}
    small = {topic: dict(places[topic]) for topic, name in types.items() if name not in (IMAGE, PACKED)}
    return Contents(messages=places, small=small, types=types, counts=dict.fromkeys(types, n))


@pytest.mark.parametrize(
    ("left", "right"),
    [
        ("/stereo/left/image_raw", "/stereo/right/image_raw"),
        ("/zed2/zed_node/left/image_rect_color", "/zed2/zed_node/right/image_rect_color"),
        ("/cam0/image_raw", "/cam1/image_raw"),
        ("/camera/infra1/image_rect_raw", "/camera/infra2/image_rect_raw"),
        ("/kitti/camera_gray_left/image_raw", "/kitti/camera_gray_right/image_raw"),
        ("/image_0", "/image_1"),
        ("/camera_00/image", "/camera_01/image"),
        ("/cam_1/image", "/cam_2/image"),
        ("/l/image", "/r/image"),
        ("/rig/cam_l", "/rig/cam_r"),
        ("/Left/Image", "/Right/Image"),
        ("camera/LEFT", "camera/RIGHT"),
    ],
)
@pytest.mark.parametrize("packed", [False, True])
def test_pairs_are_found_by_what_says_the_side(left: str, right: str, packed: bool) -> None:
    if packed:
        left, right = f"{left}/compressed", f"{right}/compressed"
    kind = PACKED if packed else IMAGE
    found = find_topics(holding({right: kind, left: kind, "/rear/image_raw": IMAGE}), Given(), by_tf=False)
    assert found.images == (left, right)


def test_names_that_say_no_side_make_no_pair() -> None:
    assert list(pairs_of(["/front/image", "/rear/image", "/level/image", "/model/image", "/cam3/image"])) == []
    contents = holding({"/front/image": IMAGE, "/left/depth/image": IMAGE, "/right/depth/image": IMAGE})
    with pytest.raises(MissingTopicsError, match=r"no topics are pictures .*/front/image \(sensor_msgs/msg/Image, 3\)"):
        find_topics(contents, Given(), by_tf=False)


def test_the_pictures_that_are_rectified_are_chosen_and_of_those_what_loses_nothing_and_costs_least() -> None:
    names = ["image_raw", "image_rect_color", "image_rect", "image_rect/compressed", "image_color"]
    types = {
        f"/{side}/{name}": PACKED if "compressed" in name else IMAGE for name in names for side in ("left", "right")
    }
    assert find_topics(holding(types), Given(), by_tf=False).left_image == "/left/image_rect"
    del types["/right/image_rect"]
    assert find_topics(holding(types), Given(), by_tf=False).left_image == "/left/image_rect_color"


def test_a_calibration_that_is_given_is_of_raw_pictures() -> None:
    rig = StereoCalibration((CAMERA.K,) * 2, (np.zeros(5),) * 2, from_rotation(np.eye(3), [-0.06, 0, 0]), (32, 24))
    types = {f"/{side}/{name}": IMAGE for name in ("image_rect", "image_raw") for side in ("left", "right")}
    found = find_topics(holding(types), Given(calibration=rig), by_tf=False)
    assert found.left_image == "/left/image_raw" and not found.rectified


def test_of_a_side_that_is_given_the_other_is_found() -> None:
    types = {f"/{name}/{side}": IMAGE for name in ("a", "b") for side in ("left", "right")}
    assert find_topics(holding(types), Given(right_image="/b/right"), by_tf=False).left_image == "/b/left"


@pytest.mark.parametrize(
    ("infos", "expected"),
    [
        (["/s/left/camera_info", "/s/right/camera_info"], ("/s/left/camera_info", "/s/right/camera_info")),
        (["/s/left/rect/camera_info", "/s/right/rect/camera_info", "/s/left/camera_info"], None),
        (["/s/right_info", "/s/left_info", "/z/left_info", "/z/right_info"], ("/s/left_info", "/s/right_info")),
        ([], None),
    ],
)
def test_the_camera_info_nearest_to_the_pictures_is_taken(infos: list[str], expected: tuple[str, str] | None) -> None:
    pictures = {"/s/left/rect/image/compressed": PACKED, "/s/right/rect/image/compressed": PACKED}
    found = find_topics(holding({**pictures, **dict.fromkeys(infos, INFO)}), Given(), by_tf=False)
    if expected is None:
        expected = ("/s/left/rect/camera_info", "/s/right/rect/camera_info") if infos else found.infos
    assert found.infos == expected


def test_the_odometry_is_an_odometry_first_then_transforms_then_poses() -> None:
    pair = {"/left/image": IMAGE, "/right/image": IMAGE}
    types = {**pair, "/ekf/odom": ODOMETRY, "/visual": ODOMETRY, "/odom": ODOMETRY, "/pose": POSE}
    for expected in ("/odom", "/ekf/odom", "/visual", "/tf"):
        assert find_topics(holding(types), Given(), by_tf=True).odometry == expected
        types.pop(expected, None)
    assert find_topics(holding(types), Given(), by_tf=False).odometry == "/pose"
    # A lone pose is where someone wants to go.
    assert find_topics(holding(types, n=1), Given(), by_tf=False).odometry == ""
    assert find_topics(holding(types), Given(standing=True), by_tf=True).odometry == ""


def test_a_given_topic_must_be_there_and_of_its_kind() -> None:
    contents = holding({"/left/image": IMAGE, "/right/image": IMAGE, "/odom": ODOMETRY})
    with pytest.raises(MissingTopicsError, match=r"there is no topic /lef; its topics: /left/image \("):
        find_topics(contents, Given(left_image="/lef"), by_tf=False)
    with pytest.raises(InvalidInputError, match="/left/image holds sensor_msgs/msg/Image, not nav_msgs/msg/Odom"):
        find_topics(contents, Given(odometry="/left/image"), by_tf=False)
