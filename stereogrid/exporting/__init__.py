"""Maps in the files of other programs, one file a format."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import InvalidInputError
from ..files import check_writable
from .glb import write_glb
from .map_server import write_map_server
from .octomap import write_bt, write_ot
from .pcd import write_pcd
from .ply import write_ply

if TYPE_CHECKING:
    from ..grid import OccupancyGrid

__all__ = ["EXPORTS", "Format", "check_export", "export"]


@dataclass(frozen=True)
class Format:
    """How one kind of file is written: write(grid, path, **options), and which options there are."""

    write: Callable[..., None]
    options: tuple[str, ...] = ()


EXPORTS = {
    ".bt": Format(write_bt),
    ".glb": Format(write_glb, ("threshold",)),
    ".ot": Format(write_ot),
    ".pcd": Format(write_pcd, ("ascii", "threshold")),
    ".pgm": Format(write_map_server, ("high_m", "low_m")),
    ".ply": Format(write_ply, ("cubes", "threshold")),
    ".yaml": Format(write_map_server, ("high_m", "low_m")),
}


def export(grid: "OccupancyGrid", path: str | Path, **options: Any) -> Path:
    """Write grid to path, beside and then renamed, in the format of its suffix; one of EXPORTS.

    options: threshold, the probability above which a cell is drawn (.ply, .pcd, .glb); cubes, a mesh instead of points
    (.ply); ascii (.pcd); low_m, high_m, the heights that are looked at (.pgm, .yaml). Raises InvalidInputError for
    another suffix or option, or where the map cannot be said in that format, and then writes nothing.
    """
    path = Path(path)
    check_export(path, **options)
    EXPORTS[path.suffix].write(grid, path, **options)
    return path


def check_export(path: Path, **options: Any) -> None:
    """Raise InvalidInputError now when there is no such format or option, or path cannot be written."""
    if path.suffix not in EXPORTS:
        raise InvalidInputError(f"{path}: no format has the suffix {path.suffix!r}; choose from: {', '.join(EXPORTS)}")
    known = EXPORTS[path.suffix].options
    for name in options:
        if name not in known:
            choices = f"choose from: {', '.join(known)}" if known else "it has none"
            raise InvalidInputError(f"{path.suffix} has no option {name!r}; {choices}")
    check_writable(path)
