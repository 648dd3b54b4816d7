"""Faults of real cameras, applied when a recording is read: truth first, noise after."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import cv2
import numpy as np

from stereogrid.camera import StereoCamera
from stereogrid.errors import InvalidInputError, unknown_name
from stereogrid.geometry import FloatArray
from stereogrid.observation import Image, Observation, Recording


@dataclass(frozen=True)
class ImageNoise:
    """A camera's faults; the defaults are none.

    blur_px: deviation of the lens's blur [px]. gain_mismatch: deviation of each image's exposure gain, relative.
    full_well_e: electrons at white, which set the shot noise (inf: none). read_noise_gray: deviation [gray levels].
    """

    blur_px: float = 0.0
    gain_mismatch: float = 0.0
    full_well_e: float = np.inf
    read_noise_gray: float = 0.0

    def __post_init__(self) -> None:
        for name in ("blur_px", "gain_mismatch", "read_noise_gray"):
            if not (np.isfinite(getattr(self, name)) and getattr(self, name) >= 0):
                raise InvalidInputError(f"{name} must be finite and >= 0, not {getattr(self, name)}")
        if not self.full_well_e > 0:
            raise InvalidInputError(f"full_well_e must be positive, not {self.full_well_e}")

    def apply(self, image: Image, rng: np.random.Generator) -> Image:
        """The image (H, W) uint8 as a camera with these faults would give it."""
        # Drawn in every case and in this order, so that arms with other numbers share the same random stream.
        gain = 1.0 + self.gain_mismatch * rng.standard_normal()
        unit = rng.standard_normal(image.shape, dtype=np.float32)
        gray = image.astype(np.float32)
        if self.blur_px > 0:
            gray = cv2.GaussianBlur(gray, (0, 0), self.blur_px)
        gray = gray * np.float32(max(gain, 0.0))
        # Electrons arrive before the gamma curve (square root): there the shot noise is the same at every level.
        shot_gray = 255.0 / (2.0 * np.sqrt(self.full_well_e))
        gray += np.float32(np.hypot(shot_gray, self.read_noise_gray)) * unit
        return (np.clip(gray, 0, 255) + 0.5).astype(np.uint8)


IMAGE_NOISE: dict[str, ImageNoise] = {
    "ideal": ImageNoise(),
    "mild": ImageNoise(blur_px=0.5, gain_mismatch=0.02, full_well_e=8000.0, read_noise_gray=0.8),
    "webcam": ImageNoise(blur_px=0.8, gain_mismatch=0.04, full_well_e=1800.0, read_noise_gray=1.5),
}


def image_noise(name: str) -> ImageNoise:
    """The preset of that name. Raises InvalidInputError for an unknown one."""
    if name not in IMAGE_NOISE:
        raise unknown_name("image noise", name, IMAGE_NOISE)
    return IMAGE_NOISE[name]


class NoisyImages:
    """A recording seen through faulty cameras: a Recording itself. Odometry and truth pass untouched.

    The noise of observation i depends on (seed, i, side) alone: not on the order of reading, nor on the arm.
    """

    def __init__(self, recording: Recording, noise: ImageNoise, seed: int) -> None:
        self.camera: StereoCamera = recording.camera
        self.T_base_cam: FloatArray = recording.T_base_cam
        self._recording = recording
        self._noise = noise
        self._seed = seed

    def __len__(self) -> int:
        return len(self._recording)

    def __iter__(self) -> Iterator[Observation]:
        for i, observation in enumerate(self._recording):
            yield replace(
                observation,
                left=self._noise.apply(observation.left, np.random.default_rng([self._seed, i, 0])),
                right=self._noise.apply(observation.right, np.random.default_rng([self._seed, i, 1])),
            )
