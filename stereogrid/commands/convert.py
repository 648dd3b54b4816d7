"""`stereogrid convert`."""

from pathlib import Path
from typing import Annotated

import typer

from ..errors import InvalidInputError
from ..screen import bar, console, progress_console, warn_of
from .asked import AskedRecording, asked_recording


@asked_recording
def convert_command(
    asked: AskedRecording,
    out: Annotated[str, typer.Argument(help="Where to write: *.mcap, or, with a / at its end, a ROS 2 bag.")],
    to: Annotated[
        str | None, typer.Option(help="mcap, ros2 (a bag's folder) or kitti (a KITTI-odometry folder).")
    ] = None,
    raw: Annotated[bool, typer.Option("--raw", help="Keep raw pictures and all that the robot told.")] = False,
) -> None:
    """Write any recording as an MCAP file of ours, as a ROS 2 bag, or as a KITTI-odometry folder."""
    from ..recording import check_target, convert, lost_gravity

    kind = check_target(asked.recording, out, to)
    if asked.poses == "truth":
        raise InvalidInputError(
            "a converted recording claims the poses that it claimed, and keeps true ones beside them"
        )
    source = asked.open()
    warn_of(source)
    lost = lost_gravity(source, kind)
    if lost is not None:
        progress_console.print(f"warning: {out}: {lost}", highlight=False, markup=False, soft_wrap=True)
    with bar(f"writing {out}") as progress:
        convert(source, out, kind, raw=raw, origin=_origin(asked), progress=progress)
    size_mb = sum(each.stat().st_size for each in [Path(out), *Path(out).rglob("*")] if each.is_file()) / 1e6
    console.print(f"{out}: {len(source)} observations, {size_mb:.1f} MB", highlight=False, soft_wrap=True)


def _origin(asked: AskedRecording) -> str:
    parts = [asked.recording.resolve().name]
    if asked.start or asked.end is not None:
        parts.append(f"from {asked.start:g} s" + ("" if asked.end is None else f" to {asked.end:g} s"))
    if asked.stride > 1:
        parts.append(f"every {asked.stride}th observation")
    return ", ".join(parts)
