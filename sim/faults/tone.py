"""Brightness: the light of a picture, how much of it each camera gathers, and the curve that gray levels follow."""

from dataclasses import dataclass

import cv2
import numpy as np

from stereogrid.geometry import FloatArray
from stereogrid.observation import FloatImage, Image

from .kinds import CameraFaults
from .streams import LEFT, stream

MID_GRAY = 0.18
"""Light that exposure meters take for the mean of a scene, 1 = white."""
LAG_S = 0.5
"""Time in which a camera's exposure comes nearer to what it should be, to 1/e."""
MAX_GAIN = 8.0
CHANCE = 0.1
"""Share of the exposure mismatch by which every single picture differs."""
SHARPENED_PX = 1.0

Gains = tuple[float, float]

LIGHT_OF_GRAY: FloatArray = (np.arange(256) / 255.0) ** 2
"""Light (256,) of the renderer's gray levels, which are square roots; 1 = white."""


def exposure_gains(faults: CameraFaults, seed: int, index: int) -> Gains:
    """How much of the light the left and the right camera gather in observation `index`."""
    which = 1.0 if stream(seed, "exposure").random() < 0.5 else -1.0
    ratio = (1.0 + faults.exposure_mismatch) ** (which / 2)
    chance = [stream(seed, "exposure of a picture", index, side).standard_normal() for side in (0, 1)]
    left, right = (np.exp(CHANCE * faults.exposure_mismatch * each) for each in chance)
    return float(left / ratio), float(right * ratio)


def surface_light(faults: CameraFaults, seed: int, side: int) -> FloatImage:
    """Light (256,) float32 that a camera's filters let through of a surface, by its clean gray level."""
    rng = stream(seed, "white balance")
    gray = np.arange(256) / 255.0
    waves = [rng.uniform(0.5, 1.0) * np.sin(2 * np.pi * (turns * gray + rng.uniform())) for turns in (0.5, 1.0, 1.5)]
    tint = np.sum(waves, axis=0)
    tint *= 0.5 * faults.white_balance_mismatch / np.abs(tint).max()
    light: FloatImage = (LIGHT_OF_GRAY * (1.0 - tint if side == LEFT else 1.0 + tint)).astype(np.float32)
    return light


@dataclass
class AutoExposure:
    """The exposures of two cameras that follow what they see, late, along a recording read from its start.

    The first observation finds them settled. From then on each follows the means of the observations before.
    """

    strength: float
    _metered: FloatArray | None = None
    _seen: FloatArray | None = None
    _stamp_s: float = 0.0

    def gains(self, pair: tuple[Image, Image], stamp_s: float) -> Gains:
        """Gains of the next observation, whose clean images (H, W) uint8 are given: to be called for each in turn."""
        if self.strength == 0:
            return 1.0, 1.0
        seen = np.array([np.log(max(_mean_light(image), 1e-4)) for image in pair])
        if self._metered is None or self._seen is None:
            self._metered = seen
        else:
            share = 1.0 - np.exp(-max(stamp_s - self._stamp_s, 0.0) / LAG_S)
            self._metered = self._metered + share * (self._seen - self._metered)
        self._seen, self._stamp_s = seen, stamp_s
        gains = np.exp(self.strength * (np.log(MID_GRAY) - self._metered))
        left, right = np.clip(gains, 1 / MAX_GAIN, MAX_GAIN)
        return float(left), float(right)


def _mean_light(image: Image) -> float:
    return float(np.bincount(image.ravel(), minlength=256) @ LIGHT_OF_GRAY / image.size)


def encode(light: FloatImage, gamma: float) -> FloatImage:
    """Gray levels (H, W), 0 to 255 and not yet rounded, of light in 0 to 1."""
    root: FloatImage = np.sqrt(light) if gamma == 2.0 else cv2.pow(light, 1.0 / gamma)
    return root * np.float32(255)


def sharpened(gray: FloatImage, amount: float) -> FloatImage:
    """The unsharp mask."""
    if amount == 0:
        return gray
    fine: FloatImage = gray - cv2.GaussianBlur(gray, (0, 0), SHARPENED_PX)
    return gray + np.float32(amount) * fine


def quantised(gray: FloatImage) -> Image:
    """Whole gray levels (H, W) uint8."""
    return (np.clip(gray, 0, 255) + np.float32(0.5)).astype(np.uint8)
