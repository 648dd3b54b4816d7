"""A recording gone through in the background: its pictures, and how its map grew."""

import threading

import cv2
import numpy as np

from ..config import MappingConfig
from ..errors import StereogridError
from ..grid import OccupancyGrid
from ..observation import Disparity, Image, Observation, Recording
from .colours import PALETTES, ramp
from .history import History, Pictures
from .snapshot import Snapshot

MOST_PX = 480
"""Wider pictures are shown smaller."""
NO_MATCH_RGB = (190, 190, 190)
JOIN_S = 5.0


class Replay:
    """Maps a recording on a thread of its own, from start() to its end or to close().

    makes_map False: only pictures are made, for a map whose making is not known. done: observations gone through;
    ended: it is over; fault: what ended it early, in words; sha256: of the map at the end.
    """

    def __init__(self, recording: Recording, config: MappingConfig, *, makes_map: bool = True) -> None:
        self._recording, self._config = recording, config
        # Refuses what cannot work before a page opens.
        self._mapper, self.makes_map = config.build_mapper(recording.camera), makes_map
        self.history = History(len(recording))
        self.done, self.ended, self.fault, self.sha256 = 0, False, "", ""
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="replay", daemon=True)

    @property
    def grid(self) -> OccupancyGrid:
        """The map so far."""
        return self._mapper.grid

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def close(self) -> None:
        """End soon: a matcher at work is not waited for longer than JOIN_S."""
        self._stop.set()
        if self._thread.ident is not None:
            self._thread.join(JOIN_S)

    def _run(self) -> None:
        try:
            for number, observation in enumerate(self._recording):
                if self._stop.is_set():
                    return
                self._step(number, observation)
                self.done = number + 1
            self.sha256 = self.grid.sha256()
        except Exception as error:  # the page stays, and says so
            self.fault = str(error) if isinstance(error, StereogridError) else repr(error)
        finally:
            self.ended = True

    def _step(self, number: int, observation: Observation) -> None:
        last = number + 1 == len(self._recording)
        if self.makes_map:
            disparity = self._mapper.step(observation)
            if last:
                self._mapper.finish()
        elif self.history.wants(number):
            disparity = self._mapper.disparity(observation)
        if self.history.wants(number):
            snapshot = Snapshot.of(self.grid) if self.makes_map else None
            self.history.add(number, snapshot, self._pictures(observation.left, disparity))

    def _pictures(self, left: Image, disparity: Disparity) -> Pictures:
        known = disparity.disparity_px[disparity.valid]
        # Each picture by its own: a corridor's are a few of the pixels searched.
        ends = 0.0, float(np.percentile(known, 98)) if len(known) else 1.0
        coloured = ramp(np.nan_to_num(disparity.disparity_px), ends, PALETTES["height"])
        coloured[~disparity.valid] = NO_MATCH_RGB
        return _jpeg(left), _jpeg(coloured[:, :, ::-1])


def small(image: Image) -> Image:
    """An image (H, W) or (H, W, 3) of at most MOST_PX columns."""
    shrink = min(1.0, MOST_PX / image.shape[1])
    shown = cv2.resize(image, None, fx=shrink, fy=shrink, interpolation=cv2.INTER_AREA) if shrink < 1 else image
    return np.asarray(shown, np.uint8)


def _jpeg(image: Image) -> bytes:
    return bytes(cv2.imencode(".jpg", np.ascontiguousarray(small(image)))[1])


def picture_of(jpeg: bytes) -> Image:
    """(H, W, 3) uint8 RGB of one of the pictures that a History keeps."""
    image = np.asarray(cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR), np.uint8)
    return image[:, :, ::-1]
