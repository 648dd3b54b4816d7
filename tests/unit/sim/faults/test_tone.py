"""Exposure, colour filters, noise and curve: each as its number says, and all of them nothing by default."""

from dataclasses import fields

import cv2
import numpy as np
import pytest
from faults_scenes import CAMERA, FewObservations, flat

pytest.importorskip("embreex")

from sim.faults import PRESETS, CameraFaults, FaultyCameras, FaultyPair, camera_faults
from sim.faults.tone import AutoExposure, exposure_gains
from stereogrid.camera import StereoCamera
from stereogrid.errors import InvalidInputError

WIDE = StereoCamera(400.0, 199.5, 149.5, 0.06, 400, 300)


def light(image: np.ndarray) -> float:
    return float(((image / 255.0) ** 2).mean())


@pytest.mark.parametrize("faults", [CameraFaults(), PRESETS["ideal"], CameraFaults(drop_share=0.5)])
def test_no_faults_leave_every_gray_level_bit_for_bit(faults: CameraFaults) -> None:
    image = np.random.default_rng(0).integers(0, 256, CAMERA.shape).astype(np.uint8)
    for way in ("taken", "raw"):
        left, right = getattr(FaultyPair(CAMERA, faults, 1), way)((image, image.T.copy().T), 0)
        assert np.array_equal(left, image) and np.array_equal(right, image)


def test_the_cameras_differ_in_exposure_by_the_mismatch_all_the_time_and_a_tenth_of_it_by_chance() -> None:
    ratios = []
    for index in range(200):
        left, right = exposure_gains(CameraFaults(exposure_mismatch=0.2), 5, index)
        ratios.append(np.log(right / left))
    # Two pictures' chances add up in their ratio.
    assert abs(np.mean(ratios)) == pytest.approx(np.log(1.2), abs=3 * 0.02 * np.sqrt(2) / np.sqrt(200))
    assert np.std(ratios) == pytest.approx(0.02 * np.sqrt(2), rel=0.15)
    assert exposure_gains(CameraFaults(), 5, 0) == (1.0, 1.0)


def test_either_camera_may_be_the_brighter_one() -> None:
    brighter = {left > right for left, right in (exposure_gains(camera_faults("bad"), seed, 0) for seed in range(12))}
    assert brighter == {False, True}


def test_exposure_acts_on_light_and_white_stays_white() -> None:
    faults = CameraFaults(exposure_mismatch=0.3)
    left, right = FaultyPair(CAMERA, faults, 0).taken(flat(100), 0)
    gains = exposure_gains(faults, 0, 0)
    assert light(left) == pytest.approx(light(flat(100)[0]) * gains[0], rel=0.02)
    assert light(right) == pytest.approx(light(flat(100)[1]) * gains[1], rel=0.02)
    assert max(image.max() for image in FaultyPair(CAMERA, faults, 0).taken(flat(255), 0)) == 255


def test_white_balance_differs_between_surfaces_smoothly_and_at_most_by_the_mismatch() -> None:
    levels = np.tile(np.arange(256, dtype=np.uint8), (4, 1))
    camera = StereoCamera(300.0, 127.5, 1.5, 0.06, 256, 4)
    left, right = FaultyPair(camera, CameraFaults(white_balance_mismatch=0.2), 3).taken((levels, levels), 0)
    seen = levels[0, 60:220]
    ratio = (right[0, 60:220] / left[0, 60:220]) ** 2
    assert np.abs(ratio - 1).max() == pytest.approx(0.2, abs=0.09)
    assert np.abs(ratio - 1).max() <= 0.2 / 0.9 + 0.03
    # Rounding alone makes steps of 2/gray; the function itself turns over some tens of levels.
    assert np.abs(np.diff(ratio)).max() < 2.5 * 2 / seen.min()
    assert np.ptp(ratio) > 0.05
    other, _ = FaultyPair(camera, CameraFaults(white_balance_mismatch=0.2), 4).taken((levels, levels), 0)
    assert not np.array_equal(left, other)


@pytest.mark.parametrize("gray", [40, 200])
def test_automatic_exposure_brings_every_scene_to_mid_gray(gray: int) -> None:
    seen = next(iter(FaultyCameras(FewObservations(1, (gray,)), CameraFaults(auto_exposure=1.0), 0)))
    assert light(seen.left) == pytest.approx(0.18, rel=0.03)
    half = next(iter(FaultyCameras(FewObservations(1, (gray,)), CameraFaults(auto_exposure=0.5), 0)))
    assert light(half.left) == pytest.approx(np.sqrt(0.18 * (gray / 255) ** 2), rel=0.03)


def test_automatic_exposure_is_late() -> None:
    exposure = AutoExposure(1.0)
    dark, bright = flat(60), flat(180)
    settled = exposure.gains(dark, 0.0)[0]
    assert exposure.gains(bright, 1.0)[0] == settled
    later = exposure.gains(bright, 1.5)[0]
    assert later < settled
    # After .5 s the way to the new exposure is done to 1/e.
    whole = np.log((60 / 180) ** 2)
    assert np.log(later / settled) == pytest.approx(whole * (1 - 1 / np.e), rel=1e-6)


def test_each_camera_meters_what_it_sees_itself() -> None:
    left, right = AutoExposure(1.0).gains((flat(60)[0], flat(120)[0]), 0.0)
    assert left == pytest.approx(4 * right)


def test_a_black_scene_is_not_brightened_without_end() -> None:
    assert AutoExposure(1.0).gains(flat(0), 0.0) == (8.0, 8.0)


@pytest.mark.parametrize("electrons", [500.0, 5000.0])
@pytest.mark.parametrize("gray", [60, 128, 200])
def test_shot_noise_is_the_same_on_every_gray_level_of_a_square_root(electrons: float, gray: int) -> None:
    left, _ = FaultyPair(WIDE, CameraFaults(full_well_e=electrons), 0).taken(flat(gray, WIDE), 0)
    # Rounding to whole gray levels adds a variance of 1/12.
    assert left.std() == pytest.approx(np.hypot(127.5 / np.sqrt(electrons), 12**-0.5), rel=0.04)


def test_read_noise_hurts_in_the_dark() -> None:
    """d gray / d light = 255 / (2 sqrt(light)): 20 of 4000 electrons are .005 of white."""
    faults = CameraFaults(full_well_e=4000.0, read_noise_e=20.0)
    for gray in (51, 204):
        left, _ = FaultyPair(WIDE, faults, 0).taken(flat(gray, WIDE), 0)
        read = 127.5 / (gray / 255) * 20 / 4000
        assert left.std() == pytest.approx(np.sqrt((127.5**2 / 4000) + read**2 + 1 / 12), rel=0.05)


def test_both_cameras_and_every_picture_have_noise_of_their_own() -> None:
    pair = FaultyPair(WIDE, CameraFaults(full_well_e=500.0), 0)
    (left, right), (again, _), (same, _) = (pair.taken(flat(128, WIDE), index) for index in (0, 1, 0))
    for other in (right, again):
        assert abs(np.corrcoef(left.ravel(), other.ravel())[0, 1]) < 0.02
    assert np.array_equal(left, same)


def test_arms_share_their_random_numbers() -> None:
    """Noise of twice the strength is the same noise, whatever other faults there are."""
    weak, strong = (
        FaultyPair(WIDE, faults, 3).taken(flat(128, WIDE), 7)[0].astype(float)
        for faults in (
            CameraFaults(full_well_e=1000.0),
            CameraFaults(full_well_e=250.0, exposure_mismatch=0.1, vignetting=0.1, gamma=2.2),
        )
    )
    assert np.corrcoef(weak.ravel(), strong.ravel())[0, 1] > 0.97


def test_gamma_is_the_exponent_of_the_curve() -> None:
    left, _ = FaultyPair(CAMERA, CameraFaults(gamma=2.5), 0).taken(flat(128), 0)
    assert left[0, 0] == pytest.approx(255 * (128 / 255) ** (2 / 2.5), abs=0.51)


def edge(camera: StereoCamera) -> tuple[np.ndarray, np.ndarray]:
    image = np.full(camera.shape, 90, np.uint8)
    image[:, camera.width_px // 2 :] = 160
    return image, image.copy()


def test_sharpening_overshoots_at_an_edge_and_leaves_flat_ground_alone() -> None:
    heights = []
    for amount in (0.0, 0.5, 1.0):
        left, _ = FaultyPair(WIDE, CameraFaults(sharpening=amount), 0).taken(edge(WIDE), 0)
        assert left[150, 20] == 90 and left[150, -20] == 160
        heights.append(int(left[150].max()) - 160)
    # Half of what a blur takes away beside the edge: its share there is about .3 of the step.
    assert heights[0] == 0 and heights[2] == pytest.approx(2 * heights[1], abs=1)
    assert heights[2] == pytest.approx(70 * 0.31, abs=2)


def test_defocus_spreads_an_edge_by_its_deviation() -> None:
    for blur_px in (1.0, 2.0):
        left, _ = FaultyPair(WIDE, CameraFaults(defocus_px=blur_px), 0).taken(edge(WIDE), 0)
        line = (left[150] / 255.0) ** 2
        steps = np.diff(line)
        steps /= steps.sum()
        place = np.arange(len(steps))
        width = np.sqrt((steps * (place - (steps * place).sum()) ** 2).sum())
        assert width == pytest.approx(blur_px, rel=0.05)


def test_jpeg_loses_more_the_lower_its_quality() -> None:
    image = np.random.default_rng(1).integers(60, 200, WIDE.shape).astype(np.uint8)
    image = cv2.GaussianBlur(image, (0, 0), 1.0)
    lost = []
    for quality in (100, 95, 85, 50):
        left, _ = FaultyPair(WIDE, CameraFaults(jpeg_quality=quality), 0).taken((image, image), 0)
        lost.append(np.abs(left.astype(int) - image).mean())
    assert lost[0] == 0 and lost == sorted(lost) and lost[1] > 0.2 and lost[3] > 1.5 * lost[2]


@pytest.mark.parametrize(
    ("name", "value", "reason"),
    [
        ("defocus_px", -1.0, "must be 0 to 20, not -1.0"),
        ("defocus_px", 1e5, "must be 0 to 20, not 100000.0"),
        ("calibration_error_deg", 90.0, "must be 0 to 5, not 90.0"),
        ("sharpening", 1e9, "must be 0 to 10, not 1000000000.0"),
        ("rolling_shutter_s", 3600.0, "must be 0 to 0.1, not 3600.0"),
        ("time_skew_s", 3600.0, "must be 0 to 0.1, not 3600.0"),
        ("distortion_k1", -1e3, "must be -2 to 2, not -1000.0"),
        ("jpeg_quality", 0, "must be 1 to 100, not 0"),
        ("jpeg_quality", 50.5, "must be a whole number, not 50.5"),
        ("full_well_e", 0.0, "must be at least 1, or inf, not 0.0"),
        ("gamma", 0.0, "must be 0.5 to 5, not 0.0"),
    ],
)
def test_a_number_out_of_range_is_named_with_its_range(name: str, value: float, reason: str) -> None:
    with pytest.raises(InvalidInputError, match=f"^{name} {reason}$"):
        CameraFaults(**{name: value})  # type: ignore[arg-type]


@pytest.mark.parametrize("name", [field.name for field in fields(CameraFaults)])
def test_what_is_no_finite_number_is_refused_but_for_a_well_without_end(name: str) -> None:
    for value in (np.nan, -np.inf, *([] if name == "full_well_e" else [np.inf])):
        with pytest.raises(InvalidInputError, match=f"^{name} must be [^\n]*, not {value}$"):
            camera_faults(f"mild, {name}={value}")
    assert camera_faults("mild, full_well_e=inf, read_noise_e=0").full_well_e == np.inf


def test_read_noise_without_a_well_is_refused() -> None:
    with pytest.raises(InvalidInputError, match=r"read_noise_e = 3\.0 needs full_well_e"):
        CameraFaults(read_noise_e=3.0)


def test_parts_of_a_preset_are_chosen_in_words_or_by_name() -> None:
    assert camera_faults("mild") == PRESETS["mild"]
    chosen = camera_faults("minoru, jpeg_quality=50, time_skew_s = 0")
    assert chosen == camera_faults("minoru", jpeg_quality=50, time_skew_s=0)
    assert (chosen.jpeg_quality, chosen.time_skew_s, chosen.defocus_px) == (50, 0, PRESETS["minoru"].defocus_px)


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        (
            "wild",
            r"no preset of camera faults named 'wild'; did you mean 'mild'\? choose from: bad, ideal, mild, minoru",
        ),
        ("mild, skew=0", "no camera fault named 'skew'; choose from: .*time_skew_s"),
        ("mild, jpeg_quality", "expected part=number, such as jpeg_quality=50, not 'jpeg_quality'"),
        ("mild, jpeg_quality=good", "expected part=number"),
        ("mild, jpeg_quality=300", "jpeg_quality must be 1 to 100, not 300"),
    ],
)
def test_an_unknown_preset_or_part_is_named_with_the_choices(name: str, reason: str) -> None:
    with pytest.raises(InvalidInputError, match=reason):
        camera_faults(name)


def test_presets_grow_worse_in_their_order() -> None:
    ordered = [PRESETS[name] for name in ("ideal", "mild", "minoru", "bad")]
    for name, sign in {
        "exposure_mismatch": 1, "white_balance_mismatch": 1, "auto_exposure": 1, "vignetting": 1, "defocus_px": 1,
        "distortion_k1": -1, "calibration_error_deg": 1, "full_well_e": -1, "gamma": 1, "sharpening": 1,
        "jpeg_quality": -1, "rolling_shutter_s": 1, "time_skew_s": 1, "drop_share": 1, "repeat_share": 1,
    }.items():  # fmt: skip
        values = [sign * getattr(faults, name) for faults in ordered]
        assert values == sorted(values), name


def test_a_seed_below_zero_is_refused() -> None:
    with pytest.raises(InvalidInputError, match="seed"):
        FaultyPair(CAMERA, CameraFaults(), -1)
