"""Web servers for tests of cameras: pictures at a rate, servers that come and go, servers that do as a script says."""

import contextlib
import socket
import threading
import time
from collections.abc import Callable, Iterator

import cv2
import numpy as np

from stereogrid.mjpeg import MjpegServer, jpeg
from stereogrid.observation import Image

Script = Callable[[socket.socket, bytes], None]
STREAM_HEAD = b"HTTP/1.1 200 OK\r\nContent-Type: multipart/x-mixed-replace; boundary=frame\r\n\r\n"


def numbered(k: int, side: int = 0, size_px: tuple[int, int] = (64, 48)) -> Image:
    """A picture with a number that survives JPEG; see `number`."""
    image = np.full((size_px[1], size_px[0]), 40 + 60 * side, np.uint8)
    for bit in range(8):
        image[:, bit * 8 : bit * 8 + 8] += np.uint8(100 * (k >> bit & 1))
    return image


def number(image: Image) -> int:
    """k of `numbered`, modulo 256."""
    means = image[:, :64].reshape(image.shape[0], 8, 8).mean(axis=(0, 2))
    return sum(1 << bit for bit in range(8) if means[bit] > means.min() + 50)


def part(data: bytes, *headers: str, length: bool = True) -> bytes:
    """One part of a stream."""
    lines = ["--frame", "Content-Type: image/jpeg", *headers]
    if length:
        lines.append(f"Content-Length: {len(data)}")
    return "\r\n".join([*lines, "", ""]).encode() + data + b"\r\n"


@contextlib.contextmanager
def publishing(server: MjpegServer, fps: float = 60.0, *, repeat: threading.Event | None = None) -> Iterator[None]:
    """Numbered pairs at a rate, in a thread, until the end or while `repeat` is not set."""
    stop = threading.Event()

    def run() -> None:
        k = 0
        while not stop.wait(1 / fps):
            if repeat is None or not repeat.is_set():
                k += 1
                server.publish(jpeg(numbered(k)), jpeg(numbered(k, 1)), time.monotonic())

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join()


class ScriptedServer:
    """Listens on the loopback; `script(connection, request)` serves each connection, in a thread. A context manager.

    port: the one of an earlier server that has gone, else any.
    """

    def __init__(self, script: Script, port: int = 0) -> None:
        self.script = script
        self.requests: list[bytes] = []
        self._listener = socket.create_server(("127.0.0.1", port))
        self.port: int = self._listener.getsockname()[1]
        self._connections: list[socket.socket] = []
        threading.Thread(target=self._listen, daemon=True).start()

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.port}/"

    def __enter__(self) -> "ScriptedServer":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Cut all connections; nobody listens any more."""
        with contextlib.suppress(OSError):
            self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()
        for connection in self._connections:
            with contextlib.suppress(OSError):
                connection.shutdown(socket.SHUT_RDWR)

    def _listen(self) -> None:
        while True:
            try:
                connection, _ = self._listener.accept()
            except OSError:
                return
            self._connections.append(connection)
            threading.Thread(target=self._serve, args=(connection,), daemon=True).start()

    def _serve(self, connection: socket.socket) -> None:
        with connection, contextlib.suppress(OSError):
            request = b""
            while b"\r\n\r\n" not in request:
                more = connection.recv(4096)
                if not more:
                    return
                request += more
            self.requests.append(request)
            self.script(connection, request)


def streaming(
    fps: float = 60.0,
    *,
    stamps: bool = True,
    length: bool = True,
    delay_s: float = 0.0,
    size_px: tuple[int, int] = (64, 48),
) -> Script:
    """A script: numbered pictures at a rate, the right ones delay_s later, and no page but left.mjpg and right.mjpg."""

    def script(connection: socket.socket, request: bytes) -> None:
        path = request.split()[1]
        if path not in (b"/left.mjpg", b"/right.mjpg"):
            connection.sendall(b"HTTP/1.1 404 Not Found\r\n\r\n")
            return
        side = int(path == b"/right.mjpg")
        connection.sendall(STREAM_HEAD)
        while True:
            k = int(time.monotonic() * fps) + 1
            stamp_s = k / fps + side * delay_s
            time.sleep(max(0.0, stamp_s - time.monotonic()))
            headers = [f"X-Timestamp: {stamp_s:.6f}"] if stamps else []
            connection.sendall(part(jpeg(numbered(k, side, size_px)), *headers, length=length))

    return script


def always(answer: bytes, then: bytes = b"", pause_s: float = 0.0) -> Script:
    """A script: this answer, then `then` again and again."""

    def script(connection: socket.socket, request: bytes) -> None:
        connection.sendall(answer)
        while then:
            connection.sendall(then)
            time.sleep(pause_s)

    return script


def bomb() -> bytes:
    """A JPEG of some hundred bytes that claims to be 65500 x 65500 pixels."""
    small = bytes(cv2.imencode(".jpg", np.zeros((8, 8), np.uint8))[1])
    at = small.index(b"\xff\xc0") + 5
    return small[:at] + (65500).to_bytes(2, "big") * 2 + small[at + 4 :]
