"""Options that several commands have."""

from pathlib import Path
from typing import Annotated

import typer

MapPath = Annotated[Path, typer.Argument(help="A map file: .sgrid, or OctoMap's .bt or .ot.")]
ConfigOption = Annotated[Path | None, typer.Option(help="A config.toml; the options below override it.")]
MATCHER_NAMES = ("bm", "gc", "kz2", "onnx", "recorded", "sgbm")
"""For the shell's completion, which has no time to import the matchers."""


def _matchers(begun: str) -> list[str]:
    return [name for name in MATCHER_NAMES if name.startswith(begun)]


MatcherOption = Annotated[
    str | None,
    typer.Option(
        help="bm, sgbm, gc, kz2, onnx or recorded (disparities that the recording carries).", autocompletion=_matchers
    ),
]
NetworkOption = Annotated[Path | None, typer.Option(help="The TOML file that describes onnx's network.")]
DisparitiesOption = Annotated[int | None, typer.Option(help="Disparities searched [px].")]
CellOption = Annotated[float | None, typer.Option(help="Edge of a cell [m].")]
RangeOption = Annotated[float | None, typer.Option("--range", help="Depths used up to here [m].")]
MotionOption = Annotated[Path | None, typer.Option(help="A motion.toml, as motion-error writes it.")]
SetOption = Annotated[
    list[str] | None,
    typer.Option("--set", help="A parameter of config.toml, as in grid.clamp=[-3.5,3.5]; may be given again."),
]
RunsOption = Annotated[Path, typer.Option(help="Folder of the run folders.")]
RUNS = Path("runs")
