"""A recording as a rig with faults would have made it, written to a file of its own: for those who work from files."""

from collections.abc import Callable
from pathlib import Path

from stereogrid.errors import InvalidInputError, RecordingError
from stereogrid.files import written_beside
from stereogrid.observation import Recording
from stereogrid.recording import McapRecording, McapWriter

from .faults import FaultyCameras, camera_faults
from .robot.wheel_faults import FaultyWheels, wheel_faults

NONE = wheel_faults("none")


def spoil(
    recording: Path,
    out: Path,
    *,
    cameras: str = "minoru",
    wheels: str = "none",
    seed: int = 0,
    progress: Callable[[float], None] = lambda _: None,
) -> Path:
    """Write a simulated drive with the faults of its cameras and wheels to `out` (.mcap); its truth stays.

    cameras: a text for camera_faults; wheels: a preset of wheel_faults; seed: of both. Times are the left camera's.
    Raises InvalidInputError for what is not known, RecordingError when the recording cannot be read, holds no ticks
    that these faults need, or `out` exists.
    """
    faults, of_wheels = camera_faults(cameras), wheel_faults(wheels)
    if seed < 0:
        raise InvalidInputError(f"seed must be >= 0, not {seed}")
    drive = McapRecording(recording)
    if "camera_faults" in drive.metadata:
        had = drive.metadata["camera_faults"]
        raise RecordingError(f"{recording}: has faults already ({had}); spoil the drive itself")
    seen: Recording = FaultyCameras(drive, faults, seed)
    if of_wheels != NONE:
        seen = FaultyWheels(seen, of_wheels, seed)
    known = {key: text for key, text in drive.metadata.items() if key not in ("format_version", "stereogrid_version")}
    metadata = {**known, "camera_faults": cameras, "wheel_faults": wheels, "faults_seed": str(seed)}
    if out.exists():
        raise InvalidInputError(f"{out}: exists already; choose another path")
    mesh = drive.truth_mesh_ply()
    with (
        written_beside(out) as path,
        McapWriter(
            path, seen.camera, seen.T_base_cam, metadata=metadata, truth_mesh_ply=mesh, overwrite=True
        ) as writer,
    ):
        for number, observation in enumerate(seen):
            writer.write(observation)
            progress((number + 1) / len(seen))
    return out
