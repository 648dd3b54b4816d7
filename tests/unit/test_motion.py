"""eps grows as fitted, odometry noise grows with the path and with nothing else, and truth stays the truth."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stereogrid.camera import StereoCamera
from stereogrid.errors import InvalidInputError
from stereogrid.geometry import R_BASE_OPTICAL, as_pose, from_rotation, from_yaw, inverse, yaw_rad
from stereogrid.motion import MotionError, NoisyOdometry, OdometryNoise
from stereogrid.observation import Observation, Odometry, Recording, Truth

N = 2000
WITHIN = 5 * np.sqrt(2 / N)
"""Five standard errors of a variance from N samples, relative."""

T_BASE_CAM = from_rotation(R_BASE_OPTICAL, [0.1, 0.03, 0.4])
FIELD_NOISE = OdometryNoise(
    rotation_per_rad=0.01, rotation_per_m=0.002, translation_per_m=0.003, translation_per_rad=0.001
)


def eps(error, travelled_m):
    return error.sigma_m(Odometry(np.eye(4), travelled_m))


amounts = st.floats(0, 0.5)
distances_m = st.floats(0, 100)


@given(amounts, amounts, st.floats(0, 3))
def test_eps_is_zero_where_the_pose_is_certain(a_m, b, kappa):
    assert eps(MotionError(a_m, b, kappa), 0.0) == 0


@given(amounts, distances_m)
def test_random_slip_grows_with_the_square_root_of_the_distance(a_m, d_m):
    assert eps(MotionError(a_m=a_m), d_m) == pytest.approx(np.sqrt(a_m * d_m), abs=1e-12)
    assert eps(MotionError(a_m=a_m), 4 * d_m) == pytest.approx(2 * eps(MotionError(a_m=a_m), d_m), abs=1e-12)


@given(amounts, distances_m)
def test_scale_error_grows_with_the_distance(b, d_m):
    assert eps(MotionError(b=b), d_m) == pytest.approx(b * d_m, abs=1e-12)


@given(amounts, amounts, st.floats(0, 3), distances_m)
def test_eps_adds_the_variances_of_slip_and_scale_times_kappa(a_m, b, kappa, d_m):
    both = eps(MotionError(a_m, b, kappa), d_m)
    expected = kappa * np.hypot(eps(MotionError(a_m=a_m), d_m), eps(MotionError(b=b), d_m))
    assert both == pytest.approx(expected, abs=1e-12)


def test_eps_known_value():
    """a = 1 mm, b = 1 %: after 4 m, sqrt(.004 + .0016) = 7.48 cm."""
    assert eps(MotionError(a_m=0.001, b=0.01), 4.0) == pytest.approx(0.074833, abs=1e-6)


@pytest.mark.parametrize("kind", [MotionError, OdometryNoise])
@pytest.mark.parametrize("value", [-0.1, np.nan, np.inf])
def test_an_amount_of_error_that_cannot_be_is_refused_by_name(kind, value):
    for name in vars(kind()):
        with pytest.raises(InvalidInputError, match=f"{name} must be >= 0 and finite"):
            kind(**{name: value})


def spread(noise, step, steps, seed):
    """Variances of the path [m^2] and the heading [rad^2] over N drives of so many equal steps."""
    rng = np.random.default_rng(seed)
    path_m, heading_rad = np.empty(N), np.empty(N)
    for n in range(N):
        reported = [noise.perturbed(step, rng) for _ in range(steps)]
        path_m[n] = sum(T[0, 3] for T in reported)
        heading_rad[n] = sum(yaw_rad(T) for T in reported)
    return path_m.var(), heading_rad.var()


@pytest.mark.parametrize(("steps", "seed"), [(1, 1), (5, 2)])
def test_noise_of_a_straight_metre_has_the_documented_variance_however_finely_it_is_sampled(steps, seed):
    straight = from_yaw(0, [1 / steps, 0, 0])
    path_var, _ = spread(OdometryNoise(translation_per_m=0.003), straight, steps, seed)
    assert path_var == pytest.approx(0.003, rel=WITHIN)
    _, heading_var = spread(OdometryNoise(rotation_per_m=0.002), straight, steps, seed)
    assert heading_var == pytest.approx(0.002, rel=WITHIN)


@pytest.mark.parametrize(("steps", "seed"), [(1, 3), (5, 4)])
def test_noise_of_a_turn_on_the_spot_has_the_documented_variance_however_finely_it_is_sampled(steps, seed):
    turn = from_yaw(0.6 / steps)
    _, heading_var = spread(OdometryNoise(rotation_per_rad=0.01), turn, steps, seed)
    assert heading_var == pytest.approx(0.006, rel=WITHIN)


@pytest.mark.parametrize("steps", [1, 5])
def test_a_turn_on_the_spot_slips_by_the_documented_variance(steps):
    """Small turns, so that the slip stays along x: the steps' directions differ by what is left of 0.05 rad."""
    path_var, _ = spread(OdometryNoise(translation_per_rad=0.02), from_yaw(0.05 / steps), steps, 5)
    assert path_var == pytest.approx(0.02 * 0.05, rel=WITHIN)


def test_twice_the_path_has_twice_the_variance():
    short, long = (spread(FIELD_NOISE, from_yaw(0, [d, 0, 0]), 1, 6) for d in (0.5, 1.0))
    np.testing.assert_allclose(np.divide(long, short), 2, rtol=0.12)


def test_noise_is_unbiased():
    rng = np.random.default_rng(7)
    step = from_yaw(0.1, [0.5, 0.02, 0])
    errors = [inverse(step) @ FIELD_NOISE.perturbed(step, rng) for _ in range(N)]
    sd_rad, sd_m = np.sqrt(0.01 * 0.1 + 0.002 * 0.5), np.sqrt(0.003 * 0.5 + 0.001 * 0.1)
    assert np.mean([yaw_rad(T) for T in errors]) == pytest.approx(0, abs=4 * sd_rad / np.sqrt(N))
    assert np.mean([T[0, 3] for T in errors]) == pytest.approx(0, abs=4 * sd_m / np.sqrt(N) + sd_rad**2 * 0.5)


@given(st.floats(-3, 3), st.floats(-5, 5), st.floats(-5, 5), st.integers(0, 100))
def test_zero_noise_changes_nothing_and_any_noise_gives_a_pose_and_spares_its_argument(yaw, x_m, y_m, seed):
    step = from_yaw(yaw, [x_m, y_m, 0])
    before = step.copy()
    np.testing.assert_allclose(OdometryNoise().perturbed(step, np.random.default_rng(seed)), step, atol=1e-12)
    as_pose(FIELD_NOISE.perturbed(step, np.random.default_rng(seed)))
    np.testing.assert_array_equal(step, before)


def test_standing_still_adds_no_noise():
    np.testing.assert_array_equal(FIELD_NOISE.perturbed(np.eye(4), np.random.default_rng(0)), np.eye(4))


class Drive:
    """A recording of seven readings on a bend, kept in memory."""

    camera = StereoCamera(40, 15.5, 11.5, 0.06, 32, 24)
    T_base_cam = T_BASE_CAM

    def __init__(self):
        rng = np.random.default_rng(8)
        self.observations = []
        for i in range(7):
            left, right = rng.integers(0, 256, (2, 24, 32), dtype=np.uint8)
            T_odom_base = from_yaw(0.2 * i + 0.3, [0.5 * i + 2, 0.1 * i * i, 0])
            T_world_cam = T_odom_base @ T_BASE_CAM
            odometry = Odometry(T_odom_base, travelled_m=0.5 * i, turned_rad=0.2 * i)
            self.observations.append(Observation(0.1 * i, left, right, odometry, T_world_cam, Truth(T_world_cam)))

    def __len__(self):
        return len(self.observations)

    def __iter__(self):
        return iter(self.observations)


@pytest.fixture
def drive():
    return Drive()


def odometry_poses(recording):
    return np.array([each.odometry.T_odom_base for each in recording])


def test_noisy_odometry_is_the_same_drive_for_the_same_seed_every_time_it_is_read(drive):
    once = NoisyOdometry(drive, FIELD_NOISE, seed=5)
    np.testing.assert_array_equal(odometry_poses(once), odometry_poses(once))
    np.testing.assert_array_equal(odometry_poses(once), odometry_poses(NoisyOdometry(drive, FIELD_NOISE, seed=5)))
    other = odometry_poses(NoisyOdometry(drive, FIELD_NOISE, seed=6))
    assert np.abs(odometry_poses(once) - other)[-1].max() > 1e-3


def test_two_readers_at_once_do_not_disturb_each_other(drive):
    noisy = NoisyOdometry(drive, FIELD_NOISE, seed=5)
    pairs = list(zip(noisy, noisy, strict=True))
    assert len(pairs) == len(noisy) == 7
    for a, b in pairs:
        np.testing.assert_array_equal(a.T_world_cam, b.T_world_cam)


def test_noisy_odometry_leaves_truth_images_stamps_and_distances_alone(drive):
    noisy = NoisyOdometry(drive, FIELD_NOISE, seed=5)
    assert isinstance(noisy, Recording)
    assert noisy.camera is drive.camera
    for clean, read in zip(drive, noisy, strict=True):
        assert read.left is clean.left
        assert read.right is clean.right
        assert read.truth is clean.truth
        assert read.stamp_s == clean.stamp_s
        assert read.odometry.travelled_m == clean.odometry.travelled_m
        assert read.odometry.turned_rad == clean.odometry.turned_rad


def test_the_claimed_camera_pose_is_the_noisy_odometry_and_the_mounting(drive):
    for each in NoisyOdometry(drive, FIELD_NOISE, seed=5):
        np.testing.assert_allclose(each.T_world_cam, each.odometry.T_odom_base @ T_BASE_CAM, atol=1e-12)


def test_noisy_odometry_starts_at_the_truth_and_drifts_away_from_it(drive):
    noisy, clean = odometry_poses(NoisyOdometry(drive, FIELD_NOISE, seed=5)), odometry_poses(drive)
    np.testing.assert_array_equal(noisy[0], clean[0])
    assert (np.abs(noisy[1:] - clean[1:]).max(axis=(1, 2)) > 1e-4).all()


def test_zero_noise_reads_the_recording_as_it_is(drive):
    np.testing.assert_allclose(
        odometry_poses(NoisyOdometry(drive, OdometryNoise(), 1)), odometry_poses(drive), atol=1e-9
    )


def test_an_empty_recording_stays_empty(drive):
    drive.observations = []
    assert list(NoisyOdometry(drive, FIELD_NOISE, seed=5)) == []
