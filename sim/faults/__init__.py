"""Faults of real cameras, applied when a recording is read: truth first, noise after.

In the order of a real camera: the light of the scene (tone), the moment at which each row is taken (timing), the lens
(optics), exposure and the sensor's noise, the curve and the sharpening (tone, sensor), JPEG (compression), and the
rectification by a calibration that is not quite right (optics).
"""

from .kinds import CameraFaults
from .pair import FaultyPair
from .presets import PRESETS, camera_faults
from .reading import FaultyCameras

__all__ = ["PRESETS", "CameraFaults", "FaultyCameras", "FaultyPair", "camera_faults"]
