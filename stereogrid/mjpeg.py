"""Two cameras on a web server of this machine's loopback, as cheap network cameras do it: MJPEG over HTTP."""

import json
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from socketserver import TCPServer
from types import TracebackType
from typing import Any, cast

import cv2
import numpy as np
from numpy.typing import NDArray

from .errors import InvalidInputError
from .loopback import HOST, is_foreign

BOUNDARY = "frame"
PATIENCE_S = 10.0
"""A client that neither asks nor reads for this long is let go."""
MOST_CLIENTS = 16
JPEG_QUALITY = 90
_INDEX = b"""<!doctype html><meta charset="utf-8"><title>stereogrid</title>
<h1>The robot's two cameras</h1>
<p><img src="/left.mjpg" alt="left"> <img src="/right.mjpg" alt="right"></p>
<p><a href="/left.jpg">left.jpg</a> <a href="/right.jpg">right.jpg</a> <a href="/camera.json">camera.json</a></p>
"""


def jpeg(image: NDArray[np.uint8]) -> bytes:
    """A JPEG file of an image (H, W) or (H, W, 3) BGR, uint8."""
    _, encoded = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    return bytes(encoded)


@dataclass(frozen=True)
class Pair:
    """Two pictures as JPEG files, taken at the same moment: stamp_s on the clock of time.monotonic().

    others: further pictures of that moment, by name.
    """

    left: bytes
    right: bytes
    stamp_s: float
    others: Mapping[str, bytes] = field(default_factory=dict)

    def picture(self, name: str) -> bytes:
        """The picture of that name."""
        return {"left": self.left, "right": self.right, **self.others}[name]


class Newest:
    """The newest pair, for any number of readers: each takes it when it can, and misses what came in between."""

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._pair: Pair | None = None
        self._number = 0

    def publish(self, pair: Pair) -> None:
        """Put a pair in the place of the last one."""
        with self._changed:
            self._pair = pair
            self._number += 1
            self._changed.notify_all()

    def after(self, number: int) -> tuple[int, Pair] | None:
        """The newest pair and its number (from 1 on), once that is higher than `number`; None after PATIENCE_S."""
        with self._changed:
            self._changed.wait_for(lambda: self._number > number, PATIENCE_S)
            if self._pair is None or self._number <= number:
                return None
            return self._number, self._pair


class MjpegServer:
    """Serves /left.mjpg, /right.mjpg, /left.jpg, /right.jpg, /camera.json and an index page, each client in a thread.

    port 0: any that is free. calibration: what /camera.json says. page: the index page. others: names of further
    pictures, which are served alike. status: what /status.json says, asked for each time. buttons: what a POST to
    /<name> by a page of this server does; both are called in threads of the clients.
    Use as a context manager; `publish` never waits for a client. Raises InvalidInputError when the port is in use.
    """

    def __init__(
        self,
        port: int,
        calibration: Mapping[str, Any],
        *,
        page: bytes = _INDEX,
        others: tuple[str, ...] = (),
        status: Callable[[], Mapping[str, Any]] | None = None,
        buttons: Mapping[str, Callable[[], None]] | None = None,
    ) -> None:
        if not 0 <= port <= 0xFFFF:
            raise InvalidInputError(f"a port must be 0 to 65535, not {port}")
        said = json.dumps(calibration, indent=1).encode()
        try:
            self._server = _Server(port, said, page, ("left", "right", *others))
        except OSError as error:
            raise InvalidInputError(
                f"the pictures' port {port} cannot be had ({error.strerror}): choose another"
            ) from error
        self._server.status, self._server.buttons = status, dict(buttons or {})
        self.port: int = self._server.server_address[1]
        self._thread = threading.Thread(target=self._server.serve_forever, args=(0.05,), name="mjpeg", daemon=True)
        self._thread.start()

    @property
    def url(self) -> str:
        """Of the index page."""
        return f"http://{HOST}:{self.port}/"

    def __enter__(self) -> "MjpegServer":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def publish(self, left: bytes, right: bytes, stamp_s: float, **others: bytes) -> None:
        """Show this pair of JPEG files, and the others by name, from now on."""
        self._server.newest.publish(Pair(left, right, stamp_s, others))

    def close(self) -> None:
        """Take no more clients; those that are there are cut off when the program ends."""
        self._server.shutdown()
        self._server.server_close()
        self._thread.join()


class _Server(ThreadingHTTPServer):
    daemon_threads = True
    block_on_close = False

    def __init__(self, port: int, calibration: bytes, page: bytes, names: tuple[str, ...]) -> None:
        super().__init__((HOST, port), _Handler)
        self.newest = Newest()
        self.calibration, self.page, self.names = calibration, page, names
        self.status: Callable[[], Mapping[str, Any]] | None = None
        self.buttons: dict[str, Callable[[], None]] = {}
        self._free = threading.BoundedSemaphore(MOST_CLIENTS)

    def server_bind(self) -> None:
        # HTTPServer's own asks for the host's name, which can take seconds.
        TCPServer.server_bind(self)
        self.server_name, self.server_port = HOST, self.server_address[1]

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        if not self._free.acquire(blocking=False):
            self.shutdown_request(request)
            return
        try:
            super().process_request_thread(request, client_address)
        finally:
            self._free.release()

    def handle_error(self, request: Any, client_address: Any) -> None:
        """A client that leaves or falls asleep is no news."""


class _Handler(BaseHTTPRequestHandler):
    timeout = PATIENCE_S

    @property
    def _ours(self) -> _Server:
        return cast(_Server, self.server)

    def _is_for_us(self) -> bool:
        """Whether no page of another site asks; it is told where one does."""
        foreign = is_foreign(self.headers.get("Host"), self.headers.get("Origin"))
        if foreign:
            self.send_error(HTTPStatus.FORBIDDEN, "this server answers to its own pages, by names of the loopback only")
        return not foreign

    def do_POST(self) -> None:
        if not self._ours.buttons:
            self.send_error(HTTPStatus.NOT_IMPLEMENTED, "there is nothing to press here")
            return
        if not self._is_for_us():
            return
        # A browser always tells of whose page a POST is.
        if self.headers.get("Origin") is None:
            self.send_error(HTTPStatus.FORBIDDEN, "only a page of this server may press its buttons")
            return
        press = self._ours.buttons.get(self.path[1:])
        if press is None:
            self.send_error(HTTPStatus.NOT_FOUND)
            return
        press()
        self.send_response(HTTPStatus.NO_CONTENT)
        self.end_headers()

    def do_GET(self) -> None:
        if not self._is_for_us():
            return
        path = self.path.split("?", 1)[0]
        if path == "/":
            self._send(self._ours.page, "text/html; charset=utf-8")
        elif path == "/camera.json":
            self._send(self._ours.calibration, "application/json")
        elif path == "/status.json" and self._ours.status is not None:
            self._send(json.dumps(self._ours.status()).encode(), "application/json")
        elif path.endswith(".jpg") and path[1:-4] in self._ours.names:
            self._send_picture(path[1:-4])
        elif path.endswith(".mjpg") and path[1:-5] in self._ours.names:
            self._send_stream(path[1:-5])
        else:
            self.send_error(HTTPStatus.NOT_FOUND)

    def _send(self, data: bytes, kind: str, stamp_s: float | None = None) -> None:
        self.send_response(HTTPStatus.OK)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(data)))
        self.send_header("Cache-Control", "no-store")
        if stamp_s is not None:
            self.send_header("X-Timestamp", f"{stamp_s:.6f}")
        self.end_headers()
        self.wfile.write(data)

    def _send_picture(self, name: str) -> None:
        found = self._ours.newest.after(0)
        if found is None:
            self.send_error(HTTPStatus.SERVICE_UNAVAILABLE, "the camera has not taken a picture yet")
            return
        self._send(found[1].picture(name), "image/jpeg", found[1].stamp_s)

    def _send_stream(self, name: str) -> None:
        self.send_response(HTTPStatus.OK)
        self.send_header("Content-Type", f"multipart/x-mixed-replace; boundary={BOUNDARY}")
        self.send_header("Cache-Control", "no-store")
        self.end_headers()
        number = 0
        while (found := self._ours.newest.after(number)) is not None:
            number, pair = found
            picture = pair.picture(name)
            self.wfile.write(
                f"--{BOUNDARY}\r\nContent-Type: image/jpeg\r\nContent-Length: {len(picture)}\r\n"
                f"X-Timestamp: {pair.stamp_s:.6f}\r\n\r\n".encode()
                + picture
                + b"\r\n"
            )

    def log_message(self, format: str, *args: Any) -> None:
        """No line for every request."""
