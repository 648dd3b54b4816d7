"""Links to the simulated firmware that fail as real ones do: silent in one way or both, or with flipped bytes."""

from dataclasses import replace

import numpy as np

from sim.firmware.links import Link, News


class TroubledLink:
    """A link whose test may change it while it runs. deaf: nothing from the client arrives; mute: nothing goes to it.

    error_rate: the share of bytes, either way, of which a bit is flipped. flips: how many were.
    """

    def __init__(self, link: Link, *, error_rate: float = 0.0, seed: int = 0) -> None:
        self._link, self._error_rate, self._rng = link, error_rate, np.random.default_rng(seed)
        self.deaf = self.mute = False
        self.flips = 0

    @property
    def name(self) -> str:
        return self._link.name

    @property
    def dropped(self) -> int:
        return self._link.dropped

    def poll(self) -> News:
        news = self._link.poll()
        return replace(news, data=b"" if self.deaf else self._spoilt(news.data))

    def send(self, data: bytes) -> None:
        if not self.mute:
            self._link.send(self._spoilt(data))

    def close(self) -> None:
        self._link.close()

    def cut(self, cut: bool = True) -> None:
        """Both ways."""
        self.deaf = self.mute = cut

    def _spoilt(self, data: bytes) -> bytes:
        hit = self._rng.random(len(data)) < self._error_rate
        self.flips += int(hit.sum())
        bits = 1 << self._rng.integers(0, 8, len(data))
        return bytes(np.frombuffer(data, np.uint8) ^ np.where(hit, bits, 0).astype(np.uint8))
