"""Repeated runs over marks: odometry beside the truth, one row a mark."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..errors import InvalidInputError
from ..geometry import FloatArray, as_floats

LEAST_LENGTH_M = 0.5
LEAST_TURN_RAD = np.radians(45.0)
STRAIGHT_RAD = np.radians(30.0)
"""A straight run goes at least so far and turns at most so much; on the spot a robot turns and stays within so far."""
AMBIGUOUS_RAD = np.radians(150.0)
"""A heading that turns further from one mark to the next may as well have turned the other way round."""


@dataclass(frozen=True, eq=False)
class Run:
    """One run: what odometry says and what is true at its start and at each mark, in their order.

    odo, true (1 + marks, 3): x [m], y [m], heading [rad]; each in any frame of its own. Headings are NaN where they
    were not measured; then x and y of both must be along the same axes. rows (1 + marks,): of the file, for messages.
    """

    name: str
    odo: FloatArray
    true: FloatArray
    surface: str = ""
    rows: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        for name in ("odo", "true"):
            values = as_floats(getattr(self, name))
            object.__setattr__(self, name, values)
            if values.ndim != 2 or values.shape[1:] != (3,):
                raise InvalidInputError(f"{self}: {name} must be (1 + marks, 3), not {values.shape}")
            if not np.isfinite(values[:, :2]).all():
                raise InvalidInputError(f"{self}: x and y of {name} must be finite")
        if self.odo.shape != self.true.shape:
            raise InvalidInputError(f"{self}: {len(self.odo)} readings of odometry, but {len(self.true)} of the truth")
        if len(self.true) < 2:
            raise InvalidInputError(f"{self} has one row, which is its start; its marks are missing")
        self._check_turns()

    def _check_turns(self) -> None:
        turns = np.abs(np.diff(np.unwrap(self.true[:, 2])))
        doubtful = np.flatnonzero(turns > AMBIGUOUS_RAD)
        if len(doubtful):
            raise InvalidInputError(
                f"{self.at(doubtful[0] + 1)}: the heading turns by {np.degrees(turns[doubtful[0]]):.0f} degrees from "
                f"the mark before; which way is clear only up to {np.degrees(AMBIGUOUS_RAD):.0f}: mark more often"
            )

    def __str__(self) -> str:
        return f"run {self.name}" + (f" on {self.surface}" if self.surface else "")

    def at(self, number: int) -> str:
        """What a message calls a row of the run."""
        return f"row {self.rows[number]} ({self})" if self.rows else f"{self}, reading {number}"

    @property
    def has_headings(self) -> bool:
        """Whether headings were measured throughout."""
        return bool(np.isfinite(self.odo[:, 2]).all() and np.isfinite(self.true[:, 2]).all())

    @property
    def steps_m(self) -> FloatArray:
        """True distances (marks,) from each mark to the next [m]."""
        steps: FloatArray = np.linalg.norm(np.diff(self.true[:, :2], axis=0), axis=1)
        return steps

    @property
    def turns_rad(self) -> FloatArray:
        """True turns (marks,) from each mark to the next [rad]; NaN without headings."""
        turns: FloatArray = np.diff(np.unwrap(self.true[:, 2]))
        return turns

    @property
    def length_m(self) -> float:
        """From the start to the last mark, straight [m]."""
        return float(np.linalg.norm(self.true[-1, :2] - self.true[0, :2]))

    @property
    def turned_rad(self) -> float:
        """How far it turns, one way [rad]; 0 without headings."""
        return float(abs(self.turns_rad.sum())) if self.has_headings else 0.0

    @property
    def kind(self) -> str:
        """straight, turn (on the spot), or nothing for what is neither."""
        reach_m = float(np.linalg.norm(self.true[:, :2] - self.true[0, :2], axis=1).max())
        if reach_m >= LEAST_LENGTH_M and self.turned_rad <= STRAIGHT_RAD:
            return "straight"
        return "turn" if reach_m < LEAST_LENGTH_M and self.turned_rad >= LEAST_TURN_RAD else ""


@dataclass(frozen=True)
class Runs:
    """Repeated runs. Raises InvalidInputError where marks are out of order, or odometry and truth differ by a unit."""

    runs: tuple[Run, ...]

    def __post_init__(self) -> None:
        for run in self.runs:
            _check_order(run)
            _check_units(run)

    def __len__(self) -> int:
        return len(self.runs)

    def __iter__(self) -> Iterator[Run]:
        return iter(self.runs)

    @property
    def surfaces(self) -> tuple[str, ...]:
        """The surfaces, in the order that they come in."""
        return tuple(dict.fromkeys(run.surface for run in self.runs))

    def on(self, surface: str) -> "Runs":
        """Those on a surface. Raises InvalidInputError when there is none."""
        kept = tuple(run for run in self.runs if run.surface == surface)
        if not kept:
            named = ", ".join(repr(each) for each in self.surfaces)
            raise InvalidInputError(f"no run on the surface {surface!r}; choose from: {named}")
        return Runs(kept)

    def of_kind(self, kind: str) -> list[Run]:
        """The runs of a kind, straight or turn."""
        return [run for run in self.runs if run.kind == kind]


def _check_order(run: Run) -> None:
    """Each mark must lie beyond the one before it."""
    if run.kind == "straight":
        course = (run.true[-1, :2] - run.true[0, :2]) / max(run.length_m, 1e-9)
        onward = np.diff(run.true[:, :2] @ course)
    elif run.kind == "turn":
        onward = run.turns_rad * np.sign(run.turns_rad.sum())
    else:
        return
    back = np.flatnonzero(onward <= 0)
    if len(back):
        raise InvalidInputError(
            f"{run.at(back[0] + 1)}: the mark is not beyond the one before it; a run has its start and then its marks "
            "in order, goes one way, and shares its name with no other"
        )


OTHER_UNIT = "is one of them in another unit than its column's name says?"
TIMES = 3.0
"""Odometry that is so many times the truth, or the truth so many times odometry, is in another unit."""


def _check_units(run: Run) -> None:
    """Odometry and truth must be about the same, however badly the robot errs."""
    if run.kind == "straight":
        _check_distances(run)
        _check_direction(run)
        if run.has_headings:
            _check_headings(run)
    elif run.kind == "turn":
        _check_turned(run)


def _check_distances(run: Run) -> None:
    away_m = [np.linalg.norm(values[1:, :2] - values[0, :2], axis=1) for values in (run.odo, run.true)]
    for number, (odo_m, true_m) in enumerate(zip(*away_m, strict=True), start=1):
        if not 1 / TIMES < odo_m / max(true_m, 1e-9) < TIMES:
            raise InvalidInputError(
                f"{run.at(number)}: odometry says {odo_m:g} m from the start and the truth {true_m:g} m; {OTHER_UNIT}"
            )


ASTRAY_RAD = 1.0
"""Odometry of a straight run that goes so far beside the true way is in other axes than it, or has a wrong sign."""


def _check_direction(run: Run) -> None:
    """From the start to the last mark odometry must go about where the truth goes, as seen from the headings there."""
    way = [complex(*(values[-1, :2] - values[0, :2])) for values in (run.odo, run.true)]
    if run.has_headings:
        way = [each * np.exp(-1j * values[0, 2]) for each, values in zip(way, (run.odo, run.true), strict=True)]
    astray = abs(float(np.angle(way[0] * np.conj(way[1]))))
    if astray > ASTRAY_RAD:
        why = (
            "seen from the headings at the start; is a sign wrong?"
            if run.has_headings
            else "and without headings both must be along the same axes"
        )
        raise InvalidInputError(
            f"{run.at(len(run.true) - 1)}: odometry goes {np.degrees(astray):.0f} degrees beside the truth, {why}"
        )


def _check_headings(run: Run) -> None:
    erred = np.diff(run.odo[:, 2]) - run.turns_rad
    erred = np.abs((erred + np.pi) % (2 * np.pi) - np.pi)
    worst = int(erred.argmax())
    if erred[worst] > 1:
        raise InvalidInputError(
            f"{run.at(worst + 1)}: odometry's heading is off by {erred[worst]:.2f} rad since the mark before, on a "
            "straight run; are these degrees?"
        )


def _check_turned(run: Run) -> None:
    odo, true = (np.degrees(abs(np.unwrap(values[:, 2])[-1] - values[0, 2])) for values in (run.odo, run.true))
    if not 1 / TIMES < odo / true < TIMES:
        raise InvalidInputError(
            f"{run.at(len(run.true) - 1)}: odometry has turned by {odo:.3g} degrees and the truth by {true:.3g}; "
            f"{OTHER_UNIT}"
        )
