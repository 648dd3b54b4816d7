"""What the claim is tested on: worlds, noises of the poses, and arms, all in one TOML file."""

from collections.abc import Iterable
from dataclasses import asdict, dataclass, field, replace
from typing import Annotated

from sim.faults import camera_faults
from sim.rig import MINORU
from stereogrid.config import GridConfig, MappingConfig, MatcherConfig, config_from_table
from stereogrid.described import Doc, check_fields
from stereogrid.errors import InvalidInputError, unknown_name
from stereogrid.motion import WAYS, Growth, MotionError
from stereogrid.sensor_model import SensorModel
from stereogrid.tomlfile import merged

from .drives import CAMERA_FAULTS, DISTANCE, EVERY, DriveConfig

SCORED, TUNING = ("corridor", "office", "entrance"), ("warehouse", "outdoor")
NONE = "none"
SUM_OF_RAYS = "sum_of_rays"
SIZES = ("position_m", "heading_rad", "along", "across", "heading", "turn")
"""The fields of a MotionError that say how large the error is; the others say what a map makes of it."""


@dataclass(frozen=True)
class NoiseConfig:
    """The error of the poses."""

    name: Annotated[str, Doc("What tables call it.")]
    error: Annotated[MotionError, Doc("Of which only the sizes count.")] = field(default_factory=MotionError)
    believed: Annotated[
        str, Doc("The noise whose error the mapper is told; empty: this one's own, as repeated runs would tell it.")
    ] = ""
    most_seeds: Annotated[int, Doc("At most so many of the config's seeds; 0: all.", least=0)] = 0


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
    """A way of mapping."""

    name: Annotated[str, Doc("What tables call it.")]
    mapping: Annotated[dict, Doc("What it sets in the common mapping, section by section.")] = field(
        default_factory=dict
    )
    fusions: Annotated[tuple[str, ...], Doc("The rules of fusion that it is mapped with; []: all.")] = ()
    ray_seeds: Annotated[int, Doc("With sum_of_rays at most so many of the config's seeds; 0: all.", least=0)] = 0


def arm_of(way: str) -> Arm:
    """The common mapping with this way of stereogrid.motion.WAYS."""
    return Arm(way, {"motion_error": {"way": way}})


@dataclass(frozen=True)
class ClaimConfig:
    """Every parameter of the experiment; the file config.toml of a run holds them."""

    worlds: Annotated[tuple[str, ...], Doc("A recorded drive each.")] = SCORED
    kept_apart: Annotated[
        tuple[str, ...], Doc("Worlds that must not be among them: those that parameters were tuned on.")
    ] = TUNING
    n_seeds: Annotated[
        int,
        Doc(
            "The poses' noise is drawn with the seeds 1, 2, ... so many; where poses have none, the cameras' noise is.",
            least=1,
        ),
    ] = 20
    bound_seeds: Annotated[
        int, Doc("The same for the test of the bound, which takes no map, if it is more.", least=0)
    ] = 100
    control_seeds: Annotated[int, Doc("Of the poses that a control shuffles; 0: no controls.", least=0)] = 3
    world_seed: Annotated[int, Doc("Paints and furnishes the worlds.", least=0)] = 0
    every_m: Annotated[float, EVERY] = 0.25
    distance_m: Annotated[float, DISTANCE] = 15.0
    width_px: Annotated[int, Doc("Width of the images.", "px", above=0)] = 320
    height_px: Annotated[int, Doc("Height of the images.", "px", above=0)] = 240
    camera_faults: Annotated[str, CAMERA_FAULTS] = "mild"
    camera_seed: Annotated[int, Doc("Draws the cameras' noise, where n_seeds does not.", least=0)] = 1
    noises: Annotated[tuple[NoiseConfig, ...], Doc("The errors of the poses.")] = NOISES
    fusions: Annotated[tuple[str, ...], Doc("Rules of fusion of the grid, each with every arm.")] = (
        "cell",
        "sum_of_rays",
    )
    arms: Annotated[tuple[Arm, ...], Doc("The ways of mapping that are compared.")] = tuple(arm_of(way) for way in WAYS)
    reference: Annotated[str, Doc("The arm that the others are compared with.")] = NONE
    mapping: Annotated[
        MappingConfig, Doc("Common to all arms, but for what each sets; its error's sizes count for nothing.")
    ] = field(
        default_factory=lambda: MappingConfig(
            matcher=MatcherConfig("bm", num_disparities=48),
            model=SensorModel(p_free=0.03, p_occupied=0.8, prior=0.3, max_range_m=4.0),
            grid=GridConfig(cell_m=0.1),
        )
    )
    bound: Annotated[bool, Doc("Whether the hits' claimed errors are tested.")] = True
    surface: Annotated[bool, Doc("Whether the maps' surfaces are scored.")] = True

    def __post_init__(self) -> None:
        camera_faults(self.camera_faults)
        _distinct("worlds", self.worlds)
        _distinct("fusions", self.fusions)
        _distinct("noises", [noise.name for noise in self.noises])
        _distinct("arms", [arm.name for arm in self.arms])
        both = sorted({*self.worlds} & {*self.kept_apart})
        if both:
            raise InvalidInputError(f"{', '.join(both)}: a world is for tuning or for the claim, never for both")
        check_fields(self)
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


def _distinct(what: str, names: Iterable[str]) -> None:
    names = list(names)
    if not names or len(set(names)) < len(names):
        raise InvalidInputError(f"{what} must be one or more, each named once, not {', '.join(names) or 'none'}")
