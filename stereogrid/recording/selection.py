"""A part of a recording: a time range, every so many observations."""

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from ..errors import InvalidInputError, RecordingError
from ..geometry import FloatArray
from .file_recording import FileRecording, ObservationAt
from .ticks import Ticks

TOLERANCE_S = 1e-6
"""Seconds since 1970 have but seven digits behind their point as float64: what is at .3 s may seem to be before."""


class Selection(FileRecording):
    """The observations from start_s to end_s, every stride-th of them; the others are not decoded.

    start_s, end_s: seconds after the recording's first observation, both included, to the microsecond; end_s None: to
    its end.
    whole: what it is a part of; numbers: which of its observations; stride.
    Raises InvalidInputError for a range that cannot be, RecordingError when no observation lies in it.
    """

    def __init__(
        self, recording: FileRecording, start_s: float = 0.0, end_s: float | None = None, stride: int = 1
    ) -> None:
        end_s = np.inf if end_s is None else end_s
        if not (0 <= start_s < np.inf and start_s <= end_s and stride >= 1):
            raise InvalidInputError(
                f"a part of a recording needs 0 <= start <= end [s] and stride >= 1, not {start_s}, {end_s}, {stride}"
            )
        after_s = recording.stamps_s - recording.stamps_s[0]
        self.whole, self.stride = recording, stride
        self._is_cut = start_s > 0 or end_s < after_s[-1]
        inside = (after_s >= start_s - TOLERANCE_S) & (after_s <= end_s + TOLERANCE_S)
        self.numbers = np.flatnonzero(inside)[::stride]
        if not len(self.numbers):
            raise RecordingError(
                f"{recording.path}: no observation from {start_s:g} to {end_s:g} s; it is {after_s[-1]:.3f} s long"
            )
        self.path, self.camera, self.T_base_cam = recording.path, recording.camera, recording.T_base_cam
        self.poses, self.stamps_s = recording.poses[self.numbers], recording.stamps_s[self.numbers]
        self.metadata, self.left_out, self.damage = recording.metadata, recording.left_out, recording.damage
        self.has_disparity, self.beside = recording.has_disparity, recording.beside

    def notes(self) -> Iterator[str]:
        """Those of the whole, and how much of it this is."""
        yield from self.whole.notes()
        yield f"{len(self)} of its {len(self.whole)} observations"

    def true_poses(self) -> FloatArray | None:
        """Of the observations of this part."""
        poses = self.whole.true_poses()
        return None if poses is None else poses[self.numbers]

    def truth_mesh_ply(self) -> bytes | None:
        """The whole recording's."""
        return self.whole.truth_mesh_ply()

    def mover_names(self) -> tuple[str, ...]:
        """The whole recording's."""
        return self.whole.mover_names()

    def mover_mesh_ply(self, name: str) -> bytes | None:
        """The whole recording's."""
        return self.whole.mover_mesh_ply(name)

    def ticks(self) -> Ticks | None:
        """The whole recording's; of a part in time those from the last before it to the first after it."""
        ticks = self.whole.ticks()
        if ticks is None or not self._is_cut:
            return ticks
        first = max(int(np.searchsorted(ticks.stamp_s, self.stamps_s[0], side="right")) - 1, 0)
        last = int(np.searchsorted(ticks.stamp_s, self.stamps_s[-1])) + 1
        part = slice(min(first, len(ticks) - 1), max(last, 1))
        return Ticks(ticks.stamp_s[part], ticks.T_world_base[part], ticks.wheels_rad[part])

    @contextmanager
    def _reading(self) -> Iterator[ObservationAt]:
        with self.whole._reading() as observation_at:
            yield lambda number: observation_at(int(self.numbers[number]))
