"""`python -m sim record corridor --out drive.mcap`."""

import sys
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import Progress

from stereogrid.cli import run

app = typer.Typer(no_args_is_help=True, add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)


@app.callback()
def sim() -> None:
    """The simulated robot: drive it, and record what it sees."""


@app.command(epilog="Example: python -m sim record corridor --out drive.mcap --seed 3 --distance 5")
def record(
    world: Annotated[str, typer.Argument(help="The world to drive through, e.g. corridor.")],
    out: Annotated[Path, typer.Option(help="The MCAP file to write.")],
    seed: Annotated[int, typer.Option(help="Paints and furnishes the world.")] = 0,
    every: Annotated[float, typer.Option(help="Distance between two pairs [m].")] = 0.2,
    width: Annotated[int, typer.Option(help="Image width [px].")] = 640,
    height: Annotated[int, typer.Option(help="Image height [px].")] = 480,
    baseline: Annotated[float, typer.Option(help="Distance of the two cameras [m].")] = 0.06,
    focal: Annotated[float | None, typer.Option(help="Focal length [px]; by default 42 degrees of width.")] = None,
    camera_height: Annotated[float, typer.Option(help="Height of the lenses [m].")] = 0.40,
    pitch: Annotated[float, typer.Option(help="Look down by this much [rad].")] = 0.0,
    distance: Annotated[float | None, typer.Option(help="Stop after this much of the path [m].")] = None,
) -> None:
    """Drive through a world and record stereo pairs, odometry and the truth as an MCAP file."""
    # Imported here for the reasons that stereogrid.cli gives.
    from stereogrid.camera import StereoCamera

    from .record import record_drive
    from .rig import MINORU, StereoRig, mount

    camera = StereoCamera(
        focal_px=focal if focal is not None else MINORU.focal_px * width / MINORU.width_px,
        cx_px=(width - 1) / 2,
        cy_px=(height - 1) / 2,
        baseline_m=baseline,
        width_px=width,
        height_px=height,
    )
    rig = StereoRig(camera, mount(height_m=camera_height, pitch_rad=pitch, baseline_m=baseline))
    console = Console(stderr=True)
    with Progress(console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task(f"driving through {world}", total=1.0)
        record_drive(
            out,
            world=world,
            seed=seed,
            rig=rig,
            every_m=every,
            max_distance_m=distance,
            progress=lambda share: bar.update(task, completed=share),
        )
    print(f"{out}: {out.stat().st_size / 1e6:.1f} MB")


if __name__ == "__main__":
    sys.exit(run(app))
