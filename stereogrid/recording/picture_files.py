"""Recordings whose raw or rectified pictures are files in folders, each with a stamp of its own."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from ..errors import InvalidInputError, RecordingError
from ..observation import Image
from .images import check_size, read_grey
from .odometry_path import Stamps
from .raw_recording import PictureAt, RawRecording

PICTURES = (".png", ".jpg", ".jpeg")
PictureFiles = tuple[Mapping[int, Path], Mapping[int, Path]]
"""The file of each picture of the left and the right camera, by its stamp [ns]."""


class PictureFolders(RawRecording):
    """The pictures are read from self._files as they are asked for; each must have the size of the raw ones."""

    _files: PictureFiles

    @contextmanager
    def _pictures(self) -> Iterator[PictureAt]:
        yield self._picture

    def _picture(self, side: int, stamp_ns: int) -> Image:
        return read_grey(self._files[side][stamp_ns], self.raw_shape)

    @contextmanager
    def _opening(self) -> Iterator[None]:
        """Turn what is wrong with the contents into a RecordingError that names the folder."""
        try:
            yield
        except InvalidInputError as error:
            raise RecordingError(f"{self.path}: {error}") from error

    def _check_first(self) -> None:
        """Whether the first pair has the size of the camera: pictures of another calibration are found out at once."""
        for side, stamp_ns in enumerate(self.pairs_ns[0].tolist()):
            check_size(self._files[side][stamp_ns], self.raw_shape)

    def _stamps_ns(self) -> tuple[Stamps, Stamps]:
        left_ns, right_ns = (np.array(sorted(files), np.int64) for files in self._files)
        return left_ns, right_ns


def picture_names(folder: Path) -> list[str]:
    """The sorted names of the pictures in a folder. Raises RecordingError where there is none."""
    if not folder.is_dir():
        raise RecordingError(f"{folder}: no such folder of pictures")
    names = sorted(path.name for path in folder.iterdir() if path.suffix.lower() in PICTURES)
    if not names:
        raise RecordingError(f"{folder}: no pictures; expected {', '.join(PICTURES)}")
    return names
