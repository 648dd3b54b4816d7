"""What the rest of the program sees of two cameras: raw pairs that come, and a count of those that do not."""

from dataclasses import dataclass
from typing import Any, Protocol

from stereogrid.observation import Image

from ..mailbox import Mailbox


@dataclass(frozen=True)
class RawPair:
    """left, right (H, W) uint8, as the cameras gave them; when each was taken, on hardware.clock."""

    left: Image
    right: Image
    left_stamp_s: float
    right_stamp_s: float

    @property
    def stamp_s(self) -> float:
        """The middle of the two moments."""
        return 0.5 * (self.left_stamp_s + self.right_stamp_s)

    @property
    def skew_s(self) -> float:
        """How much later the right picture was taken."""
        return self.right_stamp_s - self.left_stamp_s


@dataclass
class PairCounts:
    """So far: pairs given out; pairs beyond the bound of skew; pictures that could not be read or paired; times that a
    camera was lost, counted when it goes."""

    pairs: int = 0
    skewed: int = 0
    broken: int = 0
    lost: int = 0


class StereoPairs(Protocol):
    """Two cameras that are running. size_px (width, height) of both; name: what they are, for messages; about: what
    they say of themselves (an MJPEG server's camera.json, a camera's modes and controls), as JSON values."""

    size_px: tuple[int, int]
    name: str
    counts: PairCounts
    about: dict[str, Any]

    def subscribe(self, most: int = 4) -> Mailbox[RawPair]:
        """A mailbox of the pairs from now on."""

    def last_stamp_s(self) -> float | None:
        """When the newest pair was taken; None before the first one."""

    def problem(self) -> str:
        """Why no pairs come now ("the left camera /dev/video0 is gone: plug it in again"), "" when they do."""

    def close(self) -> None:
        """Let the cameras go. Again: nothing."""
