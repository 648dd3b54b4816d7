"""The arms of the error budget: which causes of error are real, and the maps that they need.

A cause is real or true. Matching has two parts: the images (all the cameras' faults but calibration) and the matcher.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

IMAGES, MATCHER, CALIBRATION, ODOMETRY, CELLS, FUSION = EVERY = (
    "images",
    "matcher",
    "calibration",
    "odometry",
    "cells",
    "fusion",
)
MATCHING = "matching"
CAUSES: dict[str, tuple[str, ...]] = {
    MATCHING: (IMAGES, MATCHER),
    CALIBRATION: (CALIBRATION,),
    ODOMETRY: (ODOMETRY,),
    CELLS: (CELLS,),
    FUSION: (FUSION,),
}
"""The causes that the budget splits the error by, and what each consists of."""
LADDER = (ODOMETRY, CALIBRATION, MATCHING, CELLS, FUSION)
"""The order in which causes are made true, one after the other."""
LABELS = "labels"


@dataclass(frozen=True)
class MapMade:
    """One map. images, matcher, calibration, odometry: which are real; finer: how often a cell is divided."""

    images: bool
    matcher: bool
    calibration: bool
    odometry: bool
    finer: int

    @property
    def seen(self) -> tuple[bool, bool, bool]:
        """What its disparities depend on. Who needs no matcher does not see how good the images are."""
        return self.images and self.matcher, self.matcher, self.calibration


@dataclass(frozen=True)
class Arm:
    """real: the causes that are as in life; the others are true. finer: how often the cells are divided when CELLS
    is true. labels: every cell that the map touched gets its true label, whatever FUSION is."""

    real: frozenset[str]
    finer: int = 2
    labels: bool = False

    @property
    def map_made(self) -> MapMade:
        """The map that it scores; several arms may share one."""
        finer = 1 if CELLS in self.real else self.finer
        needs_images = {IMAGES, MATCHER} <= self.real
        return MapMade(needs_images, MATCHER in self.real, CALIBRATION in self.real, ODOMETRY in self.real, finer)


@dataclass(frozen=True)
class Step:
    """One line of a reading: the error of the arm `worse` less that of `better`. part: of the line above."""

    what: str
    worse: str
    better: str
    part: bool = False


REAL, IDEAL = "all real", "all true"


def but(cause: str) -> str:
    """The arm in which all but one cause is real."""
    return f"all real but {cause}"


def only(cause: str) -> str:
    """The arm in which one cause alone is real."""
    return f"only {cause} real"


def budget_arms(finer: int, finest: int) -> dict[str, Arm]:
    """Every arm by name. finer: how often a cell is divided to make cells true; finest: in one more arm, 0: none."""
    every = frozenset(EVERY)
    arms = {REAL: Arm(every, finer)}
    arms |= {but(cause): Arm(every - set(parts), finer) for cause, parts in CAUSES.items()}
    arms[but(IMAGES)] = Arm(every - {IMAGES}, finer)
    if finest:
        arms[but(_finest(finest))] = Arm(every - {CELLS}, finest)
    arms[but(LABELS)] = Arm(every, finer, labels=True)
    arms |= {only(cause): Arm(frozenset(parts), finer) for cause, parts in CAUSES.items()}
    arms[only(MATCHER)] = Arm(frozenset({MATCHER}), finer)
    left = set(EVERY)
    for cause in LADDER:
        left -= set(CAUSES[cause])
        arm = Arm(frozenset(left), finer)
        if arm not in arms.values():
            arms[_ladder_name(left)] = arm
    arms[f"{IDEAL}, {LABELS}"] = Arm(frozenset(), finer, labels=True)
    return arms


def made_true(finest: int) -> list[Step]:
    """The first reading: all is real, and one cause at a time is made true."""
    lines = [
        Step(MATCHING, REAL, but(MATCHING)),
        Step("its images", REAL, but(IMAGES), part=True),
        Step("its matcher", but(IMAGES), but(MATCHING), part=True),
        Step(CALIBRATION, REAL, but(CALIBRATION)),
        Step(ODOMETRY, REAL, but(ODOMETRY)),
        Step(CELLS, REAL, but(CELLS)),
        Step(FUSION, REAL, but(FUSION)),
        Step("labels of touched cells", REAL, but(LABELS), part=True),
    ]
    finest_line = [Step(_finest(finest), REAL, but(_finest(finest)), part=True)] if finest else []
    return [*lines[:6], *finest_line, *lines[6:]]


def made_real() -> list[Step]:
    """The second reading: all is true, and one cause at a time is made real."""
    return [
        Step(MATCHING, only(MATCHING), IDEAL),
        Step("its images", only(MATCHING), only(MATCHER), part=True),
        Step("its matcher", only(MATCHER), IDEAL, part=True),
        *(Step(cause, only(cause), IDEAL) for cause in (CALIBRATION, ODOMETRY, CELLS, FUSION)),
    ]


def ladder(arms: Mapping[str, Arm]) -> list[tuple[str, str]]:
    """(what has been made true last, arm) from all real to all true, then the labels."""
    left, rungs = set(EVERY), [("all real", REAL)]
    for cause in LADDER:
        left -= set(CAUSES[cause])
        rungs.append((f"+ {cause}", _name_of(arms, left)))
    return [*rungs, (f"+ {LABELS}", f"{IDEAL}, {LABELS}")]


def _name_of(arms: Mapping[str, Arm], real: Iterable[str]) -> str:
    finer = arms[REAL].finer
    return next(name for name, arm in arms.items() if arm == Arm(frozenset(real), finer))


def _ladder_name(real: set[str]) -> str:
    return f"only {' and '.join(c for c, parts in CAUSES.items() if real.issuperset(parts))} real" if real else IDEAL


def _finest(finest: int) -> str:
    return f"cells / {finest}"
