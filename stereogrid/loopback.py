"""Who may ask a web server that is for this machine alone."""

HOST = "127.0.0.1"
LOCAL_NAMES = (HOST, "localhost", "[::1]")


def is_foreign(host: str | None, origin: str | None) -> bool:
    """Whether a request with these headers comes from a page of another site, or under a name that only leads here.

    Such a page, open in a browser on this machine, could otherwise see through the robot's eyes.
    """
    host = (host or "").lower()
    name = host if host.endswith("]") else host.rsplit(":", 1)[0]
    if name not in LOCAL_NAMES:
        return True
    # A port of its own makes a page another site too: its Origin must name this very server.
    return origin is not None and origin.lower() != f"http://{host}"
