"""What can be wrong with a pair of cameras: one number each."""

from dataclasses import dataclass, replace

import numpy as np

from stereogrid.errors import InvalidInputError

_RANGES = {
    "exposure_mismatch": (0, 4),
    "white_balance_mismatch": (0, 1),
    "auto_exposure": (0, 1),
    "vignetting": (0, 1),
    "defocus_px": (0, 20),
    "distortion_k1": (-2, 2),
    "calibration_error_deg": (0, 5),
    "read_noise_e": (0, 1e6),
    "gamma": (0.5, 5),
    "sharpening": (0, 10),
    "jpeg_quality": (1, 100),
    "rolling_shutter_s": (0, 0.1),
    "time_skew_s": (0, 0.1),
    "drop_share": (0, 1),
    "repeat_share": (0, 1),
}
"""What any camera may have, ends included: beyond it pictures are nonsense, and blurs and margins take for ever."""


@dataclass(frozen=True)
class CameraFaults:
    """The faults of a pair of cameras; the defaults are none.

    exposure_mismatch: how much more light the one camera gathers than the other, relative, all the time; and a tenth
        of it by chance in every picture.
    white_balance_mismatch: pictures are gray, so hue is not known; surfaces of another brightness stand for those of
        another hue. By so much the two cameras differ at most on a surface, relative, as a smooth function of the
        surface's clean brightness.
    auto_exposure: 0 to 1, how far each camera pulls the mean of what it sees to mid-gray, half a second late.
    vignetting: share of the light that the corner of the picture lacks.
    defocus_px: deviation of the lens's blur [px].
    distortion_k1: of the lens, OpenCV's first radial coefficient; rectification knows it.
    calibration_error_deg: rotation of the right camera that its calibration does not know, about some axis [degrees].
    full_well_e: electrons at white, whose number sets the shot noise (inf: none).
    read_noise_e: deviation of the sensor's own noise [electrons]; needs full_well_e.
    gamma: brightness is light^(1/gamma); 2 is what textures and renderer have.
    sharpening: share of what a blur of 1 px takes away that is added once more (unsharp mask).
    jpeg_quality: 1 to 99; 100 is no compression at all.
    rolling_shutter_s: time between the first row's exposure and the last one's, about the stamp [s].
    time_skew_s: two free-running cameras: the right picture is taken up to this much sooner or later, drifting [s].
    drop_share: of the pairs that never arrive. repeat_share: of the pairs in which one camera hands out the picture
        of the pair before once more.
    """

    exposure_mismatch: float = 0.0
    white_balance_mismatch: float = 0.0
    auto_exposure: float = 0.0
    vignetting: float = 0.0
    defocus_px: float = 0.0
    distortion_k1: float = 0.0
    calibration_error_deg: float = 0.0
    full_well_e: float = np.inf
    read_noise_e: float = 0.0
    gamma: float = 2.0
    sharpening: float = 0.0
    jpeg_quality: int = 100
    rolling_shutter_s: float = 0.0
    time_skew_s: float = 0.0
    drop_share: float = 0.0
    repeat_share: float = 0.0

    def __post_init__(self) -> None:
        for name, (low, high) in _RANGES.items():
            value = getattr(self, name)
            # Written so that NaN fails too.
            if not low <= value <= high:
                raise InvalidInputError(f"{name} must be {low:g} to {high:g}, not {value}")
        if self.jpeg_quality != int(self.jpeg_quality):
            raise InvalidInputError(f"jpeg_quality must be a whole number, not {self.jpeg_quality}")
        if not self.full_well_e >= 1:
            raise InvalidInputError(f"full_well_e must be at least 1, or inf, not {self.full_well_e}")
        if self.read_noise_e > 0 and np.isinf(self.full_well_e):
            raise InvalidInputError(f"read_noise_e = {self.read_noise_e} needs full_well_e, the electrons at white")

    @property
    def needs_motion(self) -> bool:
        """Whether pictures have to be taken again, at other moments than the recorded ones."""
        return self.time_skew_s > 0 or self.rolling_shutter_s > 0

    @property
    def still(self) -> "CameraFaults":
        """The same of cameras that stand still and lose nothing: for single pairs, which have no before and after."""
        return replace(self, rolling_shutter_s=0.0, time_skew_s=0.0, drop_share=0.0, repeat_share=0.0)
