"""`stereogrid trajectory`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..errors import InvalidInputError, RecordingError, unknown_name
from ..screen import console
from .asked import AskedRecording, asked_recording

if TYPE_CHECKING:
    from ..geometry import FloatArray
    from ..recording import FileRecording

OF = ("camera", "base")


@asked_recording
def trajectory_command(
    asked: AskedRecording,
    out: Annotated[Path, typer.Argument(help="Where to write; .tum or .txt: TUM; .kitti: KITTI.")],
    format: Annotated[str | None, typer.Option("--format", help="tum or kitti, whatever the suffix.")] = None,
    of: Annotated[str, typer.Option(help="camera (the rectified left one) or base.")] = "camera",
) -> None:
    """Write the path of a recording as other programs (evo, KITTI's and TUM's tools) read it.

    TUM: `stamp x y z qx qy qz qw` in world, z up. KITTI: the camera as seen from where it was first, x right, y down,
    z forward.
    """
    from ..geometry import inverse
    from ..recording import check_outside
    from ..trajectory import format_of, save_kitti, save_tum

    if of not in OF:
        raise unknown_name("kind of trajectory", of, OF)
    chosen = format_of(out, format)
    if chosen == "kitti" and of == "base":
        raise InvalidInputError("a KITTI trajectory is of the camera; write that of the base with --format tum")
    check_outside(asked.recording, out)
    source = asked.open()
    for path in (*source.beside, *filter(None, (asked.calibration,))):
        check_outside(path, out)
    stamps_s, poses = _poses(source, asked.poses)
    if of == "base":
        poses = poses @ inverse(source.T_base_cam)
    if chosen == "tum":
        save_tum(out, stamps_s, poses)
    else:
        save_kitti(out, poses)
    unknown = f"; {len(source) - len(poses)} without a true pose left out" if len(poses) < len(source) else ""
    console.print(f"{out}: {len(poses)} poses of the {of} ({chosen}){unknown}", highlight=False, soft_wrap=True)


def _poses(source: "FileRecording", pose_source: str) -> tuple["FloatArray", "FloatArray"]:
    """Stamps (M,) and T_world_cam (M, 4, 4) of the observations that have one."""
    import numpy as np

    if pose_source != "truth":
        return source.stamps_s, source.poses
    poses = source.true_poses()
    if poses is None:
        raise RecordingError(f"{source.path}: carries no true poses; --poses odometry writes those that it claims")
    known = np.isfinite(poses).all(axis=(1, 2))
    return source.stamps_s[known], poses[known]
