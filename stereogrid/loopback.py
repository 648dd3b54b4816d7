"""Who may ask a web server that is for this machine alone, or for those that were told of it."""

from ipaddress import ip_address
from socket import gethostname

HOST = "127.0.0.1"
LOCAL_NAMES = (HOST, "localhost", "[::1]")


def is_foreign(host: str | None, origin: str | None) -> bool:
    """Whether a request with these headers comes from a page of another site, or under a name that only leads here.

    Such a page, open in a browser on this machine, could otherwise see through the robot's eyes.
    """
    host = (host or "").lower()
    return _name(host) not in LOCAL_NAMES or _of_another_page(host, origin)


def is_misled(host: str | None, origin: str | None) -> bool:
    """The same of a server that other machines may ask: they know it by an address or by the machine's own name.

    A name that somebody made lead here is neither; without this a page of another site could ask under its own name.
    """
    host = (host or "").lower()
    name = _name(host)
    own = gethostname().lower()
    known = name in LOCAL_NAMES or name in (own, f"{own}.local") or _is_address(name)
    return not known or _of_another_page(host, origin)


def _name(host: str) -> str:
    """Of a Host header, without the port."""
    return host if host.endswith("]") else host.rsplit(":", 1)[0]


def _is_address(name: str) -> bool:
    try:
        ip_address(name.strip("[]"))
    except ValueError:
        return False
    return True


def _of_another_page(host: str, origin: str | None) -> bool:
    # A port of its own makes a page another site too: its Origin must name this very server.
    return origin is not None and origin.lower() != f"http://{host}"
