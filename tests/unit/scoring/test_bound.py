"""Hits err as often beyond the bound as it says when errors are as claimed, and far more often when they are not."""

import numpy as np
import pytest

from stereogrid.camera import StereoCamera
from stereogrid.errors import InvalidInputError
from stereogrid.geometry import R_BASE_OPTICAL, from_rotation, from_yaw, transform
from stereogrid.motion import Growth, MotionError, MotionNoise, PoseUncertainty
from stereogrid.observation import Disparity, Observation, Odometry, Truth
from stereogrid.scoring import BOUND_NAMES, BoundTest, RayCaster, Sampling, bound_coverage, measure_hits

CAMERA = StereoCamera(focal_px=200, cx_px=79.5, cy_px=59.5, baseline_m=0.1, width_px=160, height_px=120)
T_BASE_CAM = from_rotation(R_BASE_OPTICAL, [0.1, 0.03, 0.4])
SIGMA_PX = 0.1
EVERY = Sampling(step_px=1)
SHARE = 0.95


@pytest.fixture(autouse=True)
def _embree(request):
    if "box" in request.fixturenames:
        pytest.importorskip("embreex", reason="the true mesh is met by rays that embreex casts")


def depths_m(seed=0):
    return np.random.default_rng(seed).uniform(1.0, 4.0, CAMERA.shape).astype(np.float32)


def reading(depth_m, seed=0, sigma_px=SIGMA_PX):
    """A disparity of that true depth with the error that it claims."""
    noise = np.random.default_rng([seed, 1]).normal(0, sigma_px, depth_m.shape)
    return Disparity((CAMERA.disparity_px(depth_m) + noise).astype(np.float32), np.float32(sigma_px))


def flat(depth_m):
    return np.full(CAMERA.shape, depth_m, dtype=np.float32)


def exact(depth_m, sigma_px=SIGMA_PX):
    return Disparity(CAMERA.disparity_px(depth_m).astype(np.float32), np.float32(sigma_px))


def moved(T, covariance, rng):
    """The pose of the true camera where T is claimed, drawn from the covariance as PoseUncertainty means it."""
    error = np.linalg.cholesky(covariance + 1e-18 * np.eye(6)) @ rng.standard_normal(6)
    turn = from_yaw(error[5])
    assert np.allclose(error[3:5], 0, atol=1e-8)
    true = T.copy()
    true[:3, 3] += error[:3]
    true[:3, :3] = turn[:3, :3] @ T[:3, :3]
    return true


def scores_of(test):
    found = test.scores()
    assert [(s.name, s.unit) for s in found] == [(name, unit) for name, (unit, _) in BOUND_NAMES.items()]
    return {s.name.removeprefix("bound_"): s.value for s in found}


def over_seeds(claim, true_of, n=400):
    """Scores over n observations, each with its own error of the pose, larger than that of the match."""
    test = BoundTest(CAMERA, sampling=Sampling(step_px=20))
    for seed in range(n):
        rng = np.random.default_rng([seed, 2])
        depth_m = depths_m(seed)
        T = from_yaw(rng.uniform(-3, 3), rng.uniform(-2, 2, 3)) @ T_BASE_CAM
        test.add(reading(depth_m, seed, sigma_px=0.03), T, Truth(true_of(T, rng), depth_m), **claim)
    return scores_of(test)


PLANAR = np.zeros((6, 6))
PLANAR[np.ix_([0, 1, 5], [0, 1, 5])] = [[4e-3, 1e-3, 3e-4], [1e-3, 2e-3, -4e-4], [3e-4, -4e-4, 4e-4]]
"""x, y and heading err together: some 5 cm and a degree."""


def test_gaussian_matches_seen_from_a_known_pose_are_covered_as_often_as_claimed():
    depth_m = depths_m()
    test = BoundTest(CAMERA, sampling=EVERY)
    test.add(reading(depth_m), T_BASE_CAM, Truth(T_BASE_CAM, depth_m))
    found = scores_of(test)
    assert found["coverage_along"] == pytest.approx(SHARE, abs=0.006)
    assert found["stretch_along"] == pytest.approx(1, abs=0.03)
    assert found["coverage_along"] == found["coverage_along_inliers"] and found["mismatches"] == 0
    assert np.isnan([found["coverage_across"], found["coverage_surface"]]).all()


def test_a_pose_that_errs_along_the_ray_is_covered_by_its_eps_and_not_without():
    eps_m = 0.05

    def true_of(T, rng):
        away = T.copy()
        away[:3, 3] += rng.normal(0, eps_m) * T[:3, 2]
        return away

    told, untold = (over_seeds(claim, true_of) for claim in ({"motion_sigma_m": eps_m}, {}))
    assert told["coverage_along"] == pytest.approx(SHARE, abs=0.03)
    assert untold["coverage_along"] < 0.6
    assert untold["stretch_along"] > 2


def test_a_pose_that_errs_as_its_covariance_says_is_covered_along_and_across():
    told, untold = (
        over_seeds(claim, lambda T, rng: moved(T, PLANAR, rng)) for claim in ({"pose_covariance": PLANAR}, {})
    )
    assert told["coverage_along"] == pytest.approx(SHARE, abs=0.03)
    assert told["coverage_across"] == pytest.approx(SHARE, abs=0.03)
    assert untold["coverage_along"] < 0.6


def test_half_the_covariance_covers_too_few_and_stretch_says_by_how_much():
    half = over_seeds({"pose_covariance": PLANAR / 4}, lambda T, rng: moved(T, PLANAR, rng))
    assert half["coverage_across"] == pytest.approx(0.673, abs=0.05)
    assert half["stretch_across"] == pytest.approx(2, abs=0.2)


def test_a_drive_whose_odometry_errs_as_told_is_covered():
    """From the noise of the steps to the hits: MotionNoise, PoseUncertainty and the bound agree."""
    error = MotionError(
        way="pose", along=Growth(1e-3, 0.01), across=Growth(2e-4), heading=Growth(1e-4), turn=Growth(1e-3)
    )
    test = BoundTest(CAMERA, sampling=Sampling(step_px=20))
    step = from_yaw(0.1, [0.3, 0, 0])
    image = np.zeros(CAMERA.shape, dtype=np.uint8)
    for seed in range(250):
        claim, uncertainty = MotionNoise(error).walk(np.eye(4), np.random.default_rng(seed)), PoseUncertainty(error)
        true = np.eye(4)
        depth_m = depths_m(seed)
        for n in range(8):
            claimed, true = (claim(step), true @ step) if n else (true, true)
            odometry = Odometry(claimed, travelled_m=0.3 * n)
            observation = Observation(float(n), image, image, odometry, claimed @ T_BASE_CAM)
            covariance = uncertainty.step(observation)
            if n == 7:
                truth = Truth(true @ T_BASE_CAM, depth_m)
                test.add(reading(depth_m, seed), observation.T_world_cam, truth, pose_covariance=covariance)
    found = scores_of(test)
    assert found["coverage_along"] == pytest.approx(SHARE, abs=0.035)
    assert found["coverage_across"] == pytest.approx(SHARE, abs=0.035)


def test_known_values_by_hand():
    """f b = 20 px m; at 2 m, d = 10 px and dz = 4 x .1 / 20 = 2 cm. The camera is claimed 3 cm farther than it is, and
    so is what it sees. On the ray 45 degrees off, dl is sqrt 2 dz, and of the 3 cm only those over sqrt 2 are along."""
    camera = StereoCamera(focal_px=100, cx_px=0, cy_px=0, baseline_m=0.2, width_px=101, height_px=2)
    T_true, T_claimed = from_rotation(R_BASE_OPTICAL), from_rotation(R_BASE_OPTICAL, [0.03, 0, 0])
    depth_m = np.full(camera.shape, 2.0, dtype=np.float32)
    claim = Disparity(np.full(camera.shape, 10.0, dtype=np.float32), np.float32(0.1)), T_claimed, Truth(T_true, depth_m)
    hits = measure_hits(camera, *claim, sampling=EVERY)
    ahead, aside = 0, 100
    assert hits.along_m[[ahead, aside]] == pytest.approx([0.03, 0.03 / np.sqrt(2)])
    assert hits.along_sigma_m[[ahead, aside]] == pytest.approx([0.02, 0.02 * np.sqrt(2)])
    rss, linear = (
        measure_hits(camera, *claim, sampling=EVERY, motion_sigma_m=0.015, motion_rule=rule)
        for rule in ("rss", "linear")
    )
    assert (rss.along_sigma_m[ahead], linear.along_sigma_m[ahead]) == pytest.approx((0.025, 0.035))
    covariance = np.diag([0.015**2, 0.07**2, 0, 0, 0, 0.01**2])
    pose = measure_hits(camera, *claim, sampling=EVERY, pose_covariance=covariance)
    # The ray 45 degrees to the right is (1, -1, 0) / sqrt 2; 1 cm a metre of its 2 sqrt 2 m across, and no more along.
    assert pose.along_sigma_m[[ahead, aside]] == pytest.approx([0.025, np.sqrt(2 * 0.02**2 + (0.015**2 + 0.07**2) / 2)])
    assert pose.across_sigma_m[[ahead, aside]] == pytest.approx(
        [np.hypot(0.07, 0.02), np.sqrt((0.015**2 + 0.07**2) / 2 + 8 * 0.01**2)]
    )
    assert np.abs(pose.across_m[[ahead, aside]]) == pytest.approx([0, 0.03 / np.sqrt(2)], abs=1e-9)


def test_the_linear_sum_is_never_narrower_than_the_root_of_squares():
    depth_m = depths_m()
    truth = Truth(T_BASE_CAM, depth_m)
    rss, linear = (
        measure_hits(CAMERA, reading(depth_m), T_BASE_CAM, truth, motion_sigma_m=0.02, motion_rule=rule)
        for rule in ("rss", "linear")
    )
    assert (linear.along_sigma_m > rss.along_sigma_m).all()


def test_a_heading_error_is_across_the_ray_of_a_point_and_along_it_of_a_surface(box):
    """A board askew, seen two degrees off: its points move sideways, and the ray meets the board elsewhere."""
    wall = box((2, -20, -20), (2.2, 20, 20))
    wall.apply_transform(from_yaw(np.deg2rad(40)))
    T_true = from_rotation(R_BASE_OPTICAL)
    caster = RayCaster(wall)
    depth_m = caster.lengths([0, 0, 0], transform(T_true, CAMERA.ray_directions.reshape(-1, 3))).reshape(CAMERA.shape)
    test = BoundTest(CAMERA, surface=caster)
    off = from_yaw(np.deg2rad(2)) @ T_true
    hits = test.add(exact(depth_m, 0.1), off, Truth(T_true, depth_m))
    found = scores_of(test)
    assert found["coverage_along"] == 1 and found["coverage_surface"] < 0.5
    assert np.abs(hits.along_m).max() < 1e-3 * hits.range_m.max()


def askew_scores(box, degrees, n=600):
    """A board so many degrees askew, met from poses that err as PLANAR says."""
    small = StereoCamera(focal_px=40, cx_px=9.5, cy_px=7.5, baseline_m=0.5, width_px=20, height_px=16)
    board = box((2, -50, -50), (2.2, 50, 50))
    board.apply_transform(from_yaw(np.deg2rad(degrees)))
    caster, T_true = RayCaster(board), from_rotation(R_BASE_OPTICAL)
    rays = transform(T_true, small.ray_directions.reshape(-1, 3))
    depth_m = caster.lengths([0, 0, 0], rays).reshape(small.shape)
    test = BoundTest(small, surface=caster, sampling=Sampling(step_px=4))
    for seed in range(n):
        rng = np.random.default_rng([seed, 3])
        d = small.disparity_px(depth_m) + rng.normal(0, 0.03, small.shape)
        claimed = moved(T_true, PLANAR, rng)
        test.add(Disparity(d, np.float32(0.03)), claimed, Truth(T_true, depth_m), pose_covariance=PLANAR)
    return scores_of(test)


def test_on_a_slant_only_the_whole_covariance_covers_the_surface(box):
    found = askew_scores(box, 50)
    assert found["coverage_slant"] == pytest.approx(SHARE, abs=0.025)
    assert found["coverage_surface"] < 0.85


def test_the_slant_of_a_surface_square_to_the_ray_adds_nothing():
    depth_m = flat(2.0)
    hits = measure_hits(
        CAMERA, exact(depth_m), T_BASE_CAM, Truth(T_BASE_CAM, depth_m), pose_covariance=PLANAR, sampling=EVERY
    )
    np.testing.assert_allclose(hits.slant_sigma_m(-hits.ray), hits.along_sigma_m)
    untold = measure_hits(CAMERA, exact(depth_m), T_BASE_CAM, Truth(T_BASE_CAM, depth_m), motion_sigma_m=0.1)
    assert np.isnan(untold.slant_sigma_m(-untold.ray)).all()


def test_a_grazed_surface_may_be_met_anywhere():
    depth_m = flat(2.0)
    hits = measure_hits(CAMERA, exact(depth_m), T_BASE_CAM, Truth(T_BASE_CAM, depth_m), pose_covariance=PLANAR)
    sideways = np.cross(hits.ray, [0, 0, 1.0])
    assert (hits.slant_sigma_m(sideways / np.linalg.norm(sideways, axis=1, keepdims=True)) > 100).all()


def test_from_the_true_pose_both_readings_are_one(box):
    room = box((-4, -3, -1), (5, 3, 2))
    T = from_yaw(0.3) @ from_rotation(R_BASE_OPTICAL)
    caster = RayCaster(room)
    depth_m = caster.lengths([0, 0, 0], CAMERA.ray_directions.reshape(-1, 3) @ T[:3, :3].T).reshape(CAMERA.shape)
    test = BoundTest(CAMERA, surface=caster, sampling=EVERY)
    test.add(reading(depth_m), T, Truth(T, depth_m))
    found = scores_of(test)
    assert found["coverage_surface"] == pytest.approx(found["coverage_along"], abs=1e-3)
    assert found["coverage_along"] == pytest.approx(SHARE, abs=0.01)


def test_scores_do_not_change_when_the_world_is_turned_and_moved():
    T = from_yaw(1.2, [30, -4, 2])
    turned = np.kron(np.eye(2), T[:3, :3])
    depth_m, claimed = depths_m(), moved(T_BASE_CAM, PLANAR, np.random.default_rng(1))
    here, there = BoundTest(CAMERA), BoundTest(CAMERA)
    here.add(reading(depth_m), claimed, Truth(T_BASE_CAM, depth_m), pose_covariance=PLANAR)
    there.add(reading(depth_m), T @ claimed, Truth(T @ T_BASE_CAM, depth_m), pose_covariance=turned @ PLANAR @ turned.T)
    assert scores_of(there) == pytest.approx(scores_of(here), nan_ok=True, abs=1e-9)


def test_gross_mismatches_count_as_hits_but_not_as_inliers():
    depth_m = flat(2.0)
    disparity = exact(depth_m)
    wrong = disparity.disparity_px.copy()
    wrong[:30] += 5.0
    test = BoundTest(CAMERA, sampling=EVERY)
    test.add(Disparity(wrong, disparity.sigma_px), T_BASE_CAM, Truth(T_BASE_CAM, depth_m))
    found = scores_of(test)
    assert (found["mismatches"], found["coverage_along"], found["coverage_along_inliers"]) == (0.25, 0.75, 1)


def test_a_hit_where_nothing_is_is_wrong_and_no_sigma_would_cover_it():
    depth_m = flat(2.0)
    seen = exact(depth_m)
    depth_m[:60] = np.nan
    test = BoundTest(CAMERA, sampling=EVERY)
    test.add(seen, T_BASE_CAM, Truth(T_BASE_CAM, depth_m))
    found = scores_of(test)
    assert (found["mismatches"], found["coverage_along"], found["coverage_along_inliers"]) == (0.5, 0.5, 1)
    assert np.isnan(found["stretch_along"]) and found["stretch_along_inliers"] < 1e-3


def test_only_matched_pixels_within_the_range_are_hits():
    depth_m = flat(2.0)
    depth_m[:, 80:] = 6.0
    d = exact(depth_m).disparity_px.copy()
    d[:60] = np.nan
    hits = measure_hits(
        CAMERA, Disparity(d, np.float32(0.1)), T_BASE_CAM, Truth(T_BASE_CAM, depth_m), sampling=Sampling(1, 5.0)
    )
    assert len(hits.range_m) == 60 * 80


def test_where_the_pose_is_claimed_exact_only_an_error_across_counts():
    depth_m = flat(2.0)
    known, wrong = BoundTest(CAMERA), BoundTest(CAMERA)
    off = T_BASE_CAM.copy()
    off[1, 3] += 0.01
    for test, T in ((known, T_BASE_CAM), (wrong, off)):
        test.add(exact(depth_m), T, Truth(T_BASE_CAM, depth_m), pose_covariance=np.zeros((6, 6)))
    assert np.isnan(scores_of(known)["coverage_across"])
    assert scores_of(wrong)["coverage_across"] == 0


def test_a_drive_without_hits_has_no_scores():
    assert np.isnan(list(scores_of(BoundTest(CAMERA)).values())).all()


def test_the_shares_are_those_of_bound_coverage():
    depth_m = depths_m()
    test = BoundTest(CAMERA)
    hits = test.add(reading(depth_m), T_BASE_CAM, Truth(T_BASE_CAM, depth_m), motion_sigma_m=0.01)
    same = bound_coverage(hits.range_m - hits.along_m, hits.range_m, hits.along_sigma_m)
    assert scores_of(test)["coverage_along"] == same.value


@pytest.mark.parametrize(
    ("claim", "message"),
    [
        ({"pose_covariance": np.eye(3)}, r"\(6, 6\)"),
        ({"pose_covariance": np.full((6, 6), np.nan)}, "finite"),
        ({"pose_covariance": -np.eye(6)}, "positive semidefinite"),
        ({"pose_covariance": np.triu(np.ones((6, 6)))}, "symmetric"),
        ({"pose_covariance": PLANAR, "motion_sigma_m": 0.1}, "not both"),
        ({"motion_sigma_m": 0.1, "motion_rule": "sum"}, "motion rule"),
        ({"motion_sigma_m": -0.1}, "motion_sigma_m must be"),
        ({"motion_sigma_m": np.nan}, "motion_sigma_m must be"),
    ],
)
def test_a_claim_that_makes_no_sense_is_refused(claim, message):
    with pytest.raises(InvalidInputError, match=message):
        measure_hits(CAMERA, exact(flat(2.0)), T_BASE_CAM, Truth(T_BASE_CAM, flat(2.0)), **claim)


def test_images_that_do_not_fit_the_camera_are_refused():
    small = flat(2.0)[:100]
    for disparity, truth in ((exact(small), flat(2.0)), (exact(flat(2.0)), small), (exact(flat(2.0)), None)):
        with pytest.raises(InvalidInputError, match="image"):
            measure_hits(CAMERA, disparity, T_BASE_CAM, Truth(T_BASE_CAM, truth))


@pytest.mark.parametrize("sampling", [{"step_px": 0}, {"step_px": 1.5}, {"max_range_m": 0}, {"max_range_m": np.nan}])
def test_a_sampling_that_makes_no_sense_is_refused(sampling):
    with pytest.raises(InvalidInputError, match=next(iter(sampling))):
        Sampling(**sampling)


def test_a_pose_is_checked():
    with pytest.raises(InvalidInputError, match="T_world_cam"):
        measure_hits(CAMERA, exact(flat(2.0)), np.ones((4, 4)), Truth(T_BASE_CAM, flat(2.0)))
