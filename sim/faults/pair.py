"""Two cameras with faults, and what becomes of the pictures that they take."""

from functools import cached_property

import cv2
import numpy as np

from stereogrid.camera import StereoCamera
from stereogrid.errors import InvalidInputError
from stereogrid.observation import FloatImage, Image

from .compression import compressed
from .kinds import CameraFaults
from .optics import Lens, defocused, vignette
from .sensor import noisy
from .streams import LEFT, RIGHT
from .tone import Gains, encode, exposure_gains, quantised, sharpened, surface_light

SIDES = (LEFT, RIGHT)


class FaultyPair:
    """Makes of clean pictures those that a faulty pair of cameras would give; its timing is not looked at.

    camera: of the clean, rectified pictures. lenses: left and right, by default those of a rig whose rectified
    pictures are as the clean ones. What it does depends on (seed, index of the observation, side) alone.
    """

    def __init__(
        self, camera: StereoCamera, faults: CameraFaults, seed: int, lenses: tuple[Lens, Lens] | None = None
    ) -> None:
        if seed < 0:
            raise InvalidInputError(f"the seed of camera faults must be >= 0, not {seed}")
        self._faults, self._seed = faults, seed
        self._lenses = lenses or tuple(Lens.of_rectified(camera, faults, seed, side) for side in SIDES)
        self._light_of_gray = [surface_light(faults, seed, side) for side in SIDES]

    @property
    def is_ideal(self) -> bool:
        """Whether pictures pass untouched."""
        return self._faults.still == CameraFaults()

    def taken(self, pair: tuple[Image, Image], index: int, gains: Gains = (1.0, 1.0)) -> tuple[Image, Image]:
        """Rectified pictures (H, W) uint8 of observation `index`; gains: of the two cameras' automatic exposure."""
        if self.is_ideal:
            return pair
        left, right = (
            lens.rectified(raw) for lens, raw in zip(self._lenses, self.raw(pair, index, gains), strict=True)
        )
        return left, right

    def raw(self, pair: tuple[Image, Image], index: int, gains: Gains = (1.0, 1.0)) -> tuple[Image, Image]:
        """The pictures (H, W) uint8 as the cameras send them, before they are rectified."""
        mismatch = exposure_gains(self._faults, self._seed, index)
        left, right = (self._raw(pair[side], index, side, gains[side] * mismatch[side]) for side in SIDES)
        return left, right

    def _raw(self, image: Image, index: int, side: int, gain: float) -> Image:
        faults = self._faults
        light = self._lenses[side].projected(cv2.LUT(image, self._light_of_gray[side]))
        light = defocused(light * self._vignettes[side], faults.defocus_px) * np.float32(gain)
        counted = noisy(light, faults, seed=self._seed, index=index, side=side)
        gray = sharpened(encode(counted, faults.gamma), faults.sharpening)
        return compressed(quantised(gray), faults.jpeg_quality)

    @cached_property
    def _vignettes(self) -> tuple[FloatImage, FloatImage]:
        left, right = (vignette(lens.raw, self._faults.vignetting) for lens in self._lenses)
        return left, right
