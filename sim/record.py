"""Recording a simulated drive."""

from collections.abc import Callable
from contextlib import closing
from pathlib import Path

from stereogrid.errors import InvalidInputError
from stereogrid.recording.mcap import McapWriter

from .rig import StereoRig
from .source import Drive
from .world import make_world


def record_drive(
    path: str | Path,
    *,
    world: str = "corridor",
    seed: int = 0,
    rig: StereoRig | None = None,
    every_m: float = 0.2,
    max_distance_m: float | None = None,
    workers: int = 2,
    progress: Callable[[float], None] | None = None,
) -> Path:
    """Drive through a world and write what the robot saw, with the truth, as an MCAP file; returns its path.

    progress is called with the share of the path done, 0 to 1. Arguments are checked before the file is made;
    when the drive is interrupted the file holds the part that was driven. Same arguments, same bytes.
    Raises InvalidInputError for an unknown world or a number out of range, SimulationError for a stuck robot.
    """
    path = Path(path)
    if seed < 0:
        raise InvalidInputError(f"seed must be >= 0, not {seed}")
    if not path.parent.is_dir():
        raise InvalidInputError(f"{path.parent}: no such folder to write {path.name} in")
    drive = Drive(
        make_world(world, seed), rig or StereoRig(), every_m=every_m, max_distance_m=max_distance_m, workers=workers
    )
    metadata = {"world": world, "seed": str(seed), "every_m": str(every_m), "source": "sim"}
    mesh = drive.world.mesh().export(file_type="ply")
    with (
        McapWriter(path, drive.camera, drive.T_base_cam, metadata=metadata, truth_mesh_ply=mesh) as writer,
        closing(iter(drive)) as observations,
    ):
        for observation in observations:
            writer.write(observation)
            if progress is not None:
                progress(drive.progress)
    return path
