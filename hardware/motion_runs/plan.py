"""Which runs are wanted, in which pieces, and which of them a file already holds."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

from stereogrid.errors import InvalidInputError
from stereogrid.motion import Run
from stereogrid.motion.runs import AMBIGUOUS_RAD, LEAST_LENGTH_M, LEAST_TURN_RAD

from .legs import DRIVING, TURNING, Leg

LEAST_M, LEAST_RAD = 1.2 * LEAST_LENGTH_M, 1.2 * LEAST_TURN_RAD
"""So that a run which comes out short is still one for `stereogrid motion-error`."""
MOST_M, MOST_RAD = 20.0, 4 * math.pi
Pose = tuple[float, float, float]
"""x [m], y [m], heading [rad]."""
SAME = 0.2
"""A run of the file counts as one that is wanted when it is this much longer or shorter at most, of its whole."""


@dataclass(frozen=True)
class Plan:
    """`runs` straight ways of distance_m [m], or turns by turn_rad [rad], or as many of both; None: not these.

    A mark each every_m, each every_rad, and at the end. surface: what they are driven on, "" for no name.
    Raises InvalidInputError for what `stereogrid motion-error` would leave out.
    """

    distance_m: float | None = None
    turn_rad: float | None = None
    runs: int = 10
    surface: str = ""
    every_m: float = 1.0
    every_rad: float = math.pi / 2

    def __post_init__(self) -> None:
        if self.distance_m is None and self.turn_rad is None:
            raise InvalidInputError("say how far the robot shall drive (--distance 2), or turn (--turn 360)")
        if self.runs < 1:
            raise InvalidInputError(f"there must be at least 1 run, not {self.runs}")
        if self.distance_m is not None and not LEAST_M <= self.distance_m <= MOST_M:
            raise InvalidInputError(
                f"a straight run has {LEAST_M:g} to {MOST_M:g} m, not {self.distance_m:g}: on less, errors drown"
                " in the measuring"
            )
        if self.turn_rad is not None and not LEAST_RAD - 1e-9 <= self.turn_rad <= MOST_RAD + 1e-9:
            raise InvalidInputError(
                f"a turn has {math.degrees(LEAST_RAD):.0f} to {math.degrees(MOST_RAD):.0f} degrees (every other"
                f" one goes to the right by itself), not {math.degrees(self.turn_rad):g}"
            )
        if not 0.1 <= self.every_m < math.inf:
            raise InvalidInputError(f"marks must be at least 0.1 m apart, not {self.every_m:g}")
        if not math.radians(10) - 1e-9 <= self.every_rad <= AMBIGUOUS_RAD:
            raise InvalidInputError(
                f"marks of a turn must be 10 to {math.degrees(AMBIGUOUS_RAD):.0f} degrees apart, not "
                f"{math.degrees(self.every_rad):g}: beyond that nobody can tell which way the robot turned"
            )

    @property
    def kinds(self) -> list[str]:
        """What is wanted of straight and turn."""
        wanted = {"straight": self.distance_m, "turn": self.turn_rad}
        return [kind for kind, amount in wanted.items() if amount is not None]

    def done(self, kind: str, held: list[Run]) -> int:
        """How many of the wanted runs of a kind there are among those that a file holds."""
        whole = self._whole(kind)
        return sum(
            run.surface == self.surface and run.kind == kind and abs(_extent(run) - whole) <= SAME * whole
            for run in held
        )

    def left(self, held: list[Run]) -> dict[str, int]:
        """How many of each kind are still to be driven."""
        return {kind: max(0, self.runs - self.done(kind, held)) for kind in self.kinds}

    def legs(self, kind: str, done: int) -> list[Leg]:
        """The pieces of the next run of a kind, from mark to mark, when so many are done: turns go left, then right."""
        whole, every = self._whole(kind), self.every_rad if kind == "turn" else self.every_m
        sign = -1 if kind == "turn" and done % 2 else 1
        return [Leg(kind, sign * piece, TURNING if kind == "turn" else DRIVING) for piece in _pieces(whole, every)]

    def start(self, kind: str, done: int) -> Pose:
        """Where on the line the next run of a kind starts: straight ones from one end, then back from the other, so
        that a slope of the floor does not pass for a bias."""
        return (self._whole(kind), 0.0, math.pi) if kind == "straight" and done % 2 else (0.0, 0.0, 0.0)

    def _whole(self, kind: str) -> float:
        amount = self.turn_rad if kind == "turn" else self.distance_m
        assert amount is not None, kind
        return amount


def _extent(run: Run) -> float:
    return run.turned_rad if run.kind == "turn" else run.length_m


def _pieces(whole: float, every: float) -> Iterator[float]:
    """Pieces of `every`, and what is left at the end; a rest that is hardly one goes with the last piece."""
    count = max(1, math.ceil(whole / every - 0.05))
    yield from [every] * (count - 1)
    yield whole - (count - 1) * every


def next_name(held: list[Run]) -> str:
    """The number of the next run: one more than the largest in a file, whatever the surface."""
    return str(1 + max((int(run.name) for run in held if run.name.isascii() and run.name.isdigit()), default=0))
