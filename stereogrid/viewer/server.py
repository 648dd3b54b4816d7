"""viser's server on this machine's loopback, shut to pages of other sites."""

import io
import socket
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stdout
from http import HTTPStatus
from typing import Any

from ..errors import InvalidInputError, MissingExtraError
from ..loopback import HOST, LOCAL_NAMES, is_foreign, is_misled

MISSING = 'a view in the browser needs viser: pip install "stereogrid[view]"'

EVERYWHERE = "0.0.0.0"
"""Of a server that answers on all the machine's addresses."""


def open_server(port: int, title: str, host: str = HOST) -> Any:
    """A running viser.ViserServer; a port that is taken gives way to the next free one, 0 is any.

    host: another one than this machine's loopback lets other machines look too.

    viser itself answers whoever asks: a page of another site, open in the same browser, could see through the robot's
    eyes. Here a foreign Host or Origin is refused. Raises MissingExtraError without viser.
    """
    if not 0 <= port <= 0xFFFF:
        raise InvalidInputError(f"a port must be 0 to 65535, not {port}")
    _check_host(host)
    try:
        import viser
        import websockets.asyncio.server as websocket_server
    except ImportError as error:
        raise MissingExtraError(MISSING) from error
    refuses = is_foreign if host in LOCAL_NAMES else is_misled
    with _guarded(websocket_server, refuses) as guarded, redirect_stdout(io.StringIO()):
        server = viser.ViserServer(host=host, port=port, label=title, verbose=False)
        if not guarded():
            close_server(server)
            raise MissingExtraError("this version of viser serves in a way that cannot be shut to other sites")
    # Sharing would open a tunnel to the whole world: without its button any page that is open could still ask for it.
    server.request_share_url = lambda *_, **__: None
    server.gui.configure_theme(show_logo=False, show_share_button=False)
    return server


def _check_host(host: str) -> None:
    """viser waits for ever for a server that cannot be had at its address."""
    try:
        family, kind, *_, address = socket.getaddrinfo(host, 0, type=socket.SOCK_STREAM)[0]
        with socket.socket(family, kind) as tried:
            tried.bind(address)
    except (OSError, UnicodeError) as error:
        what = getattr(error, "strerror", None) or error
        raise InvalidInputError(f"--host {host}: is no address of this machine ({what})") from None


def url_of(server: Any) -> str:
    """Of its page, as a browser on this machine finds it."""
    host = server.get_host()
    return f"http://{HOST if host == EVERYWHERE else host}:{server.get_port()}/"


def close_server(server: Any) -> None:
    """Stop it, without its line on stdout."""
    with redirect_stdout(io.StringIO()):
        server.stop()


@contextmanager
def _guarded(websocket_server: Any, refuses: Callable[[str | None, str | None], bool]) -> Iterator[Callable[[], bool]]:
    """Within it, servers that are started refuse what is foreign; the yielded function tells whether one was."""
    serve, used = websocket_server.serve, []

    def serve_own(*args: Any, process_request: Callable[[Any, Any], Any], **options: Any) -> Any:
        def check(connection: Any, request: Any) -> Any:
            if refuses(request.headers.get("Host"), request.headers.get("Origin")):
                return connection.respond(HTTPStatus.FORBIDDEN, "only this server's own page may ask\n")
            return process_request(connection, request)

        used.append(True)
        return serve(*args, process_request=check, **options)

    websocket_server.serve = serve_own
    try:
        yield lambda: bool(used)
    finally:
        websocket_server.serve = serve
