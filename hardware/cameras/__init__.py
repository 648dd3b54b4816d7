"""Two cameras of one rig, whatever they are plugged into."""

from .opening import open_cameras
from .pairs import PairCounts, RawPair, StereoPairs

__all__ = ["PairCounts", "RawPair", "StereoPairs", "open_cameras"]
