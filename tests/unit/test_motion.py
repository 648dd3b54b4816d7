"""eps grows as fitted, odometry noise grows with the path and with nothing else, and truth stays the truth."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from stereogrid.camera import StereoCamera
from stereogrid.errors import InvalidInputError
from stereogrid.geometry import R_BASE_OPTICAL, as_pose, from_rotation, from_yaw, inverse, yaw_rad
from stereogrid.motion import Growth, MotionError, MotionNoise, NoisyOdometry, OdometryNoise, PoseUncertainty
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
    assert eps(MotionError(along=Growth(a_m, b), kappa=kappa), 0.0) == 0


@given(amounts, distances_m)
def test_random_slip_grows_with_the_square_root_of_the_distance(a_m, d_m):
    assert eps(MotionError(along=Growth(a_m)), d_m) == pytest.approx(np.sqrt(a_m * d_m), abs=1e-12)
    assert eps(MotionError(along=Growth(a_m)), 4 * d_m) == pytest.approx(
        2 * eps(MotionError(along=Growth(a_m)), d_m), abs=1e-12
    )


@given(amounts, distances_m)
def test_scale_error_grows_with_the_distance(b, d_m):
    assert eps(MotionError(along=Growth(b=b)), d_m) == pytest.approx(b * d_m, abs=1e-12)


@given(amounts, amounts, st.floats(0, 3), distances_m)
def test_eps_adds_the_variances_of_slip_and_scale_times_kappa(a_m, b, kappa, d_m):
    both = eps(MotionError(along=Growth(a_m, b), kappa=kappa), d_m)
    expected = kappa * np.hypot(eps(MotionError(along=Growth(a_m)), d_m), eps(MotionError(along=Growth(b=b)), d_m))
    assert both == pytest.approx(expected, abs=1e-12)


def test_eps_known_value():
    """a = 1 mm, b = 1 %: after 4 m, sqrt(.004 + .0016) = 7.48 cm."""
    assert eps(MotionError(along=Growth(0.001, 0.01)), 4.0) == pytest.approx(0.074833, abs=1e-6)


@pytest.mark.parametrize("kind", [MotionError, OdometryNoise, Growth])
@pytest.mark.parametrize("value", [-0.1, np.nan, np.inf])
def test_an_amount_of_error_that_cannot_be_is_refused_by_name(kind, value):
    for name in (name for name, default in vars(kind()).items() if isinstance(default, float)):
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


@pytest.mark.parametrize(("steps", "seed"), [(1, 1), (3, 2)])
def test_noise_of_a_straight_metre_has_the_documented_variance_however_finely_it_is_sampled(steps, seed):
    straight = from_yaw(0, [1 / steps, 0, 0])
    # Both at once: what a heading of .05 rad takes from the path is a thousandth of it, and varies by far less.
    path_var, heading_var = spread(OdometryNoise(translation_per_m=0.003, rotation_per_m=0.002), straight, steps, seed)
    assert path_var == pytest.approx(0.003, rel=WITHIN)
    assert heading_var == pytest.approx(0.002, rel=WITHIN)


@pytest.mark.parametrize(("steps", "seed"), [(1, 3), (3, 4)])
def test_noise_of_a_turn_on_the_spot_has_the_documented_variance_however_finely_it_is_sampled(steps, seed):
    turn = from_yaw(0.6 / steps)
    _, heading_var = spread(OdometryNoise(rotation_per_rad=0.01), turn, steps, seed)
    assert heading_var == pytest.approx(0.006, rel=WITHIN)


@pytest.mark.parametrize("steps", [1, 3])
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


# The covariance of the poses of a drive

CAMERA_AHEAD = from_rotation(R_BASE_OPTICAL, [0.3, 0.0, 0.4])
AT_BASE = from_rotation(R_BASE_OPTICAL)
EVERY_ERROR = MotionError(
    position_m=0.02,
    heading_rad=0.01,
    along=Growth(2e-3, 0.02),
    across=Growth(1e-3, 0.01),
    heading=Growth(4e-4, 0.01),
    turn=Growth(1e-3, 0.03),
)
HEADING, FORWARD, SIDEWAYS = 5, 0, 1
KNOWN = np.ix_([0, 1, 5], [0, 1, 5])
"""What of a pose errs at all: x, y and the heading."""


def drive_of(steps, T_base_cam=AT_BASE, start=None):
    """Observations of a drive of steps (path [m], turn [rad]), each an arc, from the pose start on."""
    T, travelled_m, turned_rad = np.eye(4) if start is None else start, 0.0, 0.0
    dark = np.zeros((2, 2), np.uint8)
    found = []
    for path_m, turn_rad in [(0.0, 0.0), *steps]:
        half = from_yaw(0.5 * turn_rad)
        chord_m = path_m * np.sinc(0.5 * turn_rad / np.pi)
        T = T @ half @ from_yaw(0.0, [chord_m, 0, 0]) @ half
        travelled_m, turned_rad = travelled_m + abs(path_m), turned_rad + abs(turn_rad)
        odometry = Odometry(T, travelled_m, turned_rad)
        found.append(Observation(float(len(found)), dark, dark, odometry, T @ T_base_cam))
    return found


class Steps(list):
    """Observations as a recording."""

    camera = StereoCamera(40, 0.5, 0.5, 0.06, 2, 2)
    T_base_cam = AT_BASE


def covariances(error, observations):
    uncertainty = PoseUncertainty(error)
    return np.array([uncertainty.step(each) for each in observations])


def last(error, observations):
    return covariances(error, observations)[-1]


STRAIGHTS_AND_TURNS = [(0.8, 0.0)] * 3 + [(0.0, 0.7)] + [(0.6, 0.3)] * 3 + [(0.0, -0.5)] + [(0.7, -0.2)] * 2


@pytest.mark.parametrize("n", [1, 5, 40])
def test_on_a_straight_run_each_error_grows_as_it_is_stated_however_finely_it_is_sampled(n):
    d, straight = 5.0, drive_of([(5.0 / n, 0.0)] * n)
    g = Growth(2e-3, 0.03)
    assert last(MotionError(along=g), straight)[FORWARD, FORWARD] == pytest.approx(g.sigma(d) ** 2)
    assert last(MotionError(across=g), straight)[SIDEWAYS, SIDEWAYS] == pytest.approx(g.sigma(d) ** 2)
    walk, bend = (last(MotionError(heading=each), straight) for each in (Growth(g.a), Growth(b=g.b)))
    assert walk[HEADING, HEADING] == pytest.approx(g.a * d)
    assert walk[SIDEWAYS, SIDEWAYS] == pytest.approx(g.a * d**3 / 3)
    assert walk[SIDEWAYS, HEADING] == pytest.approx(g.a * d**2 / 2)
    assert bend[HEADING, HEADING] == pytest.approx(g.b**2 * d**2)
    assert bend[SIDEWAYS, SIDEWAYS] == pytest.approx(g.b**2 * d**4 / 4)
    assert bend[SIDEWAYS, HEADING] == pytest.approx(g.b**2 * d**3 / 2)
    for each in (walk, bend):
        assert each[FORWARD, FORWARD] == 0
    np.testing.assert_array_equal(last(MotionError(turn=g), straight), 0)


@given(st.integers(1, 12), amounts, amounts)
def test_along_a_straight_run_the_covariance_is_eps(n, a_m, b):
    error, straight = MotionError(along=Growth(a_m, b), position_m=0.03, kappa=1.5), drive_of([(0.4, 0.0)] * n)
    for each, C in zip(straight, covariances(error, straight), strict=True):
        assert np.sqrt(C[FORWARD, FORWARD]) == pytest.approx(error.sigma_m(each.odometry), abs=1e-12)


@pytest.mark.parametrize("n", [1, 6])
def test_a_turn_on_the_spot_makes_the_heading_err_and_nothing_else(n):
    C = last(MotionError(turn=Growth(1e-3, 0.03), along=Growth(1, 1)), drive_of([(0.0, 1.5 / n)] * n))
    assert C[HEADING, HEADING] == pytest.approx(1e-3 * 1.5 + (0.03 * 1.5) ** 2)
    C[HEADING, HEADING] = 0
    np.testing.assert_allclose(C, 0, atol=1e-15)


def test_there_and_back_again_a_wrong_scale_is_undone_and_slip_adds_up():
    there_and_back = drive_of([(0.5, 0.0)] * 4 + [(-0.5, 0.0)] * 4)
    assert last(MotionError(along=Growth(b=0.05)), there_and_back)[FORWARD, FORWARD] == pytest.approx(0, abs=1e-15)
    assert last(MotionError(along=Growth(0.01)), there_and_back)[FORWARD, FORWARD] == pytest.approx(0.04)
    left_and_right = drive_of([(0.0, 0.5)] * 2 + [(0.0, -0.5)] * 2)
    assert last(MotionError(turn=Growth(b=0.05)), left_and_right)[HEADING, HEADING] == pytest.approx(0, abs=1e-15)
    assert last(MotionError(turn=Growth(0.01)), left_and_right)[HEADING, HEADING] == pytest.approx(0.02)


def test_after_a_turn_what_was_along_is_across():
    bent = drive_of([(2.0, 0.0), (0.0, np.pi / 2), (3.0, 0.0)])
    C = last(MotionError(along=Growth(0.01)), bent)
    np.testing.assert_allclose(C[:2, :2], np.diag([0.02, 0.03]), atol=1e-15)
    # 1 degree too far at the corner is 3 m of it sideways, which is backwards of where the drive began.
    C = last(MotionError(turn=Growth(b=0.02 / np.pi)), bent)
    assert C[FORWARD, FORWARD] == pytest.approx((3 * 0.01) ** 2)
    assert C[FORWARD, HEADING] == pytest.approx(-3 * 0.01**2)


def test_where_the_pose_is_known_again_its_uncertainty_begins_anew():
    first, second = drive_of(STRAIGHTS_AND_TURNS), drive_of(STRAIGHTS_AND_TURNS, start=from_yaw(1.0, [3, 2, 0]))
    both = covariances(EVERY_ERROR, [*first, *second])
    np.testing.assert_array_equal(both[len(first) :], covariances(EVERY_ERROR, second))
    assert both[len(first) - 1, 0, 0] > 10 * both[len(first), 0, 0]


def test_what_errs_anew_at_each_pose_does_not_grow():
    error = MotionError(position_m=0.05, heading_rad=0.02)
    for C in covariances(error, drive_of(STRAIGHTS_AND_TURNS)):
        np.testing.assert_allclose(C, np.diag([0.05**2, 0.05**2, 0, 0, 0, 0.02**2]), atol=1e-15)


def test_a_camera_ahead_of_the_wheels_is_swung_aside_by_the_heading():
    """.3 m before the wheels, 2 degrees: 1 cm."""
    error, turned = MotionError(heading_rad=np.radians(2)), from_yaw(np.pi / 2)
    C = last(error, drive_of([], CAMERA_AHEAD, start=turned))
    assert np.sqrt(C[FORWARD, FORWARD]) == pytest.approx(0.3 * np.radians(2))
    assert C[FORWARD, HEADING] == pytest.approx(-0.3 * np.radians(2) ** 2)
    assert C[SIDEWAYS, SIDEWAYS] == pytest.approx(0, abs=1e-15)


def test_the_covariance_hardly_depends_on_how_often_a_drive_is_sampled():
    fine = [(path / 8, turn / 8) for path, turn in STRAIGHTS_AND_TURNS for _ in range(8)]
    coarse, finer = (last(EVERY_ERROR, drive_of(steps, CAMERA_AHEAD)) for steps in (STRAIGHTS_AND_TURNS, fine))
    np.testing.assert_allclose(coarse, finer, atol=0.005 * np.sqrt(np.outer(finer.diagonal(), finer.diagonal())).max())


@given(st.floats(-3, 3), st.floats(-9, 9), st.floats(-9, 9))
def test_turning_the_world_turns_the_covariance_and_shifting_it_does_nothing(yaw, x_m, y_m):
    T = from_yaw(yaw, [x_m, y_m, 0])
    both = np.kron(np.eye(2), T[:3, :3])
    here = last(EVERY_ERROR, drive_of(STRAIGHTS_AND_TURNS, CAMERA_AHEAD))
    there = last(EVERY_ERROR, drive_of(STRAIGHTS_AND_TURNS, CAMERA_AHEAD, start=T))
    np.testing.assert_allclose(there, both @ here @ both.T, atol=1e-12)


@given(st.floats(0, 4))
def test_kappa_scales_all_standard_deviations(kappa):
    drive = drive_of(STRAIGHTS_AND_TURNS, CAMERA_AHEAD)
    one, scaled = (last(replace(EVERY_ERROR, kappa=k), drive) for k in (1.0, kappa))
    np.testing.assert_allclose(scaled, kappa**2 * one, atol=1e-15)


@pytest.mark.parametrize("kind", ["slip", "kept", "anew"])
def test_noise_errs_as_much_as_the_covariance_says(kind):
    """Through the whole of NoisyOdometry, at the camera: truth less claim, turned into world's axes."""
    error = {
        "slip": MotionError(along=Growth(2e-4), across=Growth(1e-4), heading=Growth(5e-5), turn=Growth(1e-4)),
        "kept": MotionError(along=Growth(b=0.01), across=Growth(b=0.005), heading=Growth(b=0.004), turn=Growth(b=0.01)),
        "anew": MotionError(position_m=0.02, heading_rad=0.01),
    }[kind]
    recording = Steps(drive_of([*STRAIGHTS_AND_TURNS[::3], (0.5, 0.9)], CAMERA_AHEAD))
    recording.T_base_cam = CAMERA_AHEAD
    expected, n = last(error, recording), 500
    claims = [list(NoisyOdometry(recording, MotionNoise(error), seed))[-1].T_world_cam for seed in range(n)]
    assert_errs_as(expected, recording[-1].T_world_cam, claims)


@pytest.mark.parametrize("error", [MotionError(heading=Growth(1e-4)), MotionError(turn=Growth(3e-4, 0.02))])
def test_noise_errs_as_much_as_the_covariance_says_in_one_step_as_long_as_a_drive(error):
    start, arrived = drive_of([(2.0, 0.8)])
    step, rng = arrived.odometry.T_odom_base, np.random.default_rng(4)
    claims = [MotionNoise(error).walk(np.eye(4), rng)(step) @ AT_BASE for _ in range(N)]
    assert_errs_as(last(error, [start, arrived]), arrived.T_world_cam, claims)


def assert_errs_as(expected, true, claims):
    """Claimed poses (4, 4) of the camera err from the true one as a covariance (6, 6) says."""
    n, errors = len(claims), np.empty((len(claims), 6))
    for each, claimed in zip(errors, claims, strict=True):
        each[:3] = true[:3, 3] - claimed[:3, 3]
        each[3:] = Rotation.from_matrix(true[:3, :3] @ claimed[:3, :3].T).as_rotvec()
    found, sigma = errors.T @ errors / n, np.sqrt(expected.diagonal())
    assert (sigma[[0, 1, 5]] > 0.005).all()
    # Five standard errors of a covariance.
    allowed = 5 / np.sqrt(n) * np.sqrt(np.outer(sigma, sigma) ** 2 + expected**2)
    assert (np.abs(found - expected) <= allowed + 1e-12).all()
    # Nearly as much as is claimed of each direction, also of those in which hardly anything errs.
    values, vectors = np.linalg.eigh(expected[KNOWN])
    of_direction = vectors.T @ found[KNOWN] @ vectors
    for value, ratio in zip(values, of_direction.diagonal() / values, strict=True):
        if value > 1e-7:
            assert ratio == pytest.approx(1, abs=0.3)


def test_noise_begins_anew_where_the_pose_is_known_again():
    steps = [(0.5, 0.1)] * 4
    recording = Steps([*drive_of(steps), *drive_of(steps, start=from_yaw(1.0, [3, 2, 0]))])
    for noise in (MotionNoise(EVERY_ERROR), FIELD_NOISE):
        off = odometry_poses(NoisyOdometry(recording, noise, 3)) - odometry_poses(recording)
        assert (np.abs(off).max(axis=(1, 2)) > 1e-4).tolist() == [False, *[True] * 4, False, *[True] * 4]


def test_a_motion_error_of_zero_is_no_noise():
    recording = Steps(drive_of(STRAIGHTS_AND_TURNS))
    noisy = NoisyOdometry(recording, MotionNoise(MotionError()), 1)
    np.testing.assert_allclose(odometry_poses(noisy), odometry_poses(recording), atol=1e-12)
    assert MotionError().is_zero
    assert not EVERY_ERROR.is_zero
    assert replace(EVERY_ERROR, kappa=0.0).is_zero


def test_what_a_run_keeps_is_the_same_for_all_of_it():
    """A scale 3 % too large after one metre is 3 % too large after ten."""
    recording = Steps(drive_of([(1.0, 0.0)] * 10))
    claimed = odometry_poses(NoisyOdometry(recording, MotionNoise(MotionError(along=Growth(b=0.05))), 5))[1:, 0, 3]
    np.testing.assert_allclose(claimed / claimed[0], np.arange(1, 11))
    assert abs(claimed[0] - 1) > 1e-3
