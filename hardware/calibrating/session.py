"""Which pairs a calibration needs: decides of each pair whether it is taken, and says what pose to show next."""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from stereogrid.calibration import Chessboard

from .sight import TILES, Sight

STILL_S = 0.4
"""A board held by hand for so long ..."""
STILL_OF_WIDTH = 0.005
"""... has not moved further than this share of the picture's width."""
NEW_OF_WIDTH = 0.06
NEW_DEG = 12.0
"""A pose is another one once the corners are so far from those of any pair taken, or the board is tilted otherwise."""
MAX_EDGE_PX = 4.5
"""Sharp edges rise within 3 px; a Gaussian blur of 1 px makes it 3.7, of 2 px 5.8."""
MAX_SKEW_S = 0.02
TILTED = np.sin(np.radians(15))
CLOSE, FAR = 0.5, 0.42
CORNERS_A_TILE = 12
MIN_PAIRS = 15
MOST_PAIRS = 60

TAKEN = "taken: now another pose"

PLACES = (
    ("the middle", 1, 1),
    ("the upper left", 0, 0),
    ("the lower right", 2, 2),
    ("the upper right", 0, 2),
    ("the lower left", 2, 0),
    ("the left", 1, 0),
    ("the right", 1, 2),
    ("the top", 0, 1),
    ("the bottom", 2, 1),
)
"""Parts of the picture in the order in which they are asked for: name, row and column of the tile."""


@dataclass(frozen=True)
class Goal:
    """Something that the pairs have to show: name of it, what to do for it, how much there is of what is needed.

    tile: row and column of the part of the picture that is meant.
    """

    name: str
    told: str
    have: int
    need: int
    tile: tuple[int, int] | None = None

    @property
    def met(self) -> bool:
        return self.have >= self.need


@dataclass(frozen=True)
class Verdict:
    """Of a sight: whether it is taken, and what to tell the person."""

    taken: bool
    told: str
    kind: Literal["taken", "waiting", "nothing"]


@dataclass
class CalibrationSession:
    """Collects sights of a board until a calibration can be made of them. Pure: sees no camera, writes nothing."""

    board: Chessboard
    taken: list[Sight] = field(default_factory=list)
    _since: Sight | None = None
    _forgotten: Sight | None = None

    def consider(self, sight: Sight) -> Verdict:
        """Take it, if the board stands still in a new pose and both pictures are good."""
        told = self._not_seen(sight)
        if told:
            self._since = None
            return Verdict(False, told, "nothing")
        told = self._unfit(sight)
        if told:
            return Verdict(False, told, "taken" if told == TAKEN else "waiting")
        self.taken.append(sight)
        return Verdict(True, "taken", "taken")

    def forget(self) -> bool:
        """Drop the pair that was taken last; False when there is none. The pose counts again once it was left."""
        if not self.taken:
            return False
        self._forgotten = self.taken.pop()
        return True

    @property
    def goals(self) -> list[Goal]:
        """All of them, met or not, in the order in which they are asked for."""
        return [*self._places, *self._distances, *self._tilts, self._number]

    @property
    def complete(self) -> bool:
        """Nothing more is needed; or there are so many pairs that more would not help."""
        return all(goal.met for goal in self.goals) or len(self.taken) >= MOST_PAIRS

    @property
    def next_goals(self) -> list[Goal]:
        """What the next pose should serve: a place, and a distance or a tilt, whatever is open; [] when complete."""
        open_places = [goal for goal in self._places if not goal.met]
        open_poses = [goal for goal in (*self._tilts, *self._distances) if not goal.met]
        return [*open_places[:1], *open_poses[:1]] or [goal for goal in [self._number] if not goal.met]

    @property
    def hint(self) -> str:
        """What pose to show next, for a person."""
        told = ", and ".join(goal.told for goal in self.next_goals)
        return told[:1].upper() + told[1:] if told else "That is enough"

    @property
    def _places(self) -> list[Goal]:
        seen = sum((sight.in_tiles for sight in self.taken), np.zeros((TILES, TILES)))
        return [
            Goal(name, f"move the board to {name} of the picture", int(seen[tile]), CORNERS_A_TILE, tile)
            for name, *place in PLACES
            for tile in [(place[0], place[1])]
        ]

    @property
    def _distances(self) -> list[Goal]:
        near, far = sum(s.share >= CLOSE for s in self.taken), sum(s.share <= FAR for s in self.taken)
        return [
            Goal("near", "bring it closer, so that it fills more than half of the picture", near, 2),
            Goal("far", "take it further away", far, 2),
        ]

    @property
    def _tilts(self) -> list[Goal]:
        normals = np.array([sight.normal for sight in self.taken]).reshape(-1, 3)
        ways = (("right", 0, 1), ("left", 0, -1), ("lower", 1, 1), ("upper", 1, -1))
        have = [int((sign * normals[:, axis] >= TILTED).sum()) for _, axis, sign in ways]
        return [
            Goal(f"{edge} edge nearer", f"tilt it until its {edge} edge in the picture is nearer", n, 2)
            for (edge, _, _), n in zip(ways, have, strict=True)
        ]

    @property
    def _number(self) -> Goal:
        return Goal("pairs", "show any other pose, turned or tilted", len(self.taken), MIN_PAIRS)

    def _not_seen(self, sight: Sight) -> str:
        missing = [side for side, corners in zip(("left", "right"), sight.corners, strict=True) if corners is None]
        if len(missing) == 2:
            return f"show the board, all of it, to both cameras ({self.board})"
        return f"the {missing[0]} camera does not see all of the board" if missing else ""

    def _unfit(self, sight: Sight) -> str:
        """Why a sight of the board is not taken; "" when it may be."""
        before = self._since
        if before is None or sight.moved_px(before) > STILL_OF_WIDTH * sight.size_px[0]:
            self._since = sight
            return "hold it still"
        if self._forgotten is not None and _alike(sight, self._forgotten):
            return "this pose was forgotten: show another one first"
        self._forgotten = None
        if any(_alike(sight, other) for other in self.taken):
            return TAKEN
        if sight.stamp_s - before.stamp_s < STILL_S:
            return "hold it still"
        if abs(sight.skew_s) > MAX_SKEW_S:
            return f"the two pictures are {1000 * abs(sight.skew_s):.0f} ms apart"
        if sight.edge_px > MAX_EDGE_PX:
            return f"blurred over {sight.edge_px:.1f} px: more light, or sharpen the lens, or a little further away"
        return ""


def _alike(a: Sight, b: Sight) -> bool:
    """Whether they show the board in one pose, as far as that matters."""
    return a.moved_px(b) < NEW_OF_WIDTH * a.size_px[0] and a.turned_deg(b) < NEW_DEG
