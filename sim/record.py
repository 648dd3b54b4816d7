"""Recording a simulated drive."""

from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh

from stereogrid.errors import InvalidInputError
from stereogrid.recording.mcap import McapWriter

from .rig import StereoRig
from .robot.pioneer import SimulationError
from .source import Drive
from .worlds.world import WorldPlan

ENDED = "ended early"
"""In the metadata of a drive that could not be driven to its end: why."""


def record_drive(
    path: str | Path,
    *,
    world: str = "corridor",
    seed: int = 0,
    people: int = 0,
    renderer: str = "raster",
    rig: StereoRig | None = None,
    every_m: float = 0.2,
    max_distance_m: float | None = None,
    payload_kg: float = 0.0,
    workers: int = 2,
    progress: Callable[[float], None] | None = None,
) -> Path:
    """Drive through a world and write what the robot saw, with the truth, as an MCAP file; returns its path.

    world, seed, people: see world.WorldPlan. renderer: a name in renderers.RENDERERS. payload_kg: on the robot's plate.
    progress is called with the share of the path done, 0 to 1. Arguments are checked before the file is made;
    when the drive is interrupted the file holds the part that was driven. Same arguments, same bytes.
    Raises InvalidInputError for an unknown world or a number out of range; SimulationError for a robot that is stuck
    or fell, with the file finished and kept.
    """
    path = Path(path)
    plan = WorldPlan(world, seed, people)
    if path.suffix.lower() != ".mcap":
        raise InvalidInputError(f"{path}: a recording is an MCAP file, so its name must end with .mcap")
    if not path.parent.is_dir():
        raise InvalidInputError(f"{path.parent}: no such folder to write {path.name} in")
    drive = Drive(
        plan.make(),
        rig or StereoRig(),
        every_m=every_m,
        max_distance_m=max_distance_m,
        payload_kg=payload_kg,
        renderer=renderer,
        workers=workers,
    )
    about = {"every_m": str(every_m), "payload_kg": str(payload_kg), "renderer": renderer, "source": "sim"}
    with McapWriter(
        path,
        drive.camera,
        drive.T_base_cam,
        metadata={**plan.metadata(), **about},
        truth_mesh_ply=_ply(drive.world.mesh()),
        mover_meshes_ply={mover.name: _ply(mover.mesh()) for mover in drive.world.movers},
    ) as writer:
        _write(drive, writer, progress)
    return path


def _write(drive: Drive, writer: McapWriter, progress: Callable[[float], None] | None) -> None:
    """Drive, and write all that is seen; a file without a pair is taken away, since nothing could read it."""
    ticks, pairs = _TicksWritten(drive, writer), 0
    try:
        with closing(iter(drive)) as observations:
            for observation in observations:
                ticks.write_until(observation.stamp_s)
                writer.write(observation)
                pairs += 1
                if progress is not None:
                    progress(drive.progress)
    except SimulationError as error:
        writer.write_note(ENDED, str(error))
        raise SimulationError(f"{error}; {writer.path} keeps the drive up to there") from error
    finally:
        ticks.write_until(np.inf)
        if not pairs:
            writer.path.unlink(missing_ok=True)


@dataclass
class _TicksWritten:
    """Writes the ticks of a drive as their time comes, so that a file that is cut off holds what led to its end."""

    drive: Drive
    writer: McapWriter
    count: int = 0

    def write_until(self, stamp_s: float) -> None:
        ticks = self.drive.ticks
        while self.count < len(ticks) and ticks[self.count].stamp_s <= stamp_s:
            self.writer.write_tick(*ticks[self.count])
            self.count += 1


def _ply(mesh: trimesh.Trimesh) -> bytes:
    ply: bytes = mesh.export(file_type="ply")
    return ply
