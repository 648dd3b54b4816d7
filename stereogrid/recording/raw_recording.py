"""Recordings of pictures and poses that each have stamps of their own: paired, placed and rectified alike."""

from abc import abstractmethod
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass

import numpy as np

from ..camera import Rectification, StereoCamera
from ..errors import InvalidInputError
from ..geometry import FloatArray
from ..observation import Image, Observation, Odometry
from .file_recording import FileRecording, ObservationAt
from .odometry_path import UNKNOWN, OdometryPath, Stamps
from .pairing import paired

LEFT, RIGHT = 0, 1
MAX_SMEAR_PX = 1.0
MAX_GAP_S = 0.5
"""Between reports of the odometry that are further apart the robot was anywhere."""

PictureAt = Callable[[int, int], Image]
"""picture_at(side, stamp_ns): the picture (H, W) uint8 as the camera gave it."""


@dataclass(frozen=True)
class PairingLimits:
    """What makes a usable pair.

    max_skew_s: between its pictures (see `paired`); max_gap_s: between the reports of the odometry around it;
    max_smear_px: how far the picture may have moved, by the robot's turning, from the moment of the one picture to that
    of the other, which a matcher would take for disparity.
    """

    max_skew_s: float | None = None
    max_gap_s: float = MAX_GAP_S
    max_smear_px: float = MAX_SMEAR_PX


@dataclass(frozen=True)
class RawDrive:
    """What is known of a drive before its pictures are looked at.

    stamps_ns: increasing, of the pictures of the left (L,) and of the right camera (R,); rig: what rectifies them, or
    the camera of pictures that are rectified already; T_base_cam (4, 4): of the rectified left camera; path: where the
    robot was, None for a rig that stood still all the time; path_name: what tells of it, for errors.
    """

    stamps_ns: tuple[Stamps, Stamps]
    rig: Rectification | StereoCamera
    T_base_cam: FloatArray
    path: OdometryPath | None
    path_name: str = "the odometry"


class RawRecording(FileRecording):
    """Pairs made of pictures by their stamps, rectified while they are read.

    A pair's stamp is the middle of its pictures'; its pose is interpolated between the two reports around that. Where
    the odometry was lost (its frame changes), the pieces have nothing to do with each other: the one with the most
    pairs counts. travelled_m and turned_rad are summed over the reports.

    drive: what was known of it before; pairs_ns (M, 2): stamps of the left and the right picture; skew_s (M,): how much
    later the right one was taken. A subclass calls `_lay` when it is made, and gives
    `_pictures`.
    """

    drive: RawDrive
    pairs_ns: Stamps
    skew_s: FloatArray

    @property
    def raw_shape(self) -> tuple[int, int]:
        """(height, width) of the pictures as the cameras gave them."""
        return self.camera.shape if self._rectification is None else self._rectification.raw_shape

    def raw_pairs(self, numbers: Iterable[int] | None = None) -> Iterator[tuple[Image, Image]]:
        """The pairs as the cameras gave them, of these observations or of all in their order."""
        with self._pictures() as picture_at:
            for number in range(len(self)) if numbers is None else numbers:
                with self._naming(f"the pair at {self.stamps_s[number]:.9f} s"):
                    yield self._raw_pair(number, picture_at)

    def notes(self) -> Iterator[str]:
        """How far apart the pictures of a pair were taken."""
        if self.skew_s.any():
            skew_ms = 1e3 * abs(self.skew_s)
            yield f"skew of the pictures of a pair: {skew_ms.mean():.1f} ms, at most {skew_ms.max():.1f} ms"

    @abstractmethod
    def _pictures(self) -> AbstractContextManager[PictureAt]:
        """Open what is needed to read pictures by side and stamp."""

    @contextmanager
    def _reading(self) -> Iterator[ObservationAt]:
        with self._pictures() as picture_at:

            def observation_at(number: int) -> Observation:
                stamp_s = float(self.stamps_s[number])
                with self._naming(f"the observation at {stamp_s:.9f} s"):
                    left, right = self._rectified(*self._raw_pair(number, picture_at))
                    return Observation(stamp_s, left, right, self._odometry[number], self.poses[number])

            yield observation_at

    def _raw_pair(self, number: int, picture_at: PictureAt) -> tuple[Image, Image]:
        left_ns, right_ns = self.pairs_ns[number].tolist()
        return picture_at(LEFT, left_ns), picture_at(RIGHT, right_ns)

    def _rectified(self, left: Image, right: Image) -> tuple[Image, Image]:
        return (left, right) if self._rectification is None else self._rectification.rectify(left, right)

    def _lay(self, drive: RawDrive, limits: PairingLimits) -> None:
        """Pair the pictures and place the pairs. Raises InvalidInputError when there is no pair with a pose."""
        self.drive = drive
        self._rectification = None if isinstance(drive.rig, StereoCamera) else drive.rig
        self.camera = drive.rig if isinstance(drive.rig, StereoCamera) else drive.rig.camera
        self.T_base_cam = drive.T_base_cam
        self.pairs_ns = self._paired(drive.stamps_ns, limits.max_skew_s)
        if drive.path is None:
            self._odometry = [Odometry(np.eye(4))] * len(self.pairs_ns)
        else:
            self._odometry = self._placed(drive.path, drive.path_name, limits)
        self.stamps_s = np.array([stamp_ns / 10**9 for stamp_ns in self._middle_ns().tolist()])
        self.skew_s = (self.pairs_ns[:, RIGHT] - self.pairs_ns[:, LEFT]) / 1e9
        self.poses = np.stack([each.T_odom_base @ self.T_base_cam for each in self._odometry])

    def _paired(self, stamps_ns: tuple[Stamps, Stamps], max_skew_s: float | None) -> Stamps:
        """Stamps (M, 2) of the left and the right picture of each pair."""
        numbers = paired(*stamps_ns, max_skew_s)
        self._leave_out("pictures without one of the other camera", sum(map(len, stamps_ns)) - 2 * len(numbers))
        if len(numbers) == 0:
            raise InvalidInputError("no two pictures of the left and the right camera are of the same moment")
        pairs_ns: Stamps = np.stack([each[numbers[:, side]] for side, each in enumerate(stamps_ns)], axis=1)
        return pairs_ns

    def _placed(self, path: OdometryPath, path_name: str, limits: PairingLimits) -> list[Odometry]:
        """The odometry of the pairs; those without, and those smeared, are left out."""
        apart_s = np.abs(self.pairs_ns[:, RIGHT] - self.pairs_ns[:, LEFT]) / 1e9
        smeared = self.camera.focal_px * path.turn_radps(self._middle_ns()) * apart_s > limits.max_smear_px
        what = "pairs taken too far apart for how fast the robot turned"
        self._leave_out(what, int(smeared.sum()))
        if smeared.all():
            raise InvalidInputError(
                f"all are {what}: by {path_name}, their pictures moved by more than {limits.max_smear_px:g} px between "
                "the left and the right one"
            )
        self.pairs_ns = self.pairs_ns[~smeared]
        pieces = path.pieces_at(self._middle_ns(), limits.max_gap_s)
        known = pieces[pieces != UNKNOWN]
        self._leave_out("pairs where the odometry does not reach", len(pieces) - len(known))
        if len(known) == 0:
            left_out = f"; left out before: {smeared.sum()} {what}" if smeared.any() else ""
            raise InvalidInputError(f"{path_name} tells of no moment at which a pair was taken{left_out}")
        longest = np.bincount(known).argmax()
        self._leave_out("pairs of other pieces of the drive: the odometry was lost", int((known != longest).sum()))
        self.pairs_ns = self.pairs_ns[pieces == longest]
        return path.at(self._middle_ns())

    def _middle_ns(self) -> Stamps:
        middle: Stamps = self.pairs_ns[:, LEFT] + (self.pairs_ns[:, RIGHT] - self.pairs_ns[:, LEFT]) // 2
        return middle
