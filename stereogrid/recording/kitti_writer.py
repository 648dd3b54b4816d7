"""Writes a recording in the layout of KITTI odometry."""

from collections.abc import Callable
from pathlib import Path

from ..trajectory import save_kitti, words_of
from .file_recording import FileRecording
from .images import encode_png

_SIDES = ("image_0", "image_1")


def write_kitti(recording: FileRecording, folder: Path, progress: Callable[[float], None]) -> None:
    """Fill a folder with image_0, image_1, calib.txt, poses.txt and times.txt.

    Poses are of the left camera in that of the first observation; times are the recording's own stamps [s].
    Raises OSError or InvalidInputError when the folder cannot be written.
    """
    for side in _SIDES:
        (folder / side).mkdir()
    calib = "".join(f"P{number}: {words_of(P.ravel())}\n" for number, P in enumerate(recording.camera.P))
    (folder / "calib.txt").write_text(calib)
    save_kitti(folder / "poses.txt", recording.poses)
    (folder / "times.txt").write_text("".join(f"{stamp_s:.9f}\n" for stamp_s in recording.stamps_s))
    for number, observation in enumerate(recording):
        for side, image in zip(_SIDES, (observation.left, observation.right), strict=True):
            (folder / side / f"{number:06d}.png").write_bytes(encode_png(image))
        progress((number + 1) / len(recording))
