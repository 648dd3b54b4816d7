"""Electrons: shot noise, read noise, and a well that overflows."""

import numpy as np

from stereogrid.observation import FloatImage

from .kinds import CameraFaults
from .streams import stream


def noisy(light: FloatImage, faults: CameraFaults, *, seed: int, index: int, side: int) -> FloatImage:
    """Light (H, W) as the sensor counts it, 0 to 1 = a full well; numbers of electrons are taken as Gaussian."""
    if np.isfinite(faults.full_well_e):
        shot, read = (
            stream(seed, name, index, side).standard_normal(light.shape, dtype=np.float32)
            for name in ("shot noise", "read noise")
        )
        well_e = np.float32(faults.full_well_e)
        electrons = light * well_e
        electrons += np.sqrt(np.maximum(electrons, 0)) * shot + np.float32(faults.read_noise_e) * read
        light = electrons / well_e
    counted: FloatImage = np.clip(light, 0, 1)
    return counted
