"""Noise comes after the truth, from (seed, index, side) alone."""

from collections.abc import Iterator

import numpy as np
import pytest

from sim.noise import IMAGE_NOISE, ImageNoise, NoisyImages, image_noise
from stereogrid.camera import StereoCamera
from stereogrid.errors import InvalidInputError
from stereogrid.observation import Observation, Odometry, Recording, Truth


class FewObservations:
    """Observations start, start + 1, ... of an endless recording whose images are all alike."""

    def __init__(self, count: int) -> None:
        self.camera = StereoCamera(80.0, 31.5, 23.5, 0.06, 64, 48)
        self.T_base_cam = np.eye(4)
        self.count = count

    def __len__(self) -> int:
        return self.count

    def __iter__(self) -> Iterator[Observation]:
        image = np.full(self.camera.shape, 128, np.uint8)
        for i in range(self.count):
            yield Observation(float(i), image, image, Odometry(np.eye(4)), np.eye(4), Truth(np.eye(4)))


def test_ideal_noise_is_the_identity() -> None:
    image = np.arange(256, dtype=np.uint8).reshape(16, 16)
    assert np.array_equal(IMAGE_NOISE["ideal"].apply(image, np.random.default_rng(0)), image)


def test_noise_of_an_observation_depends_on_seed_index_and_side_only() -> None:
    short, long = (list(NoisyImages(FewObservations(n), IMAGE_NOISE["mild"], seed=7)) for n in (2, 5))
    for a, b in zip(short, long, strict=False):
        assert np.array_equal(a.left, b.left) and np.array_equal(a.right, b.right)
    assert not np.array_equal(long[0].left, long[1].left)
    assert not np.array_equal(long[0].left, long[0].right)
    other = next(iter(NoisyImages(FewObservations(1), IMAGE_NOISE["mild"], seed=8)))
    assert not np.array_equal(long[0].left, other.left)


def test_a_noisy_recording_is_a_recording_and_can_be_read_twice() -> None:
    noisy = NoisyImages(FewObservations(2), IMAGE_NOISE["webcam"], seed=1)
    assert isinstance(noisy, Recording) and len(noisy) == 2
    assert [o.left.tobytes() for o in noisy] == [o.left.tobytes() for o in noisy]


def test_truth_and_odometry_pass_untouched() -> None:
    clean = list(FewObservations(2))
    noisy = list(NoisyImages(FewObservations(2), IMAGE_NOISE["mild"], seed=1))
    for a, b in zip(clean, noisy, strict=True):
        assert b.truth is not None and a.stamp_s == b.stamp_s
        assert np.array_equal(a.odometry.T_odom_base, b.odometry.T_odom_base)


def test_arms_share_their_random_numbers() -> None:
    image = np.full((100, 100), 128, np.uint8)
    weak, strong = (
        ImageNoise(read_noise_gray=s).apply(image, np.random.default_rng([1, 2, 0])).astype(float) - 128
        for s in (8.0, 16.0)
    )
    assert np.corrcoef(weak.ravel(), strong.ravel())[0, 1] > 0.99


@pytest.mark.parametrize("electrons", [500.0, 5000.0])
def test_shot_noise_has_the_deviation_that_the_full_well_says(electrons: float) -> None:
    image = np.full((200, 200), 128, np.uint8)
    noisy = ImageNoise(full_well_e=electrons).apply(image, np.random.default_rng(0))
    # Rounding to whole gray levels adds a variance of 1/12.
    assert noisy.std() == pytest.approx(np.hypot(127.5 / np.sqrt(electrons), 12**-0.5), rel=0.03)


def test_an_unknown_preset_and_a_bad_number_are_named() -> None:
    with pytest.raises(InvalidInputError, match=r"no image noise named 'wild'; choose from: ideal, mild"):
        image_noise("wild")
    with pytest.raises(InvalidInputError, match="blur_px"):
        ImageNoise(blur_px=-1)
