"""What the claim is tested on: worlds, noises of the poses, and arms, all in one TOML file."""

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Any

from sim.faults import camera_faults
from sim.rig import MINORU
from stereogrid.config import GridConfig, MappingConfig, MatcherConfig, config_from_table
from stereogrid.errors import InvalidInputError, unknown_name
from stereogrid.motion import WAYS, Growth, MotionError
from stereogrid.sensor_model import SensorModel

from .drives import DriveConfig

SCORED, TUNING = ("corridor", "office", "entrance"), ("warehouse", "outdoor")
NONE = "none"
SUM_OF_RAYS = "sum_of_rays"
SIZES = ("position_m", "heading_rad", "along", "across", "heading", "turn")
"""The fields of a MotionError that say how large the error is; the others say what a map makes of it."""


@dataclass(frozen=True)
class NoiseConfig:
    """The error of the poses: of `error` only the sizes count.

    believed: the noise whose error the mapper is told, "" for this one's own, as repeated runs would tell it.
    most_seeds: so many of the config's at most, 0 = all.
    """

    name: str
    error: MotionError = field(default_factory=MotionError)
    believed: str = ""
    most_seeds: int = 0


DRIFT = MotionError(along=Growth(2e-3, 0.02), across=Growth(5e-4))
TURNS = MotionError(along=Growth(1e-3, 0.01), heading=Growth(1e-4, 0.002), turn=Growth(1e-3, 0.03))
NOISES = (
    NoiseConfig("independent", MotionError(position_m=0.08, heading_rad=0.0175)),
    NoiseConfig("drift", DRIFT),
    NoiseConfig("drift with turns", TURNS),
    NoiseConfig("perfect", believed="drift", most_seeds=10),
)


@dataclass(frozen=True)
class Arm:
    """A way of mapping: what it sets in the common mapping, section by section.

    fusions: the rules of fusion that it is mapped with, () = all. ray_seeds: with sum_of_rays so many of the config's
    seeds at most, 0 = all.
    """

    name: str
    mapping: dict = field(default_factory=dict)
    fusions: tuple[str, ...] = ()
    ray_seeds: int = 0


def arm_of(way: str) -> Arm:
    """The common mapping with this way of stereogrid.motion.WAYS."""
    return Arm(way, {"motion_error": {"way": way}})


@dataclass(frozen=True)
class ClaimConfig:
    """Every parameter of the experiment; the file config.toml of a run holds them.

    worlds: a recorded drive each, of distance_m [m], 0 = all, with a pair every every_m [m]. kept_apart: worlds that
    must not be among them: those that parameters were tuned on. n_seeds: the poses' noise is drawn with the seeds 1, 2,
    ... n_seeds, and for the test of the bound, which takes no map, up to bound_seeds, if that is more; poses without
    noise leave them the cameras' noise, which else is always drawn with camera_seed.
    control_seeds: of the poses that a control shuffles, 0 for no controls. mapping: common to all arms, but for what
    each sets; its error's sizes count for nothing. fusions: of the grid, each with every arm. reference: the arm that
    the others are compared with. bound: whether the hits' claimed errors are tested. surface: whether the maps'
    surfaces are scored.
    """

    worlds: tuple[str, ...] = SCORED
    kept_apart: tuple[str, ...] = TUNING
    n_seeds: int = 20
    bound_seeds: int = 100
    control_seeds: int = 3
    world_seed: int = 0
    every_m: float = 0.25
    distance_m: float = 15.0
    width_px: int = 320
    height_px: int = 240
    camera_faults: str = "mild"
    camera_seed: int = 1
    noises: tuple[NoiseConfig, ...] = NOISES
    fusions: tuple[str, ...] = ("cell", "sum_of_rays")
    arms: tuple[Arm, ...] = tuple(arm_of(way) for way in WAYS)
    reference: str = NONE
    mapping: MappingConfig = field(
        default_factory=lambda: MappingConfig(
            matcher=MatcherConfig("bm", num_disparities=48),
            model=SensorModel(p_free=0.03, p_occupied=0.8, prior=0.3, max_range_m=4.0),
            grid=GridConfig(cell_m=0.1),
        )
    )
    bound: bool = True
    surface: bool = True

    def __post_init__(self) -> None:
        camera_faults(self.camera_faults)
        _distinct("worlds", self.worlds)
        _distinct("fusions", self.fusions)
        _distinct("noises", [noise.name for noise in self.noises])
        _distinct("arms", [arm.name for arm in self.arms])
        both = sorted({*self.worlds} & {*self.kept_apart})
        if both:
            raise InvalidInputError(f"{', '.join(both)}: a world is for tuning or for the claim, never for both")
        for name in ("n_seeds", "bound_seeds", "control_seeds", "world_seed", "camera_seed"):
            if getattr(self, name) < (name == "n_seeds"):
                raise InvalidInputError(f"{name} must be {int(name == 'n_seeds')} or more, not {getattr(self, name)}")
        if self.reference not in self.by_arm:
            raise unknown_name("arm (reference)", self.reference, self.by_arm)
        if set(self.fusions_of(self.by_arm[self.reference])) < {*self.fusions}:
            raise InvalidInputError(f"the reference {self.reference!r} must be mapped with every rule of fusion")
        for arm in self.arms:
            if arm.ray_seeds < 0:
                raise InvalidInputError(f"ray_seeds of {arm.name!r} must be 0 or more, not {arm.ray_seeds}")
        for world in self.worlds:
            self.drive(world)
        for noise in self.noises:
            self.believed(noise)
            if noise.most_seeds < 0:
                raise InvalidInputError(f"most_seeds of {noise.name!r} must be 0 or more, not {noise.most_seeds}")
        for arm in self.arms:
            for fusion in self.fusions_of(arm):
                self.told(arm, self.noises[0], fusion).build_mapper(MINORU)

    @property
    def by_arm(self) -> dict[str, Arm]:
        """The arms by name."""
        return {arm.name: arm for arm in self.arms}

    @property
    def by_noise(self) -> dict[str, NoiseConfig]:
        """The noises by name."""
        return {noise.name: noise for noise in self.noises}

    def fusions_of(self, arm: Arm) -> tuple[str, ...]:
        """The rules of fusion that an arm is mapped with."""
        for fusion in arm.fusions:
            if fusion not in self.fusions:
                raise unknown_name(f"fusion (of arm {arm.name!r})", fusion, self.fusions)
        return arm.fusions or self.fusions

    def others(self, fusion: str) -> list[str]:
        """The arms that are compared with the reference under a rule of fusion."""
        return [arm.name for arm in self.arms if arm.name != self.reference and fusion in self.fusions_of(arm)]

    def seeds(self, noise: NoiseConfig) -> range:
        """The seeds that are drawn of this noise."""
        return range(1, min(self.n_seeds, noise.most_seeds or self.n_seeds) + 1)

    def bounded(self, noise: NoiseConfig) -> range:
        """Those whose claimed errors are tested."""
        most = max(self.n_seeds, self.bound_seeds) if self.bound else 0
        return range(1, min(most, noise.most_seeds or most) + 1)

    def seeds_of(self, arm: Arm, noise: NoiseConfig, fusion: str) -> range:
        """Those of them that an arm is mapped with under a rule of fusion."""
        seeds = self.seeds(noise)
        return seeds[: arm.ray_seeds] if fusion == SUM_OF_RAYS and arm.ray_seeds else seeds

    def drive(self, world: str) -> DriveConfig:
        """The drive through a world."""
        size = {"width_px": self.width_px, "height_px": self.height_px}
        return DriveConfig(world, self.world_seed, self.every_m, self.distance_m, **size)

    def believed(self, noise: NoiseConfig) -> MotionError:
        """The error that the mapper is told where poses have this noise."""
        if noise.believed and noise.believed not in self.by_noise:
            raise unknown_name(f"noise (believed of {noise.name!r})", noise.believed, self.by_noise)
        return self.by_noise[noise.believed].error if noise.believed else noise.error

    def told(self, arm: Arm, noise: NoiseConfig, fusion: str) -> MappingConfig:
        """What maps the poses of this noise by this arm."""
        return telling(self.of_arm(arm, fusion), self.believed(noise))

    def of_arm(self, arm: Arm, fusion: str) -> MappingConfig:
        """The common mapping with what the arm sets."""
        table = merged(asdict(self.mapping), arm.mapping)
        mapping = config_from_table(MappingConfig, table, f"arms.{arm.name}.mapping.")
        return replace(mapping, grid=replace(mapping.grid, fusion=fusion))


@dataclass(frozen=True)
class TuneConfig(ClaimConfig):
    """The same for a tuning: other worlds, fewer seeds, and candidates for arms."""

    worlds: tuple[str, ...] = TUNING
    kept_apart: tuple[str, ...] = SCORED
    n_seeds: int = 4
    control_seeds: int = 0
    fusions: tuple[str, ...] = ("cell",)
    bound: bool = False
    surface: bool = False


def telling(mapping: MappingConfig, error: MotionError) -> MappingConfig:
    """The mapping told of an error of this size; what it makes of it stays."""
    sizes = {name: getattr(error, name) for name in SIZES}
    return replace(mapping, motion_error=replace(mapping.motion_error, **sizes))


def merged(table: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """A nested table with changes to it."""
    both = {**table}
    for key, value in changes.items():
        before = both.get(key)
        both[key] = merged(before, value) if isinstance(before, Mapping) and isinstance(value, Mapping) else value
    return both


def _distinct(what: str, names: Iterable[str]) -> None:
    names = list(names)
    if not names or len(set(names)) < len(names):
        raise InvalidInputError(f"{what} must be one or more, each named once, not {', '.join(names) or 'none'}")
