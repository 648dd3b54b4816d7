"""The quality matcher: graph cuts, one file a step. matcher.py is the order of the steps."""

from .matcher import GraphCutMatcher

__all__ = ["GraphCutMatcher"]
