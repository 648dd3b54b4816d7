"""Kolmogorov and Zabih's graph cuts, one file a step. matcher.py is the order of the steps."""

from .matcher import KolmogorovZabihMatcher

__all__ = ["KolmogorovZabihMatcher"]
