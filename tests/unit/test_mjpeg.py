"""The cameras' web server: what it serves, to whom, and that no client holds up another."""

import json
import re
import socket
import threading
from collections.abc import Iterator
from http.client import HTTPConnection

import cv2
import numpy as np
import pytest

from stereogrid.errors import InvalidInputError
from stereogrid.loopback import is_foreign
from stereogrid.mjpeg import BOUNDARY, MOST_CLIENTS, MjpegServer

CALIBRATION = {"focal_px": 417.0, "T_base_cam": [[1.0, 0.0], [0.0, 1.0]]}


def jpeg(gray: int) -> bytes:
    return bytes(cv2.imencode(".jpg", np.full((48, 64), gray, np.uint8))[1])


@pytest.fixture
def server() -> Iterator[MjpegServer]:
    with MjpegServer(0, CALIBRATION) as served:
        yield served


def get(
    server: MjpegServer, path: str, method: str = "GET", host: str | None = None
) -> tuple[int, dict[str, str], bytes]:
    connection = HTTPConnection("127.0.0.1", server.port, timeout=20)
    connection.request(method, path, headers={"Host": host} if host is not None else {})
    response = connection.getresponse()
    body = response.read()
    connection.close()
    return response.status, dict(response.getheaders()), body


def open_stream(server: MjpegServer, path: str) -> socket.socket:
    stream = socket.create_connection(("127.0.0.1", server.port), timeout=20)
    stream.sendall(f"GET {path} HTTP/1.0\r\nHost: localhost\r\n\r\n".encode())
    return stream


def test_a_picture_is_the_newest_one_with_its_time(server: MjpegServer) -> None:
    for k in range(3):
        server.publish(jpeg(50 + k), jpeg(150 + k), 10.5 + k)
    for path, gray in (("/left.jpg", 52), ("/right.jpg", 152)):
        status, headers, body = get(server, path)
        assert (status, headers["Content-Type"], headers["X-Timestamp"]) == (200, "image/jpeg", "12.500000")
        assert body == jpeg(gray)


def test_a_stream_sends_every_pair_to_a_reader_that_keeps_up_each_with_length_and_time(server: MjpegServer) -> None:
    with open_stream(server, "/left.mjpg") as stream, stream.makefile("rb") as lines:
        head = b"".join(iter(lines.readline, b"\r\n"))
        assert f"multipart/x-mixed-replace; boundary={BOUNDARY}".encode() in head
        for k in range(5):
            server.publish(jpeg(10 * k), jpeg(0), 1.0 + k)
            part = b"".join(iter(lines.readline, b"\r\n"))
            assert part.startswith(f"--{BOUNDARY}\r\n".encode())
            length = re.search(rb"Content-Length: (\d+)", part)
            assert length is not None and f"X-Timestamp: {1 + k}.000000".encode() in part
            assert lines.read(int(length[1])) == jpeg(10 * k)
            assert lines.readline() == b"\r\n"


def test_opencv_reads_the_stream(server: MjpegServer) -> None:
    stop = threading.Event()

    def publish() -> None:
        k = 0
        while not stop.wait(0.02):
            k += 1
            server.publish(jpeg(k % 200), jpeg(200), float(k))

    thread = threading.Thread(target=publish)
    thread.start()
    try:
        capture = cv2.VideoCapture(f"{server.url}right.mjpg", cv2.CAP_FFMPEG)
        pictures = [capture.read() for _ in range(10)]
        capture.release()
    finally:
        stop.set()
        thread.join()
    assert all(good and picture.shape == (48, 64, 3) for good, picture in pictures)
    assert all(abs(float(picture.mean()) - 200) < 2 for _, picture in pictures)


def test_a_client_that_does_not_read_and_one_that_does_not_ask_hold_up_nobody(server: MjpegServer) -> None:
    large = bytes(cv2.imencode(".jpg", np.random.default_rng(1).integers(0, 255, (1000, 1000), np.uint8))[1])
    server.publish(large, large, 0.0)
    with open_stream(server, "/left.mjpg"), socket.create_connection(("127.0.0.1", server.port), timeout=20) as silent:
        silent.sendall(b"GET /left.jp")
        for k in range(40):
            server.publish(large, large, float(k))
        assert get(server, "/left.jpg")[1]["X-Timestamp"] == "39.000000"


def test_there_is_an_end_to_the_number_of_clients_and_a_place_again_when_one_goes(server: MjpegServer) -> None:
    server.publish(jpeg(1), jpeg(1), 0.0)
    streams = [open_stream(server, "/left.mjpg") for _ in range(MOST_CLIENTS)]
    for stream in streams:
        assert stream.recv(1) == b"H"
    with open_stream(server, "/left.mjpg") as refused:
        assert refused.recv(1) == b""
    for stream in streams:
        stream.close()
    for _ in range(200):
        # Threads notice that their clients are gone when they send the next picture.
        server.publish(jpeg(2), jpeg(2), 1.0)
        try:
            assert get(server, "/camera.json")[0] == 200
            break
        except ConnectionError:
            continue
    else:
        pytest.fail("no place became free")


def test_the_calibration_and_the_index_are_served(server: MjpegServer) -> None:
    status, headers, body = get(server, "/camera.json?now")
    assert (status, headers["Content-Type"], json.loads(body)) == (200, "application/json", CALIBRATION)
    assert b"/left.mjpg" in get(server, "/")[2] and b"/right.mjpg" in get(server, "/")[2]


@pytest.mark.parametrize("path", ["/none", "/../left.jpg", "/left.jpgx"])
def test_nothing_else_is_served(server: MjpegServer, path: str) -> None:
    server.publish(jpeg(1), jpeg(1), 0.0)
    assert get(server, path)[0] == 404


@pytest.mark.parametrize("host", ["evil.example", "evil.example:80", "127.0.0.1.evil.example", "", "localhost.", "::1"])
def test_pages_of_other_sites_cannot_look_through_the_cameras(server: MjpegServer, host: str) -> None:
    assert get(server, "/left.jpg", host=host)[0] == 403


@pytest.mark.parametrize("host", ["localhost", "LOCALHOST:8102", "127.0.0.1:1", "[::1]:8102", "[::1]"])
def test_names_of_the_loopback_are_welcome(server: MjpegServer, host: str) -> None:
    assert get(server, "/camera.json", host=host)[0] == 200


def press(server: MjpegServer, path: str, origin: str | None, host: str | None = None) -> int:
    connection = HTTPConnection("127.0.0.1", server.port, timeout=20)
    headers = {"Host": host or f"127.0.0.1:{server.port}"} | ({} if origin is None else {"Origin": origin})
    connection.request("POST", path, headers=headers)
    status = connection.getresponse().status
    connection.close()
    return status


def test_a_status_is_asked_for_each_time_and_buttons_are_pressed_by_the_page_alone() -> None:
    pressed: list[str] = []
    with MjpegServer(0, {}, status=lambda: {"n": len(pressed)}, buttons={"go": lambda: pressed.append("go")}) as server:
        ours = f"http://127.0.0.1:{server.port}"
        assert json.loads(get(server, "/status.json")[2]) == {"n": 0}
        assert press(server, "/go", ours) == 204
        assert press(server, "/go", f"http://LOCALHOST:{server.port}", f"localhost:{server.port}") == 204
        assert json.loads(get(server, "/status.json")[2]) == {"n": 2}
        assert press(server, "/stop", ours) == 404
        for origin in ("http://evil.example", "null", None, "", f"https://127.0.0.1:{server.port}", "http://127.0.0.1"):
            assert press(server, "/go", origin) == 403
        # A name of theirs that leads here: host and origin agree, and are foreign.
        assert press(server, "/go", "http://evil.example", "evil.example") == 403
        assert get(server, "/go")[0] == 404
    assert pressed == ["go", "go"]


def test_without_a_status_there_is_none(server: MjpegServer) -> None:
    assert get(server, "/status.json")[0] == 404


@pytest.mark.parametrize("method", ["POST", "PUT", "DELETE", "HEAD", "OPTIONS"])
def test_only_get_is_answered(server: MjpegServer, method: str) -> None:
    assert get(server, "/camera.json", method=method)[0] == 501


def test_a_port_in_use_is_named(server: MjpegServer) -> None:
    with pytest.raises(InvalidInputError, match=f"pictures' port {server.port} cannot be had"):
        MjpegServer(server.port, {})


@pytest.mark.parametrize(
    ("headers", "foreign"),
    [
        ({"Host": "localhost:8103"}, False),
        ({"Host": "[::1]:8103", "Origin": "http://[::1]:8103"}, False),
        ({"Host": "127.0.0.1.evil.example:8103"}, True),
        ({"Host": "localhost:8103", "Origin": "http://localhost:8104"}, True),
        ({}, True),
    ],
)
def test_a_foreign_host_or_origin_is_known(headers: dict[str, str], foreign: bool) -> None:
    assert is_foreign(headers.get("Host"), headers.get("Origin")) is foreign


def test_a_page_of_another_site_that_asks_for_a_picture_is_refused(server: MjpegServer) -> None:
    server.publish(jpeg(50), jpeg(150), 1.0)
    own = f"127.0.0.1:{server.port}"
    for origin, expected in ((f"http://{own}", 200), ("http://evil.example", 403), ("null", 403)):
        connection = HTTPConnection("127.0.0.1", server.port, timeout=20)
        connection.request("GET", "/left.jpg", headers={"Host": own, "Origin": origin})
        assert connection.getresponse().status == expected
        connection.close()
