"""`python -m sim record corridor --out drive.mcap`; firmware, view and export beside it."""

from stereogrid.early import end_at_once

if __name__ == "__main__":
    end_at_once()

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import Progress

from stereogrid.cli import run, was_interrupted
from stereogrid.interrupts import undisturbed

WorldName = Annotated[str, typer.Argument(help="corridor, entrance, office, outdoor or warehouse.")]

app = typer.Typer(no_args_is_help=True, add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)


@app.callback()
def sim() -> None:
    """The simulated robot: drive it, and record what it sees."""


@app.command(epilog="Example: python -m sim record corridor --out drive.mcap --seed 3 --distance 5")
def record(
    world: WorldName,
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
    people: Annotated[int, typer.Option(help="So many people walk about.")] = 0,
    payload: Annotated[float, typer.Option(help="Carried on the robot's top plate [kg].")] = 0.0,
    renderer: Annotated[str, typer.Option(help='"bullet" is a quick look, never for scores.')] = "raster",
) -> None:
    """Drive through a world and record stereo pairs, odometry and the truth as an MCAP file."""
    # Imported here for the reasons that stereogrid.cli gives.
    with undisturbed():
        from .record import record_drive
        from .rig import StereoRig, mount, webcam

    camera = webcam(width, height, focal_px=focal, baseline_m=baseline)
    rig = StereoRig(camera, mount(height_m=camera_height, pitch_rad=pitch, baseline_m=baseline))
    console = Console(stderr=True)
    earlier = out.exists()
    with Progress(console=console, transient=True, disable=not console.is_terminal) as bar, _telling(out, earlier):
        task = bar.add_task(f"driving through {world}", total=1.0)
        record_drive(
            out,
            world=world,
            seed=seed,
            people=people,
            payload_kg=payload,
            renderer=renderer,
            rig=rig,
            every_m=every,
            max_distance_m=distance,
            progress=lambda share: bar.update(task, completed=share),
        )
    print(f"{out}: {out.stat().st_size / 1e6:.1f} MB")


@contextmanager
def _telling(out: Path, earlier: bool) -> Iterator[None]:
    """Tell of the part of a drive that an interrupt leaves."""
    try:
        yield
    except (KeyboardInterrupt, SystemError) as error:
        if was_interrupted(error) and out.exists() and not earlier:
            print(f"{out} keeps the drive up to there", file=sys.stderr)
        raise


@app.command(epilog="Example: python -m sim spoil drive.mcap --out webcam.mcap --cameras minoru --wheels worn --seed 1")
def spoil(
    recording: Annotated[Path, typer.Argument(help="A drive that `record` wrote.")],
    out: Annotated[Path, typer.Option(help="The MCAP file to write.")],
    cameras: Annotated[
        str, typer.Option(help="ideal, mild, minoru or bad, and parts of it as ,part=number.")
    ] = "minoru",
    wheels: Annotated[str, typer.Option(help="none, good or worn.")] = "none",
    seed: Annotated[int, typer.Option(help="Of all the faults.")] = 0,
) -> None:
    """Write a drive as a rig with faults would have recorded it: what the experiments do while they read."""
    with undisturbed():
        from .spoil import spoil as write_spoilt

    console = Console(stderr=True)
    with Progress(console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task("spoiling", total=1.0)
        write_spoilt(
            recording,
            out,
            cameras=cameras,
            wheels=wheels,
            seed=seed,
            progress=lambda share: bar.update(task, completed=share),
        )
    print(f"{out}: {out.stat().st_size / 1e6:.1f} MB")


@app.command(epilog="Example: python -m sim firmware corridor --port 8101 --camera")
def firmware(
    world: WorldName,
    port: Annotated[int, typer.Option(help="The TCP port, on this machine's loopback.")] = 8101,
    pty: Annotated[bool, typer.Option("--pty", help="A pseudo-terminal instead, whose path is printed.")] = False,
    subclass: Annotated[str, typer.Option(help="p3at or p3at-sh.")] = "p3at",
    seed: Annotated[int, typer.Option(help="Paints and furnishes the world.")] = 0,
    battery: Annotated[float, typer.Option(help="The battery at the start [V].")] = 12.9,
    payload: Annotated[float, typer.Option(help="Carried on the robot's top plate [kg].")] = 0.0,
    people: Annotated[int, typer.Option(help="So many people walk about.")] = 0,
    camera: Annotated[bool, typer.Option("--camera", help="Serve the two cameras as MJPEG over HTTP.")] = False,
    camera_port: Annotated[int, typer.Option(help="The cameras' TCP port.")] = 8102,
    width: Annotated[int, typer.Option(help="Image width [px].")] = 320,
    height: Annotated[int, typer.Option(help="Image height [px].")] = 240,
    fps: Annotated[float, typer.Option(help="Pairs a second, at most.")] = 15.0,
) -> None:
    """A simulated Pioneer 3-AT that any ARCOS client can connect to and drive, until Ctrl-C."""
    try:
        with undisturbed():
            from .firmware.eyes import EyeSettings
            from .firmware.serve import serve

        serve(
            world,
            seed=seed,
            subclass=subclass,
            port=None if pty else port,
            battery_v=battery,
            payload_kg=payload,
            people=people,
            eyes=EyeSettings(camera_port, width, height, fps) if camera else None,
            say=lambda line: print(line, flush=True),
            log=lambda line: print(line, file=sys.stderr, flush=True),
        )
    except (KeyboardInterrupt, SystemError) as error:
        if not was_interrupted(error):
            raise
    print("stopped", file=sys.stderr)


@app.command(epilog="Example: python -m sim view outdoor --out outdoor.png --at 12")
def view(
    world: WorldName,
    out: Annotated[Path | None, typer.Option(help="Write a picture here (.png) instead of serving a page.")] = None,
    at: Annotated[float | None, typer.Option(help="Where the robot stands in the picture, along its path [m].")] = None,
    seed: Annotated[int, typer.Option(help="Paints and furnishes the world.")] = 0,
    people: Annotated[int, typer.Option(help="So many people walk about.")] = 0,
    port: Annotated[int, typer.Option(help="The page's TCP port on this machine's loopback; 0: any.")] = 0,
) -> None:
    """Show a world, the robot and its two images: as a picture, or as a page with the robot on its way."""
    with undisturbed():
        from .viewing.live import serve_view
        from .viewing.picture import draw_picture
        from .worlds.world import make_world

    scene = make_world(world, seed, people=people)
    if out is not None:
        print(draw_picture(scene, out, at_m=at))
        return
    serve_view(scene, port=port, say=lambda line: print(line, flush=True))
    print("stopped", file=sys.stderr)


@app.command(epilog="Example: python -m sim export corridor --out corridor.glb")
def export(
    world: WorldName,
    out: Annotated[Path, typer.Option(help="The mesh file to write, .glb or .ply.")],
    seed: Annotated[int, typer.Option(help="Paints and furnishes the world.")] = 0,
) -> None:
    """Write a world's true mesh [m] for other programs, without what moves in it."""
    with undisturbed():
        from .viewing.export import check_mesh_file, export_world
        from .worlds.world import make_world

    check_mesh_file(out)
    print(export_world(make_world(world, seed), out))


@app.command(epilog="Example: python -m sim turning")
def turning() -> None:
    """Measure how much further the wheels run than the robot turns, on every ground; the real robot has 1.477."""
    with undisturbed():
        from .robot.turning import measure, summary

    for line in summary(measure()):
        print(line, flush=True)


@app.command(epilog="Example: python -m sim chessboard --out boards --faults minoru,distortion_k1=-0.1")
def chessboard(
    out: Annotated[Path, typer.Option(help="The folder to write left01.png, right01.png, ... in.")],
    faults: Annotated[str, typer.Option(help="Of the cameras: a preset, and parts of it as ,part=number.")] = "minoru",
    seed: Annotated[int, typer.Option(help="Of the poses, the faults and the room.")] = 0,
    count: Annotated[int, typer.Option(help="How many pairs.")] = 18,
    columns: Annotated[int, typer.Option(help="Inner corners in a row of the board.")] = 9,
    rows: Annotated[int, typer.Option(help="Inner corners in a column of it.")] = 6,
    square: Annotated[float, typer.Option(help="Side of its squares [m].")] = 0.025,
) -> None:
    """Photograph a chessboard with the virtual rig: raw pairs to calibrate from."""
    with undisturbed():
        from stereogrid.calibration import Chessboard

        from .chessboard import ChessboardSession, write_pairs
        from .faults import camera_faults

    session = ChessboardSession(Chessboard(columns, rows, square), camera_faults(faults), seed, count)
    written = write_pairs(session, out)
    truth = session.truth()
    print(
        f"{out}: {written} pairs; true focal length {truth.K[0][0, 0]:.1f} px, baseline {truth.baseline_m * 1e3:.2f} mm"
    )


if __name__ == "__main__":
    sys.exit(run(app))
