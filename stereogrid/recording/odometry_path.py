"""A robot's odometry as it was told from time to time, and where it was in between."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..geometry import FloatArray, between
from ..observation import Odometry

Stamps = NDArray[np.int64]
UNKNOWN = -1


@dataclass(frozen=True)
class OdometryPath:
    """stamps_ns (K,): increasing; T_odom_base (K, 4, 4); travelled_m and turned_rad (K,): summed along the piece.

    piece (K,): poses with different numbers have nothing to do with each other.
    """

    stamps_ns: Stamps
    T_odom_base: FloatArray
    travelled_m: FloatArray
    turned_rad: FloatArray
    piece: NDArray[np.int64]

    @classmethod
    def of(cls, stamps_ns: Stamps, T_odom_base: FloatArray, frames: Sequence[str]) -> "OdometryPath":
        """From stamps (K,), increasing, poses (K, 4, 4) and the frame in which each is."""
        piece = np.concatenate([[0], np.cumsum([a != b for a, b in pairwise(frames)])])
        R, t_m = T_odom_base[:, :3, :3], T_odom_base[:, :3, 3]
        # The angle of a rotation from its trace is no better than 1e-8 rad near zero; from the chord it is exact.
        chord = np.linalg.norm(R[1:] - R[:-1], axis=(1, 2)) / np.sqrt(8)
        steps = np.linalg.norm(np.diff(t_m, axis=0), axis=1), 2 * np.arcsin(np.clip(chord, 0, 1))
        goes_on = piece[1:] == piece[:-1]
        sums = [np.concatenate([[0.0], np.cumsum(np.where(goes_on, step, 0.0))]) for step in steps]
        starts = np.searchsorted(piece, piece)
        travelled_m, turned_rad = (total - total[starts] for total in sums)
        return cls(stamps_ns, T_odom_base, travelled_m, turned_rad, piece.astype(np.int64))

    def pieces_at(self, stamps_ns: Stamps, max_gap_s: float) -> NDArray[np.int64]:
        """The piece (M,) in which moments (M,) lie; UNKNOWN outside of all, and where reports are further apart."""
        after, before = self._around(stamps_ns)
        gap_ns = self.stamps_ns[after] - self.stamps_ns[before]
        inside = (stamps_ns >= self.stamps_ns[before]) & (stamps_ns <= self.stamps_ns[after])
        known = inside & (gap_ns <= max_gap_s * 1e9) & (self.piece[before] == self.piece[after])
        pieces: NDArray[np.int64] = np.where(known, self.piece[after], UNKNOWN)
        return pieces

    def at(self, stamps_ns: Stamps) -> list[Odometry]:
        """The odometry at moments (M,) whose piece is known, on the shortest way between the reports around each."""
        after, before = self._around(stamps_ns)
        span_ns = np.maximum(self.stamps_ns[after] - self.stamps_ns[before], 1)
        share = (stamps_ns - self.stamps_ns[before]) / span_ns
        poses = between(self.T_odom_base[before], self.T_odom_base[after], share)
        travelled_m, turned_rad = (
            (1 - share) * way[before] + share * way[after] for way in (self.travelled_m, self.turned_rad)
        )
        return [Odometry(*each) for each in zip(poses, travelled_m.tolist(), turned_rad.tolist(), strict=True)]

    def turn_radps(self, stamps_ns: Stamps) -> FloatArray:
        """How fast the robot turned (M,) between the reports around each moment."""
        after = np.clip(np.searchsorted(self.stamps_ns, stamps_ns), 1, max(len(self.stamps_ns) - 1, 1))
        after, before = np.minimum(after, len(self.stamps_ns) - 1), after - 1
        span_s = np.maximum(self.stamps_ns[after] - self.stamps_ns[before], 1) / 1e9
        rates: FloatArray = (self.turned_rad[after] - self.turned_rad[before]) / span_s
        return rates

    def _around(self, stamps_ns: Stamps) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Numbers of the reports after, or at, and before each moment; the same one where it is a report's own."""
        last = len(self.stamps_ns) - 1
        after = np.minimum(np.searchsorted(self.stamps_ns, stamps_ns), last)
        before = np.where(self.stamps_ns[after] == stamps_ns, after, np.maximum(after - 1, 0))
        return after, before
