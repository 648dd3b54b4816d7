"""Two V4L2 cameras as `open_cameras` gives them: their pairs, and what becomes of them when a camera fails or goes."""

import subprocess
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from kernel_side import controls, set_controls, wait_until
from vivid import FPS, SIZE_PX, Vivid

from hardware.cameras import RawPair, open_cameras
from hardware.cameras.discovery import find_cameras
from hardware.cameras.live import LivePairs
from hardware.clock import now_s
from hardware.errors import CameraError
from hardware.mailbox import Mailbox

Running = tuple[LivePairs, Mailbox[RawPair]]
# A second in a guest of emulated CPUs on a busy machine.
PATIENCE_S = 60.0


def taken(mailbox: Mailbox[RawPair], count: int) -> list[RawPair]:
    pairs = [mailbox.get(PATIENCE_S) for _ in range(count)]
    assert None not in pairs, f"no pair in {PATIENCE_S:.0f} s"
    return pairs


def taken_after(moment_s: float, mailbox: Mailbox[RawPair]) -> RawPair:
    """The first pair of which both pictures were taken after the moment."""
    end_s = now_s() + PATIENCE_S
    while now_s() < end_s:
        (pair,) = taken(mailbox, 1)
        if min(pair.left_stamp_s, pair.right_stamp_s) > moment_s:
            return pair
    pytest.fail(f"no new pair in {PATIENCE_S:.0f} s")


def no_problem(cameras: LivePairs) -> None:
    """Soon, since a busy machine may hold a picture up for a moment."""
    wait_until(lambda: cameras.problem() == "", "the end of all problems", PATIENCE_S)


def refusal(spec: str, **wishes: object) -> str:
    """Why it cannot be opened, which is one line."""
    with pytest.raises(CameraError) as refused:
        open_cameras(spec, **{"size_px": SIZE_PX, "lock": False, **wishes})
    assert "\n" not in str(refused.value)
    return str(refused.value)


@pytest.fixture
def spec(vivid: Vivid) -> str:
    return f"{vivid.left},{vivid.right}"


@pytest.fixture
def running(spec: str) -> Iterator[Running]:
    """The open cameras, and the mailbox of their pairs."""
    with open_cameras(spec, size_px=SIZE_PX, fps=FPS, lock=False) as cameras:
        yield cameras, cameras.subscribe(1)


def test_cameras_that_capture_are_found_and_their_metadata_nodes_are_not(vivid: Vivid) -> None:
    assert [camera.node for camera in find_cameras()] == [vivid.left, vivid.right]


def test_what_is_no_camera_is_refused_in_one_line_with_what_there_is(vivid: Vivid) -> None:
    for name, why in {
        "/dev/video17": "/dev/video17 is not there",
        vivid.right_metadata: f"{vivid.right_metadata} gives no pictures",
        "/dev/v4l/by-id/usb-a-video-index0": "by id are refused",
    }.items():
        said = refusal(f"{vivid.left},{name}")
        assert why in said and vivid.left in said and vivid.right in said


def test_another_size_than_was_asked_for_is_refused_with_the_sizes_there_are(vivid: Vivid, spec: str) -> None:
    # vivid takes 320x240 without a word, and gives 320x180.
    said = refusal(spec, size_px=(320, 240))
    assert f"{vivid.left} gives 320x180, not 320x240" in said and "320x180, 640x360, 640x480" in said
    assert len(said) < 300


def test_a_camera_that_another_program_reads_is_busy_and_its_reader_is_named(vivid: Vivid, spec: str) -> None:
    with subprocess.Popen(["v4l2-ctl", "-d", vivid.right, "--stream-mmap"], stderr=subprocess.DEVNULL) as reader:
        time.sleep(3.0)
        said = refusal(spec)
        reader.kill()
    assert f"{vivid.right} is busy" in said and f"v4l2-ctl (process {reader.pid})" in said


def test_pairs_come_at_the_cameras_rate_within_the_bound_with_the_kernels_stamps(spec: str) -> None:
    opened_s = now_s()
    with open_cameras(spec, size_px=SIZE_PX, fps=FPS, lock=False) as cameras:
        mailbox = cameras.subscribe(200)
        pairs = taken(mailbox, 60)
        assert {each["stamps"] for each in (cameras.about["left"], cameras.about["right"])} == {"monotonic"}
        assert cameras.last_stamp_s() >= pairs[-1].stamp_s
        no_problem(cameras)
    closed_s = now_s()
    for side in ("left_stamp_s", "right_stamp_s"):
        stamps_s = np.array([getattr(pair, side) for pair in pairs])
        assert (np.diff(stamps_s) > 0).all() and opened_s < stamps_s[0] and stamps_s[-1] < closed_s
        # Some pictures may be lost on a busy machine; none comes twice or early.
        period_s = float(np.median(np.diff(stamps_s)))
        assert period_s == pytest.approx(1 / FPS, rel=0.2), "cameras of another rate, or a machine far too busy"
    assert max(abs(pair.skew_s) for pair in pairs) <= 0.5 / FPS
    assert all(pair.left.shape == pair.right.shape == SIZE_PX[::-1] for pair in pairs)
    assert min(pair.left.mean() for pair in pairs) > 180 and max(pair.right.mean() for pair in pairs) < 80


def test_pictures_farther_apart_than_the_bound_are_counted_and_are_the_problem(spec: str) -> None:
    # Nothing synchronises the two: a microsecond's luck comes seldom.
    with open_cameras(spec, size_px=SIZE_PX, max_skew_s=1e-6, lock=False) as cameras:
        mailbox = cameras.subscribe(200)
        wait_until(lambda: cameras.counts.skewed > 10, "pictures that are no pairs", PATIENCE_S)
        wait_until(lambda: "ms apart" in cameras.problem(), "the problem", PATIENCE_S)
        assert cameras.counts.pairs < cameras.counts.skewed
    while (pair := mailbox.get(0.0)) is not None:
        assert abs(pair.skew_s) <= 1e-6


def test_swapped_cameras_are_swapped(spec: str) -> None:
    with open_cameras(spec, size_px=SIZE_PX, swap=True, lock=False) as cameras:
        (pair,) = taken(cameras.subscribe(1), 1)
    assert pair.left.mean() < 80 and pair.right.mean() > 180


def test_both_cameras_get_the_first_ones_values_without_automatics_and_again_after_a_replug(
    vivid: Vivid, spec: str
) -> None:
    set_controls(vivid.left, brightness=100)
    set_controls(vivid.right, brightness=160)
    locked = {"gain_automatic": 0, "brightness": 100}

    def values(node: str) -> dict[str, int]:
        return controls(node, *locked)

    assert values(vivid.left) != locked and values(vivid.right) != locked
    with open_cameras(spec, size_px=SIZE_PX) as cameras:
        mailbox = cameras.subscribe(1)
        assert values(vivid.left) == values(vivid.right) == locked
        # Plugged in again, a camera has its default values, 1 and 128.
        vivid.unplug()
        vivid.plug()
        # A camera's values are set before its pictures come.
        taken_after(now_s(), mailbox)
        assert values(vivid.left) == values(vivid.right) == locked


def test_a_camera_that_is_cut_off_for_a_moment_comes_back_without_a_restart(vivid: Vivid, running: Running) -> None:
    cameras, mailbox = running
    taken(mailbox, 3)
    # vivid's cable: cut until who reads the camera lets it go.
    set_controls(vivid.right, disconnect=1)
    wait_until(lambda: cameras.counts.lost > 0, "the loss", PATIENCE_S)
    taken_after(now_s(), mailbox)
    no_problem(cameras)


def test_unplugged_cameras_are_named_and_no_pairs_come_until_they_are_back(vivid: Vivid, running: Running) -> None:
    cameras, mailbox = running
    taken(mailbox, 3)
    vivid.unplug()
    unplugged_s = now_s()
    wait_until(lambda: cameras.problem() != "", "the problem", 5.0)
    time.sleep(2.0)
    assert cameras.last_stamp_s() < unplugged_s
    said = cameras.problem()
    assert f"the left camera {vivid.left}" in said and "is gone" in said and "\n" not in said
    vivid.plug()
    pair = taken_after(now_s(), mailbox)
    assert pair.left.mean() > 180 and pair.right.mean() < 80
    assert cameras.counts.lost >= 2
    no_problem(cameras)


def test_a_camera_that_comes_back_under_another_node_is_still_the_same_eye(vivid: Vivid, running: Running) -> None:
    _, mailbox = running
    taken(mailbox, 3)
    # Who has a node open keeps its number.
    with Path(vivid.left).open("rb", buffering=0):
        vivid.unplug()
        old = vivid.left, vivid.right
        vivid.plug()
    assert (vivid.left, vivid.right) != old
    pair = taken_after(now_s(), mailbox)
    assert pair.left.mean() > 180 and pair.right.mean() < 80


def test_a_camera_that_streams_nothing_is_named_and_its_pairs_come_again(vivid: Vivid, running: Running) -> None:
    cameras, mailbox = running
    taken(mailbox, 3)
    set_controls(vivid.right, percentage_of_dropped_buffers=100)
    wait_until(lambda: "the right camera" in cameras.problem(), "the problem", PATIENCE_S)
    silent_s = now_s()
    time.sleep(1.0)
    assert cameras.last_stamp_s() < silent_s
    set_controls(vivid.right, percentage_of_dropped_buffers=0)
    taken_after(silent_s, mailbox)
    no_problem(cameras)


def test_losses_and_replugs_leave_no_file_and_no_thread_behind(vivid: Vivid, running: Running) -> None:
    cameras, mailbox = running

    def open_now() -> tuple[int, int]:
        return len(list(Path("/proc/self/fd").iterdir())), threading.active_count()

    taken(mailbox, 3)
    before = open_now()
    for _ in range(3):
        set_controls(vivid.left, disconnect=1)
        taken_after(now_s(), mailbox)
        vivid.unplug()
        vivid.plug()
        taken_after(now_s(), mailbox)
    assert open_now() == before
    # Unplugged, they can be let go at once.
    vivid.unplug()
    wait_until(lambda: cameras.problem() != "", "the problem", 5.0)
    began_s = now_s()
    cameras.close()
    assert now_s() - began_s < 2.0
    assert threading.active_count() < before[1]
