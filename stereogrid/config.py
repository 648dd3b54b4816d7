"""Every parameter of a run in one TOML file: read, checked, and written back beside the results."""

import difflib
import math
import sys
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields, is_dataclass
from pathlib import Path
from typing import Any, TypeVar, get_type_hints

from .camera import StereoCamera
from .errors import ConfigError, StereogridError
from .files import written_beside
from .grid import OccupancyGrid
from .mapper import Mapper
from .matching import matcher
from .motion import MotionError
from .sensor_model import SensorModel

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

T = TypeVar("T")

TYPICAL_SIGMA_PX = 0.3
USEFUL_SIGMA_M = 0.1
CELLS_A_RANGE = 80


@dataclass(frozen=True)
class MatcherConfig:
    """[matcher]: name of the matcher, disparities searched [px]."""

    name: str = "bm"
    num_disparities: int = 64


@dataclass(frozen=True)
class GridConfig:
    """[grid]: cell size [m], fusion rule, largest absolute log-odds (0 = no limit), memory limit [GB]."""

    cell_m: float = 0.05
    fusion: str = "cell"
    clamp: float = 4.0
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
        chosen = matcher(self.matcher.name, num_disparities=self.matcher.num_disparities)
        return Mapper(camera, chosen, grid, self.motion_error)


def config_from_table(kind: type[T], table: Mapping[str, Any], where: str = "") -> T:
    """A config dataclass from a nested table; unknown keys and values of the wrong type are refused by name."""
    types = get_type_hints(kind)
    names = [f.name for f in fields(kind)]  # type: ignore[arg-type]
    values: dict[str, Any] = {}
    for key, value in table.items():
        if key not in names:
            near = difflib.get_close_matches(key, names, n=1)
            hint = f"; did you mean {near[0]!r}?" if near else ";"
            raise ConfigError(f"unknown key {where + key!r}{hint} choose from: {', '.join(names)}")
        values[key] = _checked(types[key], value, where + key)
    try:
        return kind(**values)
    except StereogridError as error:
        raise ConfigError(f"[{where.rstrip('.') or 'config'}] {error}") from None


def _checked(expected: Any, value: Any, where: str) -> Any:
    if is_dataclass(expected):
        if not isinstance(value, Mapping):
            raise ConfigError(f"{where!r} must be a section, not {value!r}")
        return config_from_table(expected, value, f"{where}.")  # type: ignore[arg-type]
    if expected is float and isinstance(value, int) and not isinstance(value, bool):
        return float(value)
    if type(value) is not expected:
        raise ConfigError(f"{where!r} must be {expected.__name__}, not {value!r}")
    return value


def load_config(kind: type[T], path: str | Path) -> T:
    """A config dataclass from a TOML file. Raises ConfigError naming the file and the culprit."""
    path = Path(path)
    try:
        return config_from_table(kind, tomllib.loads(path.read_text(encoding="utf-8")))
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read ({error.strerror})") from None
    except (ConfigError, tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}: {error}") from None


def save_config(config: Any, path: str | Path) -> None:
    """Write a config dataclass as TOML that load_config reads back to an equal one."""
    import tomli_w

    with written_beside(Path(path)) as temporary:
        temporary.write_text(tomli_w.dumps(asdict(config)), encoding="utf-8")
