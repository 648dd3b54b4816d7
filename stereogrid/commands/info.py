"""`stereogrid info`."""

from collections.abc import Iterator
from typing import TYPE_CHECKING

from ..errors import RecordingError
from ..screen import console
from .asked import AskedRecording, asked_recording

if TYPE_CHECKING:
    from ..recording import FileRecording


@asked_recording
def info(asked: AskedRecording) -> None:
    """Say what a recording or a map (.sgrid, OctoMap's .bt or .ot) holds."""
    if asked.recording.suffix in (".sgrid", ".bt", ".ot"):
        from ..grid import OccupancyGrid

        console.print(repr(OccupancyGrid.load(asked.recording)), highlight=False, soft_wrap=True)
        return
    from ..recording import UnusableBagError, kind_of

    try:
        source = asked.open()
    except UnusableBagError as error:
        for topic, (kind, count) in error.topics.items():
            console.print(f"{topic}: {kind}, {count} messages", highlight=False, markup=False, soft_wrap=True)
        # They stand above, a line each.
        raise RecordingError(str(error).replace(error.listed, "") if error.topics else str(error)) from error
    for line in _told(source, kind_of(asked.recording)):
        console.print(line, highlight=False, markup=False, soft_wrap=True)


def _told(source: "FileRecording", kind: str) -> Iterator[str]:
    yield _drive(source, kind)
    yield _camera(source)
    yield _mount(source)
    yield f"truth: {', '.join(_truth(source)) or 'none; its poses are what it claims'}"
    for key, value in source.metadata.items():
        lines = value.splitlines() or [""]
        yield f"{key}: {lines[0]}" + (f" ... ({len(lines)} lines)" if len(lines) > 1 else "")
    yield from source.notes()
    for what, count in source.left_out.items():
        yield f"left out: {count} {what}"
    if source.damage is not None:
        yield f"incomplete: {source.damage}"


def _drive(source: "FileRecording", kind: str) -> str:
    import numpy as np

    n, duration_s = len(source), float(source.stamps_s[-1] - source.stamps_s[0])
    length_m = float(np.linalg.norm(np.diff(source.poses[:, :3, 3], axis=0), axis=1).sum())
    rate = f" ({(n - 1) / duration_s:.2f} Hz)" if n > 1 else ""
    return f"{kind}: {n} observation{'s' * (n != 1)} in {duration_s:.3f} s{rate}, path {length_m:.2f} m"


def _camera(source: "FileRecording") -> str:
    import numpy as np

    camera = source.camera
    width_deg = np.degrees(
        np.arctan(camera.cx_px / camera.focal_px) + np.arctan((camera.width_px - 1 - camera.cx_px) / camera.focal_px)
    )
    return (
        f"camera: {camera.width_px} x {camera.height_px} px, focal length {camera.focal_px:.2f} px ({width_deg:.0f} "
        f"degrees wide), centre ({camera.cx_px:.2f}, {camera.cy_px:.2f}) px, baseline {camera.baseline_m:.4f} m"
    )


def _mount(source: "FileRecording") -> str:
    import numpy as np

    x, y, z = source.T_base_cam[:3, 3]
    # Of the camera's axis, its z.
    down_deg = round(float(np.degrees(np.arcsin(np.clip(-source.T_base_cam[2, 2], -1, 1)))), 1) + 0.0
    return f"mount: left camera in base at ({x:.3f}, {y:.3f}, {z:.3f}) m, looking {down_deg} degrees down"


def _truth(source: "FileRecording") -> Iterator[str]:
    import numpy as np

    poses = source.true_poses()
    if poses is not None:
        yield f"poses of {int(np.isfinite(poses).all(axis=(1, 2)).sum())} observations"
    if source.truth_mesh_ply() is not None:
        yield "mesh"
