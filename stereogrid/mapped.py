"""A map, and what is remembered of its making."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Protocol, TypeVar

from .camera import StereoCamera
from .errors import MapTooLargeError
from .geometry import FloatArray
from .grid import OccupancyGrid
from .observation import Disparity, Observation

Item = TypeVar("Item")
ABOVE_CAMERA_M = 1.0
"""Cells higher than this above the camera are not shown, at first or at all: a ceiling hides what is below it."""


class Track(Protocol):
    """Yields items and shows how many of total are done; `what` says what is being done to them."""

    def __call__(self, items: Iterable[Item], what: str, total: int) -> Iterator[Item]: ...


class HasCamera(Protocol):
    """Whatever knows the rectified pair: a recording, live cameras."""

    @property
    def camera(self) -> StereoCamera: ...


@dataclass(frozen=True)
class Mapped:
    """A map and what is remembered of its making.

    path_T_world_cam (M, 4, 4): where the camera was taken to be; sample: an observation a quarter of
    the way down the drive with its disparity, for figures; density: mean share of matched pixels;
    stopped: what the map could not grow beyond, after the M observations that it holds; stamps_s (M,): of the poses,
    None where they are not known.
    """

    grid: OccupancyGrid
    path_T_world_cam: FloatArray
    sample: tuple[Observation, Disparity]
    density: float
    stopped: MapTooLargeError | None = None
    stamps_s: FloatArray | None = None

    @property
    def path_m(self) -> FloatArray:
        """Positions of the camera (M, 3) in world [m]."""
        return self.path_T_world_cam[:, :3, 3]


def untracked(items: Iterable[Item], what: str, total: int) -> Iterator[Item]:  # noqa: ARG001
    """No progress bar."""
    yield from items
