"""The least of HTTP that a camera needs: one GET, whose answer is read bit by bit, bounded in size and time."""

import base64
import http.client
import io
import json
import socket
from dataclasses import dataclass, field
from typing import Any
from urllib.parse import unquote, urlsplit

from stereogrid.errors import InvalidInputError

from ..clock import now_s
from ..errors import CameraError

PATIENCE_S = 5.0
"""To connect, and until the headers of the answer are complete."""
MOST_HEAD = 65_536
MOST_JSON = 1 << 20
_CHUNK = 65_536


@dataclass(frozen=True)
class Address:
    """Where a picture is. url: as for messages, without the password."""

    host: str
    port: int
    target: str
    url: str
    credentials: str = field(default="", repr=False)

    @classmethod
    def parse(cls, url: str) -> "Address":
        """Raises InvalidInputError for what is no http:// URL."""
        try:
            parts = urlsplit(url)
            port = 80 if parts.port is None else parts.port
        except ValueError as error:
            raise InvalidInputError(f"{url!r} is no URL: {error}") from error
        if parts.scheme != "http" or not parts.hostname or any(ord(each) <= 32 or ord(each) > 126 for each in url):
            raise InvalidInputError(f"{url!r} is no URL of a camera: http://host:port/path")
        target = (parts.path or "/") + (f"?{parts.query}" if parts.query else "")
        host = f"[{parts.hostname}]" if ":" in parts.hostname else parts.hostname
        secret = f"{unquote(parts.username)}:{unquote(parts.password or '')}" if parts.username else ""
        return cls(parts.hostname, port, target, f"http://{host}:{port}{target}", secret)

    def below(self, name: str) -> "Address":
        """The address of a name below this one, which ends with /."""
        path = self.target.split("?", 1)[0].rstrip("/")
        target, start = f"{path}/{name}", self.url[: len(self.url) - len(self.target)]
        return Address(self.host, self.port, target, start + target, self.credentials)


class Answer:
    """The answer to a GET: its headers are there when it is made; `read` gives what comes of its body.

    from_this_machine: whether the server runs on ours. Raises CameraError: nobody answers, not in time, or not with
    200 OK.
    """

    def __init__(self, address: Address) -> None:
        self._address = address
        deadline_s = now_s() + PATIENCE_S
        try:
            self._socket = socket.create_connection((address.host, address.port), PATIENCE_S)
        except OSError as error:
            raise CameraError(f"{address.url} cannot be reached ({error.strerror or error}): is it running?") from error
        try:
            self._socket.sendall(_request(address))
            head, self._rest = self._read_head(deadline_s)
            self.headers = _parsed_head(address, head)
        except OSError as error:
            self.close()
            raise CameraError(f"{address.url} does not answer ({error})") from error
        except CameraError:
            self.close()
            raise
        self.from_this_machine = self._socket.getpeername()[0] == self._socket.getsockname()[0]
        self._chunks = _Chunks() if self.headers.get("Transfer-Encoding", "").lower() == "chunked" else None

    def read(self, timeout_s: float) -> bytes:
        """What has come of the body; b"" for nothing within timeout_s. Raises CameraError: the stream has ended."""
        data, self._rest = self._rest, b""
        if not data:
            self._socket.settimeout(max(timeout_s, 1e-3))
            try:
                data = self._socket.recv(_CHUNK)
            except TimeoutError:
                return b""
            except OSError as error:
                raise CameraError(f"{self._address.url} was cut off ({error.strerror or error})") from error
            if not data:
                raise CameraError(f"{self._address.url} has ended")
        return self._chunks.feed(data) if self._chunks is not None else data

    def close(self) -> None:
        """End the connection."""
        self._socket.close()

    def _read_head(self, deadline_s: float) -> tuple[bytes, bytes]:
        """Up to the empty line, and what has come behind it; a server that sends it drop by drop is late as well."""
        data = b""
        while b"\r\n\r\n" not in data and b"\n\n" not in data:
            if len(data) > MOST_HEAD:
                raise CameraError(f"{self._address.url} answers with more than {MOST_HEAD} bytes of headers")
            left_s = deadline_s - now_s()
            if left_s <= 0:
                raise CameraError(f"{self._address.url} has not answered within {PATIENCE_S:g} s")
            self._socket.settimeout(left_s)
            more = self._socket.recv(_CHUNK)
            if not more:
                raise CameraError(f"{self._address.url} ends in the middle of its headers")
            data += more
        mark = min((at, len(mark)) for mark in (b"\r\n\r\n", b"\n\n") if (at := data.find(mark)) >= 0)
        return data[: sum(mark)], data[sum(mark) :]


class _Chunks:
    """Takes the chunked coding off, however its bytes are split."""

    def __init__(self) -> None:
        self._buffer = bytearray()
        self._left = 0

    def feed(self, data: bytes) -> bytes:
        """The body's bytes among the next bytes of the stream."""
        self._buffer += data
        body = bytearray()
        while self._buffer:
            if self._left > 0:
                taken = self._buffer[: self._left]
                body += taken
                self._left -= len(taken)
                del self._buffer[: len(taken)]
            elif not self._take_size():
                break
        return bytes(body)

    def _take_size(self) -> bool:
        """The line with the next chunk's size, behind the last one's line end; false where it is not complete."""
        start = 2 if self._buffer.startswith(b"\r\n") else 0
        end = self._buffer.find(b"\r\n", start)
        if end < 0:
            if len(self._buffer) > 1024:
                raise CameraError("a chunk of the stream has no size")
            return False
        text = bytes(self._buffer[start:end]).split(b";")[0].strip()
        try:
            self._left = int(text[:9], 16)
        except ValueError as error:
            raise CameraError(f"a chunk of the stream has the size {text[:32]!r}") from error
        if self._left <= 0:
            raise CameraError("the stream has ended")
        del self._buffer[: end + 2]
        return True


def get_json(address: Address) -> dict[str, Any] | None:
    """The JSON object there; None where there is none, or no such page."""
    try:
        answer = Answer(address)
    except CameraError:
        return None
    data, deadline_s = b"", now_s() + PATIENCE_S
    try:
        # What starts otherwise, as a stream of pictures, is no object.
        while data.lstrip()[:1] in (b"", b"{") and len(data) <= MOST_JSON and (left_s := deadline_s - now_s()) > 0:
            data += answer.read(left_s)
    except CameraError:
        pass  # its end
    finally:
        answer.close()
    try:
        found = json.loads(data[:MOST_JSON])
    except (ValueError, RecursionError):
        return None
    return found if isinstance(found, dict) else None


def _request(address: Address) -> bytes:
    host = address.url.removeprefix("http://").split("/", 1)[0]
    lines = [f"GET {address.target} HTTP/1.0", f"Host: {host}", "Accept: */*", "User-Agent: stereogrid"]
    if address.credentials:
        lines.append(f"Authorization: Basic {base64.b64encode(address.credentials.encode()).decode()}")
    return "\r\n".join([*lines, "", ""]).encode()


def _parsed_head(address: Address, head: bytes) -> http.client.HTTPMessage:
    """The headers of an answer 200. Raises CameraError for any other."""
    status_line, _, rest = head.partition(b"\n")
    words = status_line.decode("latin-1").split(None, 2)
    if len(words) < 2 or not words[0].startswith("HTTP/"):
        raise CameraError(f"{address.url} is no web server: it answers {status_line[:40]!r}")
    if words[1] == "401":
        raise CameraError(f"{address.url} wants a password: http://user:password@{address.host}/...")
    if words[1] != "200":
        raise CameraError(f"{address.url} answers {' '.join(words[1:]).strip()[:60]}")
    try:
        return http.client.parse_headers(io.BytesIO(rest))
    except http.client.HTTPException as error:
        raise CameraError(f"{address.url} answers with headers that cannot be read ({error})") from error
