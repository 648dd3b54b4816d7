"""What a sweep runs: settings x worlds x seeds, all in one TOML file, all checked before anything runs."""

import difflib
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from functools import cached_property, reduce
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from stereogrid.config import config_from_table
from stereogrid.described import Doc, check_fields
from stereogrid.errors import ConfigError, InvalidInputError
from stereogrid.scoring import SCORE_NAMES
from stereogrid.tomlfile import merged, read_table

from .drive_experiment import DriveExperimentConfig
from .drive_report import IDEAL, KNOWN_TILT, NOISY, SHUFFLED, TRUE_DEPTH
from .drives import HEADLINE, OBSTACLE_SCORES
from .sweep_axes import LARGEST, Axis, axis_of, check_list, check_names, flat, is_same, nested, value_at, with_ranges

ARMS = (IDEAL, NOISY, KNOWN_TILT, TRUE_DEPTH, SHUFFLED)


@dataclass(frozen=True)
class UnitConfig(DriveExperimentConfig):
    """One map of a sweep: the parameters of an experiment on a drive, and the arm that is mapped."""

    arm: Annotated[str, Doc("Which arm is mapped.", choices=ARMS)] = NOISY

    def __post_init__(self) -> None:
        super().__post_init__()
        check_fields(self, but=("world",))


@dataclass(frozen=True)
class Setting:
    """One choice of each axis's values (their numbers), by which parameters are set."""

    choices: tuple[int, ...]
    parameters: Mapping[str, Any]
    label: str


@dataclass(frozen=True)
class SweepUnit:
    """A map that is to be made: with one setting, in one world, with one seed."""

    setting: Setting
    world: str
    seed: int
    config: UnitConfig


@dataclass(frozen=True)
class SweepConfig:
    """A sweep, as sweep.toml says it: every setting is mapped in each world with each seed."""

    base: Annotated[
        UnitConfig, Doc("What every map has in common: the parameters of the corridor experiment, and the arm.")
    ] = field(default_factory=UnitConfig)
    vary: Annotated[dict, Doc("Parameter = the values that it takes, every one with every one of the others.")] = field(
        default_factory=dict
    )
    together: Annotated[tuple[dict, ...], Doc("Groups of parameters that vary together, first with first.")] = ()
    worlds: Annotated[tuple[str, ...] | None, Doc("Worlds that are driven through; not set: the base's.")] = None
    seeds: Annotated[
        tuple[int, ...] | None, Doc("Each draws the noise of cameras, wheels and odometry; not set: the base's.")
    ] = None
    new_worlds: Annotated[bool, Doc("Whether a seed paints the world as well: there is a drive for each then.")] = False
    score: Annotated[str, Doc("What the figure shows, and what is best by it.")] = "occupied_f1"
    sample: Annotated[int, Doc("Only so many settings, drawn at random; 0: all.", least=0)] = 0
    sample_seed: Annotated[int, Doc("Draws them.", least=0)] = 0
    most_units: Annotated[int, Doc("More maps than this are refused.", above=0)] = 500

    def __post_init__(self) -> None:
        names = [name for axis in self.axes for name in axis.names]
        check_names(names)
        for what, listed in (("worlds", self.the_worlds), ("seeds", self.the_seeds)):
            check_list(what, listed)
        check_score(self.score)
        check_fields(self)
        self._check_size()
        for setting in self.settings:
            for world in self.the_worlds:
                self.unit(setting, world, self.the_seeds[0])
        for seed in self.the_seeds:
            self.unit(self.settings[0], self.the_worlds[0], seed)

    @property
    def the_worlds(self) -> tuple[str, ...]:
        """The worlds that are driven through."""
        return (self.base.world,) if self.worlds is None else self.worlds

    @property
    def the_seeds(self) -> tuple[int, ...]:
        """The seeds that every setting is mapped with."""
        return (self.base.noise_seed,) if self.seeds is None else self.seeds

    @cached_property
    def axes(self) -> tuple[Axis, ...]:
        """What varies: first each of `vary`, then the groups."""
        alone = tuple(axis_of({name: values}) for name, values in flat(self.vary).items())
        return (*alone, *(axis_of(flat(group)) for group in self.together))

    @property
    def n_settings(self) -> int:
        """How many settings there are before any are drawn."""
        return math.prod(len(axis.values) for axis in self.axes)

    @property
    def reference(self) -> Setting:
        """What the others are compared with: the base's value of each axis where it is listed, else the first."""
        return self._setting(self._reference)

    @cached_property
    def settings(self) -> tuple[Setting, ...]:
        """Those that are mapped, in the order of their values; the reference is always among them."""
        if not 0 < self.sample < self.n_settings:
            return tuple(map(self._setting, np.ndindex(self._shape)))
        rng, reference = np.random.default_rng(self.sample_seed), np.ravel_multi_index(self._reference, self._shape)
        drawn = rng.choice(self.n_settings, self.sample, replace=False)
        others = [int(each) for each in drawn if each != reference][: self.sample - 1]
        return tuple(self._setting(np.unravel_index(each, self._shape)) for each in sorted([int(reference), *others]))

    def units(self) -> Iterator[SweepUnit]:
        """Every map, seed by seed: what is there when time is up is whole."""
        for seed in self.the_seeds:
            for world in self.the_worlds:
                for setting in self.settings:
                    yield self.unit(setting, world, seed)

    def unit(self, setting: Setting, world: str, seed: int) -> SweepUnit:
        """One map. Raises ConfigError, naming the setting, where its parameters do not go together."""
        given = {"world": world, "noise_seed": seed, **({"seed": seed} if self.new_worlds else {})}
        try:
            config = self._with({**setting.parameters, **given})
        except ConfigError as error:
            raise ConfigError(f"{setting.label or 'base'}, {world}, seed {seed}: {bare(error)}") from None
        return SweepUnit(setting, world, seed, config)

    @cached_property
    def _base_table(self) -> dict[str, Any]:
        return asdict(self.base)

    @property
    def _shape(self) -> tuple[int, ...]:
        return tuple(len(axis.values) for axis in self.axes)

    @cached_property
    def _reference(self) -> tuple[int, ...]:
        return tuple(self._of_base(axis) for axis in self.axes)

    def _of_base(self, axis: Axis) -> int:
        base = [value_at(self.base, name) for name in axis.names]
        alike = (all(map(is_same, values, base)) for values in axis.values)
        return next((n for n, same in enumerate(alike) if same), 0)

    def _setting(self, choices: Sequence[int]) -> Setting:
        picked = tuple(map(int, choices))
        each = [(axis, n) for axis, n in zip(self.axes, picked, strict=True)]
        parameters = {name: value for axis, n in each for name, value in zip(axis.names, axis.values[n], strict=True)}
        return Setting(picked, parameters, ", ".join(f"{axis.label} = {axis.text(n)}" for axis, n in each))

    def _with(self, parameters: Mapping[str, Any]) -> UnitConfig:
        tables = (nested(name, value) for name, value in parameters.items())
        return config_from_table(UnitConfig, reduce(merged, tables, self._base_table))

    def _check_size(self) -> None:
        n_settings = min(self.n_settings, self.sample or self.n_settings)
        n = n_settings * len(self.the_worlds) * len(self.the_seeds)
        if n > self.most_units or self.n_settings > LARGEST:
            raise InvalidInputError(
                f"{n_settings:,} settings x {len(self.the_worlds)} worlds x {len(self.the_seeds)} seeds are {n:,} maps,"
                f" more than most_units = {self.most_units:,}: raise it, or let sample = N draw N of the settings"
            )


def load_sweep(path: Path) -> SweepConfig:
    """A sweep from a TOML file; what its base leaves out is as in UnitConfig, even within sections.

    Raises ConfigError naming the file and the culprit.
    """
    table = read_table(path)
    try:
        return config_from_table(SweepConfig, merged({"base": asdict(UnitConfig())}, with_ranges(table, "")))
    except ConfigError as error:
        raise ConfigError(f"{path}: {bare(error)}") from None


def bare(error: ConfigError) -> str:
    """What an error says, without the name of the whole."""
    return str(error).removeprefix("[config] ")


def check_score(name: str) -> None:
    """Raise InvalidInputError for a score that no map has."""
    names = [*SCORE_NAMES, *(f"obstacle_{each}" for each in OBSTACLE_SCORES)]
    if name not in names:
        near = difflib.get_close_matches(name, names, n=1, cutoff=0.3)
        hint = f"; did you mean {near[0]!r}?" if near else ";"
        raise InvalidInputError(f"no score named {name!r}{hint} the first of them are: {', '.join(HEADLINE)}")
