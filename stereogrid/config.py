"""Every parameter of a run in one TOML file, written back beside the results."""

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

from .camera import StereoCamera
from .described import Doc, check_fields
from .errors import InvalidInputError, unknown_name
from .grid import DEFAULT_CLAMP, OccupancyGrid
from .grid.fusion import FUSIONS
from .mapper import Mapper
from .matching import MATCHERS, matcher
from .matching.correlation import error_reach
from .matching.onnx_network import NetworkDescription
from .motion import MotionError
from .observation import Matcher
from .sensor_model import SensorModel
from .tomlfile import config_from_table, load_config, save_config

RECORDED = "recorded"
"""In place of a matcher's name: the disparities that the recording itself carries (Observation.disparity)."""
TYPICAL_SIGMA_PX = 0.3
USEFUL_SIGMA_M = 0.1
CELLS_A_RANGE = 80


@dataclass(frozen=True)
class MatcherConfig:
    """How disparities are found. What each field is stands beside it, and in every config.toml.

    The name "recorded" stands for no matcher: the disparities are those that the recording carries.
    """

    name: Annotated[str, Doc("Which matcher.", choices=(*MATCHERS, RECORDED))] = "bm"
    num_disparities: Annotated[
        int, Doc("Disparities searched, from 0 upwards; bm and sgbm need a multiple of 16.", "px", above=0)
    ] = 64
    network: Annotated[str, Doc("The TOML file that describes the network of the matcher onnx; else empty.")] = ""

    def __post_init__(self) -> None:
        check_fields(self, but=("name",))
        if self.network and self.name != "onnx":
            raise InvalidInputError(f"network is for the matcher 'onnx'; {self.name!r} takes none")

    def files(self) -> list[tuple[str, Path]]:
        """What is read from files, as RunRecord.reading takes it: onnx's network and the weights that it names."""
        if not self.network:
            return []
        weights = load_config(NetworkDescription, self.network).weights
        return [("network", Path(self.network)), ("weights", Path(self.network).parent / weights)]

    def build(self) -> Matcher:
        """The matcher. Raises InvalidInputError for one that there is not, "recorded" too."""
        if self.name == RECORDED:
            names = ", ".join(sorted(MATCHERS))
            raise InvalidInputError(
                f"matcher {RECORDED!r} matches no images; where they are to be, choose from: {names}"
            )
        if self.name not in MATCHERS:
            raise unknown_name("matcher", self.name, (*MATCHERS, RECORDED))
        network = {"network": self.network} if self.network else {}
        return matcher(self.name, num_disparities=self.num_disparities, **network)


@dataclass(frozen=True)
class GridConfig:
    """The map's cells, and how readings are fused into them."""

    cell_m: Annotated[float, Doc("Edge of a cell.", "m", above=0)] = 0.05
    fusion: Annotated[
        str, Doc("The rule: one look at a cell an observation, or the literal sum of rays.", choices=tuple(FUSIONS))
    ] = "cell"
    clamp: Annotated[
        tuple[float, ...], Doc("Lowest and highest log-odds that a cell may reach, around 0; [] for no limit.", "nat")
    ] = DEFAULT_CLAMP
    memory_limit_gb: Annotated[float, Doc("The map may not grow beyond it.", "GB", above=0)] = 4.0

    def __post_init__(self) -> None:
        check_fields(self, but=("fusion",))


@dataclass(frozen=True)
class MappingConfig:
    """What turns a recording into a map. The sections of the TOML file bear the names of the fields."""

    matcher: Annotated[MatcherConfig, Doc("How disparities are found.")] = field(default_factory=MatcherConfig)
    model: Annotated[SensorModel, Doc("What one reading says of the cells on its ray.")] = field(
        default_factory=SensorModel
    )
    motion_error: Annotated[MotionError, Doc("How far off poses may be, and what the map makes of it.")] = field(
        default_factory=MotionError
    )
    grid: Annotated[GridConfig, Doc("The map's cells, and how readings are fused into them.")] = field(
        default_factory=GridConfig
    )

    @classmethod
    def for_camera(cls, camera: StereoCamera) -> "MappingConfig":
        """Defaults that suit a camera, where a person gives no others.

        Range: where TYPICAL_SIGMA_PX of disparity is USEFUL_SIGMA_M of depth (Eq. 8). Cells: an eightieth of it,
        rounded down to 1, 2 or 5 times a power of ten. Disparities: an eighth of the width, as OpenCV's samples.
        """
        range_m = float(f"{math.sqrt(USEFUL_SIGMA_M * camera.focal_baseline_px_m / TYPICAL_SIGMA_PX):.3g}")
        power = 10.0 ** math.floor(math.log10(range_m / CELLS_A_RANGE))
        cell_m = max(n * power for n in (1, 2, 5) if n * power <= range_m / CELLS_A_RANGE)
        return cls(
            matcher=MatcherConfig(num_disparities=(camera.width_px // 8 + 15) // 16 * 16),
            model=SensorModel(max_range_m=range_m),
            grid=GridConfig(cell_m=float(f"{cell_m:.1g}")),
        )

    def build_mapper(self, camera: StereoCamera) -> Mapper:
        """A Mapper with an empty grid for recordings of this camera."""
        grid = OccupancyGrid(
            self.grid.cell_m,
            model=self.model,
            fusion=self.grid.fusion,
            clamp=self.grid.clamp or None,
            memory_limit_gb=self.grid.memory_limit_gb,
        )
        matcher = None if self.matcher.name == RECORDED else self.matcher.build()
        return Mapper(camera, matcher, grid, self.motion_error, reach=error_reach(self.matcher.name))


__all__ = [
    "RECORDED",
    "GridConfig",
    "MappingConfig",
    "MatcherConfig",
    "config_from_table",
    "load_config",
    "save_config",
]
