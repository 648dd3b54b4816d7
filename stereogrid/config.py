"""Every parameter of a run in one TOML file, written back beside the results."""

import math
from dataclasses import dataclass, field

from .camera import StereoCamera
from .errors import InvalidInputError
from .grid import DEFAULT_CLAMP, OccupancyGrid
from .mapper import Mapper
from .matching import matcher
from .matching.correlation import error_reach
from .motion import MotionError
from .observation import Matcher
from .sensor_model import SensorModel
from .tomlfile import config_from_table, load_config, save_config

TYPICAL_SIGMA_PX = 0.3
USEFUL_SIGMA_M = 0.1
CELLS_A_RANGE = 80


@dataclass(frozen=True)
class MatcherConfig:
    """[matcher]: name of the matcher, disparities searched [px]; network: the TOML file that describes onnx's."""

    name: str = "bm"
    num_disparities: int = 64
    network: str = ""

    def __post_init__(self) -> None:
        if self.network and self.name != "onnx":
            raise InvalidInputError(f"network is for the matcher 'onnx'; {self.name!r} takes none")

    def build(self) -> Matcher:
        """The matcher. Raises InvalidInputError for one that there is not."""
        network = {"network": self.network} if self.network else {}
        return matcher(self.name, num_disparities=self.num_disparities, **network)


@dataclass(frozen=True)
class GridConfig:
    """[grid]: cell size [m], fusion rule, lowest and highest log-odds ([] = no limit), memory limit [GB]."""

    cell_m: float = 0.05
    fusion: str = "cell"
    clamp: tuple[float, ...] = DEFAULT_CLAMP
    memory_limit_gb: float = 4.0


@dataclass(frozen=True)
class MappingConfig:
    """What turns a recording into a map. The sections of the TOML file bear the names of the fields."""

    matcher: MatcherConfig = field(default_factory=MatcherConfig)
    model: SensorModel = field(default_factory=SensorModel)
    motion_error: MotionError = field(default_factory=MotionError)
    grid: GridConfig = field(default_factory=GridConfig)

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
        return Mapper(camera, self.matcher.build(), grid, self.motion_error, reach=error_reach(self.matcher.name))


__all__ = ["GridConfig", "MappingConfig", "MatcherConfig", "config_from_table", "load_config", "save_config"]
