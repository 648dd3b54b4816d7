"""Two cameras that run by themselves: a reader each, and a thread that pairs what they read."""

import threading
from collections.abc import Callable

from stereogrid.observation import Image

from ..clock import now_s
from ..errors import CameraError
from ..mailbox import Mailbox
from .outlet import Outlet
from .pairing import LEFT, RIGHT, Pairing, SkewBound
from .pairs import RawPair
from .reader import LOST_AFTER_S, Reader
from .stream import Camera, Frame

START_S = 10.0
"""A camera that gave no picture within this time when it was first opened is none."""
_MOST_UNPAIRED = 16

BoundOf = Callable[[int, float], SkewBound]
"""The bound of skew for pictures of a width [px] and a period [s]."""


class LivePairs(Outlet):
    """See pairs.StereoPairs. `start` opens the cameras; none of their pictures is decoded before it has its partner."""

    def __init__(self, left: Camera, right: Camera, bound: BoundOf, fps: float) -> None:
        """bound: what it is for these cameras. fps: their rate where they do not say it themselves."""
        super().__init__(f"{left.name} and {right.name}", {"left": left.about, "right": right.about})
        self.cameras = (left, right)
        self._bound_of, self._fps = bound, fps
        self._inbox: Mailbox[tuple[int, Frame]] = Mailbox(_MOST_UNPAIRED)
        self._readers = (self._reader(LEFT), self._reader(RIGHT))
        self._thread = threading.Thread(target=self._run, name="pairing", daemon=True)
        self._pairing: Pairing[Frame] | None = None
        self._sizes_px: dict[int, tuple[int, int]] = {}
        self._trouble = ""
        self._stop = threading.Event()
        self._paired_s = now_s()

    def start(self) -> None:
        """Open both and wait for their first pictures. Raises CameraError: then both are closed again."""
        try:
            for reader in self._readers:
                reader.start()
            for reader in self._readers:
                reader.wait(START_S)
            self._learn_sizes()
            self._pairing = self._new_pairing()
        except BaseException:
            self.close()
            raise
        self._thread.start()

    def problem(self) -> str:
        """Why no pairs come now; "" when they do."""
        for reader in self._readers:
            if problem := reader.problem():
                return problem
        if now_s() - self._paired_s <= LOST_AFTER_S:
            return ""
        return self._trouble or self._why_unpaired()

    def close(self) -> None:
        """Let both cameras go."""
        self._stop.set()
        for reader in self._readers:
            reader.stop()
        for reader in self._readers:
            reader.join(START_S)
        self._inbox.close()
        if self._thread.ident is not None:
            self._thread.join()
        self._end()

    def _reader(self, side: int) -> Reader:
        return Reader(self.cameras[side], lambda frame: self._inbox.put((side, frame)), self._count_loss)

    def _count_loss(self) -> None:
        with self._lock:
            self.counts.lost += 1

    def _learn_sizes(self) -> None:
        """The size of both, from a picture of each. Raises CameraError where they differ or cannot be read."""
        deadline_s = now_s() + START_S
        while len(self._sizes_px) < 2:
            came = self._inbox.get(0.1)
            if came is not None:
                side, frame = came
                try:
                    height, width = frame.picture().shape
                    self._sizes_px[side] = (width, height)
                except CameraError as error:
                    self._trouble = f"{self.cameras[side].name}: {error}"
            if now_s() > deadline_s:
                raise CameraError(self._trouble or self.problem() or f"{self.name}: no pictures of both")
        left, right = self._sizes_px[LEFT], self._sizes_px[RIGHT]
        if left != right:
            raise CameraError(
                f"{self.cameras[LEFT].name} gives {left[0]}x{left[1]}, {self.cameras[RIGHT].name} "
                f"{right[0]}x{right[1]}: both must have the same size"
            )
        self.size_px, self._trouble = left, ""

    def _new_pairing(self) -> Pairing[Frame]:
        period_s = max(camera.period_s or 1.0 / self._fps for camera in self.cameras)
        bound = self._bound_of(self.size_px[0], period_s)
        self.about["max_skew_s"] = bound.max_skew_s
        return Pairing[Frame](period_s, bound, self.counts)

    def _run(self) -> None:
        self._paired_s = now_s()
        while not self._stop.is_set():
            came = self._inbox.get(0.1)
            if came is None:
                continue
            try:
                self._pair(*came)
            except Exception as error:  # of turn_radps, say: a thread that died would give no pairs, and no reason
                self._trouble = f"{self.name}: {type(error).__name__}: {error}"
                self.counts.broken += 1

    def _pair(self, side: int, frame: Frame) -> None:
        """Give out the pairs that a picture completes."""
        assert self._pairing is not None
        for left, right in self._pairing.add(side, frame):
            pictures = self._picture(LEFT, left), self._picture(RIGHT, right)
            if pictures[0] is not None and pictures[1] is not None:
                self._paired_s, self._trouble = now_s(), ""
                self._give(RawPair(pictures[0], pictures[1], left.stamp_s, right.stamp_s))

    def _picture(self, side: int, frame: Frame) -> Image | None:
        """The picture; None, and counted, for one that cannot be read or has another size than the first."""
        try:
            picture = frame.picture()
            height, width = picture.shape
            if (width, height) != self.size_px:
                raise CameraError(f"gives {width}x{height} now, not {self.size_px[0]}x{self.size_px[1]}")
        except CameraError as error:
            self._trouble = f"{self.cameras[side].name}: {error}"
            self.counts.broken += 1
            return None
        return picture

    def _why_unpaired(self) -> str:
        pairing = self._pairing
        if pairing is None or pairing.last_skew_s is None:
            return f"{self.name}: none of their pictures are a pair"
        return (
            f"{self.name}: their pictures are {1e3 * pairing.last_skew_s:.1f} ms apart, and those of a pair may be "
            f"{1e3 * pairing.bound.now_s():.1f} ms"
        )
