"""`stereogrid map`."""

import sys
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from ..errors import InvalidInputError
from ..screen import console, print_scores, track, warn_of
from .asked import AskedRecording, asked_recording
from .chosen import chosen_config
from .options import (
    RUNS,
    CellOption,
    ConfigOption,
    DisparitiesOption,
    MatcherOption,
    MotionOption,
    NetworkOption,
    RangeOption,
    RunsOption,
    SetOption,
)


@asked_recording
def map_command(
    asked: AskedRecording,
    out: Annotated[Path | None, typer.Option(help="Also save the map here (.sgrid).")] = None,
    config: ConfigOption = None,
    matcher: MatcherOption = None,
    network: NetworkOption = None,
    num_disparities: DisparitiesOption = None,
    cell: CellOption = None,
    max_range: RangeOption = None,
    motion: MotionOption = None,
    score: Annotated[
        bool | None,
        typer.Option(
            "--score/--no-score",
            help="Score the map against the recording's truth.  [where it carries one]",
            show_default=False,
        ),
    ] = None,
    settings: SetOption = None,
    runs: RunsOption = RUNS,
) -> None:
    """Map a recording: runs/<stamp>-<name>/ gets the map, figures, metrics.json, config.toml and report.html."""
    from ..map_report import headline_of
    from ..mapping_run import map_recording

    if out is not None and out.suffix.lower() != ".sgrid":
        raise InvalidInputError(f"{out}: a map's name must end with .sgrid; `stereogrid export` writes others")
    source = asked.open()
    warn_of(source)
    chosen = chosen_config(
        source.camera,
        config,
        recording=source,
        matcher=matcher,
        network=network,
        num_disparities=num_disparities,
        cell=cell,
        max_range=max_range,
        motion=motion,
        settings=settings,
    )
    result = map_recording(
        asked.claiming(source),
        chosen,
        name=asked.recording.resolve().stem,
        runs=runs,
        out=out,
        record=replace(asked.record("map", " ".join(["stereogrid", *sys.argv[1:]])), score=score),
        track=track,
        score=score,
        truth_of=source,
    )
    print_scores(headline_of(result.scores))
    console.print(f"{result.grid!r}\n{result.folder}", highlight=False, soft_wrap=True)
