"""Maps in the browser, by viser: the extra `view`."""

from .live import LiveView

__all__ = ["LiveView"]
