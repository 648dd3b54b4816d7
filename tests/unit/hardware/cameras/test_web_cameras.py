"""Cameras on web servers: real ones on the loopback, those that come and go, and hostile ones."""

import json
import socket
import threading
import time
import tracemalloc
from collections.abc import Callable, Iterator

import pytest
from picture_servers import (
    STREAM_HEAD,
    Script,
    ScriptedServer,
    always,
    bomb,
    number,
    numbered,
    part,
    publishing,
    streaming,
)

from hardware.cameras import RawPair, StereoPairs, open_cameras
from hardware.cameras import http as web
from hardware.cameras.multipart import MOST_PICTURE
from hardware.cameras.reader import LOST_AFTER_S, REOPEN_AFTER_S
from hardware.errors import CameraError
from hardware.mailbox import Mailbox
from stereogrid.errors import InvalidInputError
from stereogrid.mjpeg import MjpegServer, jpeg

CALIBRATION = {"focal_px": 417.0, "T_base_cam": [[1.0, 0.0], [0.0, 1.0]]}
PATIENCE_S = 15.0


def take(mailbox: Mailbox[RawPair], count: int) -> list[RawPair]:
    pairs = [mailbox.get(PATIENCE_S) for _ in range(count)]
    found = [pair for pair in pairs if pair is not None]
    assert len(found) == count, "pairs must come"
    return found


def eventually(law: Callable[[], bool], what: str) -> float:
    """Seconds until it holds."""
    start_s = time.monotonic()
    while not law():
        assert time.monotonic() - start_s < PATIENCE_S, what
        time.sleep(0.01)
    return time.monotonic() - start_s


@pytest.fixture
def server() -> Iterator[MjpegServer]:
    with MjpegServer(0, CALIBRATION) as served:
        yield served


def test_pairs_come_whole_with_the_moment_they_were_taken_and_the_calibration(server: MjpegServer) -> None:
    with publishing(server), open_cameras(server.url) as cameras:
        pairs = take(cameras.subscribe(most=64), 20)
        now_s = time.monotonic()
        assert cameras.size_px == (64, 48) and cameras.about["camera.json"] == CALIBRATION
        assert cameras.about["left"]["stamps"] == "monotonic" and cameras.problem() == ""
        assert cameras.last_stamp_s() is not None
    for pair in pairs:
        assert number(pair.left) == number(pair.right) and pair.left.mean() < pair.right.mean() - 20
        assert pair.skew_s == 0.0 and 0 <= now_s - pair.stamp_s < PATIENCE_S
    stamps_s = [pair.stamp_s for pair in pairs]
    assert stamps_s == sorted(set(stamps_s))


def test_swapped_the_left_picture_is_the_right_one(server: MjpegServer) -> None:
    with publishing(server), open_cameras(server.url, swap=True) as cameras:
        (pair,) = take(cameras.subscribe(), 1)
    assert pair.left.mean() > pair.right.mean() + 20


@pytest.mark.parametrize("length", [True, False])
def test_two_addresses_with_or_without_lengths_are_two_cameras(length: bool) -> None:
    script = streaming(length=length)
    with ScriptedServer(script) as first, ScriptedServer(script) as second:
        spec = f"{first.url}left.mjpg,{second.url}right.mjpg"
        with open_cameras(spec) as cameras:
            pairs = take(cameras.subscribe(), 10)
    assert all(number(pair.left) == number(pair.right) for pair in pairs)


def test_without_stamps_a_picture_was_taken_when_it_came() -> None:
    with ScriptedServer(streaming(fps=20, stamps=False)) as server, open_cameras(server.url, fps=20) as cameras:
        (pair,) = take(cameras.subscribe(), 1)
        assert cameras.about["right"]["stamps"] == "arrival"
        assert abs(time.monotonic() - pair.stamp_s) < PATIENCE_S


def test_a_stream_in_chunks_without_any_type_is_read_as_ffmpeg_sends_it() -> None:
    def script(connection: socket.socket, request: bytes) -> None:
        side = int(b"right" in request)
        connection.sendall(b"HTTP/1.1 200 OK\r\nContent-Type: application/octet-stream\r\n")
        connection.sendall(b"Transfer-Encoding: chunked\r\n\r\n")
        while True:
            k = int(time.monotonic() * 30) + 1
            time.sleep(max(0.0, k / 30 - time.monotonic()))
            data = part(jpeg(numbered(k, side)), f"X-Timestamp: {k / 30:.6f}")
            for piece in (data[:100], data[100:101], data[101:]):
                connection.sendall(b"%x\r\n" % len(piece) + piece + b"\r\n")

    with ScriptedServer(script) as server, open_cameras(server.url) as cameras:
        for pair in take(cameras.subscribe(), 5):
            assert number(pair.left) == number(pair.right) and pair.skew_s == 0.0


def test_pairs_beyond_the_bound_are_dropped_counted_and_said() -> None:
    with (
        ScriptedServer(streaming(fps=25, delay_s=0.015)) as server,
        open_cameras(server.url, fps=25, max_skew_s=0.005) as cameras,
    ):
        mailbox = cameras.subscribe()
        eventually(lambda: cameras.counts.skewed > 10, "skewed pairs are counted")
        eventually(lambda: "15.0 ms apart" in cameras.problem(), "the problem is said")
        assert cameras.counts.pairs == 0 and len(mailbox) == 0 and "5.0 ms" in cameras.problem()


def test_while_the_robot_turns_the_bound_is_stricter() -> None:
    turn_radps = [0.0]
    with (
        ScriptedServer(streaming(fps=25, delay_s=0.015)) as server,
        open_cameras(server.url, fps=25, focal_px=300.0, turn_radps=lambda: turn_radps[0]) as cameras,
    ):
        take(cameras.subscribe(), 3)
        turn_radps[0] = -0.5
        before = cameras.counts.skewed
        eventually(lambda: cameras.counts.skewed > before + 5, "smeared pairs are dropped")


def test_a_turn_that_cannot_be_asked_is_a_problem_until_it_can(server: MjpegServer) -> None:
    turns = [0.0]

    def turn_radps() -> float:
        return turns[0]

    with publishing(server), open_cameras(server.url, turn_radps=turn_radps) as cameras:
        mailbox = cameras.subscribe()
        take(mailbox, 2)
        turns.clear()
        eventually(lambda: "IndexError" in cameras.problem(), "the problem is said")
        turns.append(0.0)
        mailbox.newest(0.0)
        take(mailbox, 2)
        assert cameras.problem() == ""


def test_a_server_that_goes_is_a_problem_within_half_a_second_and_is_found_again_when_it_comes_back() -> None:
    server = ScriptedServer(streaming())
    with open_cameras(server.url) as cameras:
        mailbox = cameras.subscribe()
        take(mailbox, 3)
        server.close()
        late_s = eventually(lambda: cameras.problem() != "", "a cut server is a problem")
        assert late_s < LOST_AFTER_S + 0.5, "the machine is late, or the cut is not seen"
        eventually(lambda: "127.0.0.1" in cameras.problem() and cameras.counts.lost == 2, "the loss is counted")
        with ScriptedServer(streaming(), port=server.port):
            eventually(lambda: cameras.problem() == "", "a server that comes back is read again")
            mailbox.newest(PATIENCE_S)
            pair = take(mailbox, 1)[0]
            assert number(pair.left) == number(pair.right) and time.monotonic() - pair.stamp_s < PATIENCE_S
            assert cameras.counts.lost == 2


@pytest.mark.parametrize("stamped", [True, False])
def test_a_camera_that_repeats_its_last_picture_is_lost(stamped: bool) -> None:
    hangs = threading.Event()

    def script(connection: socket.socket, request: bytes) -> None:
        side = int(b"right" in request)
        connection.sendall(STREAM_HEAD)
        k, stamp_s = 0, 0.0
        while True:
            if not (hangs.is_set() and side):
                k = int(time.monotonic() * 60) + 1
                stamp_s = k / 60
                time.sleep(max(0.0, stamp_s - time.monotonic()))
            else:
                time.sleep(1 / 60)
            headers = [f"X-Timestamp: {stamp_s:.6f}"] if stamped else []
            connection.sendall(part(jpeg(numbered(k, side)), *headers))

    with ScriptedServer(script) as server, open_cameras(server.url) as cameras:
        take(cameras.subscribe(), 40)
        hangs.set()
        eventually(lambda: cameras.counts.lost > 0, "a camera that hangs is lost")
        assert "right" in cameras.problem() and "nothing new" in cameras.problem()
        time.sleep(0.5)
        assert cameras.counts.lost == 1, "a loss is counted once"


def test_a_connection_that_falls_silent_is_made_anew() -> None:
    silent: set[bytes] = set()

    def script(connection: socket.socket, request: bytes) -> None:
        path = request.split()[1]
        if path in silent:
            streaming()(connection, request)
        silent.add(path)
        connection.sendall(STREAM_HEAD + part(jpeg(numbered(1)), f"X-Timestamp: {time.monotonic():.6f}"))
        time.sleep(10 * PATIENCE_S)

    with ScriptedServer(script) as server, open_cameras(server.url) as cameras:
        mailbox = cameras.subscribe()
        eventually(lambda: cameras.counts.lost == 2, "silent cameras are lost")
        taken = take(mailbox, 3)
        assert number(taken[-1].left) == number(taken[-1].right)
        eventually(lambda: cameras.problem() == "", "they are back")


def test_a_still_scene_without_noise_is_no_camera_that_hangs(server: MjpegServer) -> None:
    still = jpeg(numbered(1))
    stop = threading.Event()

    def publish() -> None:
        k = 0
        while not stop.wait(1 / 60):
            k += 1
            picture = jpeg(numbered(k)) if k < 60 else still
            server.publish(picture, picture, time.monotonic())

    thread = threading.Thread(target=publish)
    thread.start()
    try:
        with open_cameras(server.url) as cameras:
            mailbox = cameras.subscribe(most=256)
            eventually(lambda: cameras.counts.pairs > 60 + 2 * LOST_AFTER_S * 60, "pairs of a still scene come")
            assert cameras.counts.lost == 0 and cameras.problem() == "" and len(mailbox) > 100
    finally:
        stop.set()
        thread.join()


def test_a_picture_that_cannot_be_read_is_counted_and_the_next_one_is_taken() -> None:
    def script(connection: socket.socket, request: bytes) -> None:
        side = int(b"right" in request)
        connection.sendall(STREAM_HEAD)
        first = int(time.monotonic() * 30) + 5
        while True:
            k = int(time.monotonic() * 30) + 1
            time.sleep(max(0.0, k / 30 - time.monotonic()))
            bad = [bomb(), jpeg(numbered(k))[:-30], jpeg(numbered(k, size_px=(80, 48))), b"<html>"]
            data = bad[k // 2 % 4] if side and k % 2 and k > first else jpeg(numbered(k, side))
            connection.sendall(part(data, f"X-Timestamp: {k / 30:.6f}"))

    with ScriptedServer(script) as server, open_cameras(server.url) as cameras:
        pairs = take(cameras.subscribe(), 10)
        eventually(lambda: cameras.counts.broken >= 5, "unreadable pictures are counted")
    assert {(pair.left.shape, pair.right.shape) for pair in pairs} == {((48, 64), (48, 64))}
    assert all(number(pair.left) == number(pair.right) for pair in pairs)


HTML = b"HTTP/1.1 200 OK\r\nContent-Type: text/html\r\n\r\n<html></html>"
REFUSALS: list[tuple[Script, str]] = [
    (always(b"HTTP/1.1 404 Not Found\r\n\r\n"), "answers 404 Not Found"),
    (always(b"HTTP/1.1 302 Found\r\nLocation: http://elsewhere/\r\n\r\n"), "answers 302"),
    (always(b"HTTP/1.1 401 Unauthorized\r\n\r\n"), "wants a password"),
    (always(HTML), "text/html, no MJPEG"),
    (always(b"SSH-2.0-OpenSSH_9.2\r\n\r\n"), "no web server"),
    (always(b"HTTP/1.1 200 OK\r\n", b"X-More: 1\r\n" * 500), "bytes of headers"),
    (always(b"HTTP/1.1 200 OK\r\n" + b"X: 1\r\n" * 200 + b"\r\n"), "headers that cannot be read"),
    (always(b""), "ends in the middle"),
    (always(b"HTTP/1.1 200 OK\r\n\r\n<html>\r\n"), "no multipart stream"),
    (always(STREAM_HEAD, b"junk without any boundary " * 100), "no boundary"),
    (always(STREAM_HEAD + b"--frame\r\n", b"X-More: 1\r\n" * 500), "headers of a picture"),
    (always(STREAM_HEAD + b"--frame\r\nContent-Length: 4000000000\r\n\r\n", bytes(65536)), "claims 4000000000 bytes"),
    (always(STREAM_HEAD + b"--frame\r\n\r\n", bytes(1 << 20)), "longer than"),
    (always(STREAM_HEAD.replace(b"\r\n\r\n", b"\r\nTransfer-Encoding: chunked\r\n\r\n") + b"zz\r\n\r\n"), "size b'zz'"),
]


@pytest.mark.parametrize(("script", "said"), REFUSALS, ids=[said for _, said in REFUSALS])
def test_what_is_no_camera_is_refused_with_the_reason_and_without_growing(script: Script, said: str) -> None:
    tracemalloc.start()
    try:
        with ScriptedServer(script) as server, pytest.raises(CameraError, match=said):
            open_cameras(server.url)
        _, most = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert most < 6 * MOST_PICTURE


def test_a_server_that_sends_nothing_or_drop_by_drop_holds_nobody_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(web, "PATIENCE_S", 0.5)
    for script in (lambda connection, request: time.sleep(5), always(b"", b"H", 0.05)):
        with ScriptedServer(script) as server:
            start_s = time.monotonic()
            with pytest.raises(CameraError, match=r"not (answer|answered)|timed out"):
                open_cameras(server.url)
            assert time.monotonic() - start_s < PATIENCE_S


def test_a_stream_without_pictures_is_left_after_a_while() -> None:
    with ScriptedServer(always(STREAM_HEAD, b"-", 0.05)) as server:
        start_s = time.monotonic()
        with pytest.raises(CameraError, match="nothing new"):
            open_cameras(server.url)
        assert time.monotonic() - start_s < REOPEN_AFTER_S + PATIENCE_S


def test_pictures_of_nothing_but_bombs_open_no_cameras(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hardware.cameras.live.START_S", 1.0)
    stream = always(STREAM_HEAD, part(bomb()), 0.02)
    with ScriptedServer(stream) as server, pytest.raises(CameraError, match="65500x65500"):
        open_cameras(server.url)


def test_two_sizes_are_no_pair() -> None:
    def script(connection: socket.socket, request: bytes) -> None:
        size_px = (80, 48) if b"right" in request else (64, 48)
        always(STREAM_HEAD, part(jpeg(numbered(1, size_px=size_px))), 0.02)(connection, request)

    with (
        ScriptedServer(script) as server,
        pytest.raises(CameraError, match=r"64x48.*80x48: both must have the same size"),
    ):
        open_cameras(server.url)


def test_nobody_there_is_one_line_with_the_address() -> None:
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    with pytest.raises(CameraError, match=rf"http://127.0.0.1:{port}/left.mjpg cannot be reached"):
        open_cameras(f"http://127.0.0.1:{port}/")


def test_a_password_is_sent_and_never_said() -> None:
    with ScriptedServer(streaming()) as server:
        spec = server.url.replace("http://", "http://robot:s%40cret@")
        with open_cameras(spec) as cameras:
            take(cameras.subscribe(), 1)
            assert "cret" not in cameras.name + json.dumps(cameras.about)
        assert all(b"Authorization: Basic cm9ib3Q6c0BjcmV0\r\n" in request for request in server.requests)


@pytest.mark.parametrize(
    ("spec", "said"),
    [
        ("", "names no two cameras"),
        ("minru", "names no two cameras"),
        ("/dev/video0", "names no two cameras"),
        ("a,b,c", "names no two cameras"),
        ("https://127.0.0.1/", "use http://"),
        ("http://", "no URL of a camera"),
        ("http://host:99999/", "no URL"),
        ("http://a b/", "no URL of a camera"),
        ("http://h/\r\nX: y", "no URL of a camera"),
    ],
)
def test_a_spec_of_no_known_form_is_refused_with_the_forms(spec: str, said: str) -> None:
    with pytest.raises(InvalidInputError, match=said):
        open_cameras(spec)


@pytest.mark.parametrize(
    "wrong",
    [{"fps": 0.0}, {"fps": float("nan")}, {"size_px": (0, 240)}, {"max_skew_s": -1.0}, {"fourcc": "MJPEG"}],
)
def test_wishes_that_cannot_be_are_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(InvalidInputError):
        open_cameras("minoru", **wrong)  # type: ignore[arg-type]


def test_closed_cameras_close_their_mailboxes_and_end_their_threads(server: MjpegServer) -> None:
    with publishing(server):
        cameras: StereoPairs = open_cameras(server.url)
        mailbox = cameras.subscribe(most=1)
        take(mailbox, 1)
        start_s = time.monotonic()
        cameras.close()
        cameras.close()
        assert time.monotonic() - start_s < 2.0
        mailbox.newest(0.0)
        assert mailbox.closed and mailbox.get(PATIENCE_S) is None
        late = cameras.subscribe()
        assert late.closed and late.get(PATIENCE_S) is None
    names = {thread.name for thread in threading.enumerate()}
    assert not any("camera" in name or name == "pairing" for name in names), names
