"""Rigs by name."""

from dataclasses import fields, replace
from typing import Any

from stereogrid.errors import InvalidInputError, unknown_name

from .kinds import CameraFaults

PRESETS: dict[str, CameraFaults] = {
    "ideal": CameraFaults(),
    # A synchronised industrial rig in good light, carefully calibrated.
    "mild": CameraFaults(
        exposure_mismatch=0.04,
        white_balance_mismatch=0.02,
        vignetting=0.1,
        defocus_px=0.5,
        distortion_k1=-0.05,
        calibration_error_deg=0.01,
        full_well_e=8000.0,
        read_noise_e=12.0,
    ),
    # Two webcams in one shell, indoors: a well of some 10000 electrons at a gain of three, plastic lenses, pictures
    # sharpened and sent as MJPEG at 30 a second, clocks and exposures of their own. 0.03 degrees are 10 um on the
    # baseline of 60 mm, which the shell bends by when it warms.
    "minoru": CameraFaults(
        exposure_mismatch=0.1,
        white_balance_mismatch=0.08,
        auto_exposure=0.8,
        vignetting=0.3,
        defocus_px=0.8,
        distortion_k1=-0.08,
        calibration_error_deg=0.03,
        full_well_e=3000.0,
        read_noise_e=8.0,
        gamma=2.2,
        sharpening=0.4,
        jpeg_quality=85,
        rolling_shutter_s=0.030,
        time_skew_s=1 / 60,
        drop_share=0.01,
        repeat_share=0.005,
    ),
    # The same in the evening: twice the gain, 15 pictures a second, knocked since it was calibrated, on a busy USB.
    "bad": CameraFaults(
        exposure_mismatch=0.25,
        white_balance_mismatch=0.2,
        auto_exposure=1.0,
        vignetting=0.4,
        defocus_px=1.0,
        distortion_k1=-0.12,
        calibration_error_deg=0.06,
        full_well_e=1500.0,
        read_noise_e=10.0,
        gamma=2.2,
        sharpening=0.6,
        jpeg_quality=60,
        rolling_shutter_s=0.060,
        time_skew_s=1 / 30,
        drop_share=0.05,
        repeat_share=0.02,
    ),
}


def camera_faults(name: str, **parts: float) -> CameraFaults:
    """The faults of that name: of a preset, with other numbers for some of its parts.

    `camera_faults("minoru", jpeg_quality=50)` and `camera_faults("minoru, jpeg_quality=50")` are the same.
    Raises InvalidInputError, naming the choices, for an unknown preset or part.
    """
    preset, *changes = (word.strip() for word in name.split(","))
    if preset not in PRESETS:
        raise unknown_name("preset of camera faults", preset, PRESETS)
    numbers: dict[str, Any] = {**dict(_part(change) for change in changes), **parts}
    known = [field.name for field in fields(CameraFaults)]
    for part in numbers:
        if part not in known:
            raise unknown_name("camera fault", part, known)
    return replace(PRESETS[preset], **numbers)


def _part(change: str) -> tuple[str, float]:
    part, _, value = (word.strip() for word in change.partition("="))
    try:
        number = float(value)
    except ValueError:
        raise InvalidInputError(
            f"camera faults: expected part=number, such as jpeg_quality=50, not {change!r}"
        ) from None
    return part, number
