import numpy as np
import pytest

from stereogrid.camera import StereoCamera
from stereogrid.errors import InvalidInputError
from stereogrid.geometry import from_rotation, from_yaw, inverse, transform
from stereogrid.observation import Disparity
from stereogrid.scoring.held_out import HELD_OUT_NAMES, OUTLIERS, HeldOutRays, held_out_scores

CELL_M, RANGE_M, WALL_M = 0.1, 5.0, 3.0


class World:
    """A map: p before the wall, in the cells of the wall x = WALL_M, and behind it; seen by T_here_world."""

    def __init__(self, before=0.0, wall=1.0, behind=np.nan, T_world_here=None):
        self.p = before, wall, behind
        self.T_world_here = np.eye(4) if T_world_here is None else T_world_here

    def probability(self, points_m):
        x = transform(self.T_world_here, points_m)[:, 0]
        return np.select([x < WALL_M, x < WALL_M + CELL_M], self.p[:2], self.p[2])


def rays_to_wall(n=50, sigma_m=0.001, *, straight=False, depth_m=WALL_M + 0.05):
    rng = np.random.default_rng(0)
    origin = np.column_stack([np.zeros(n), rng.uniform(-1, 1, (n, 2))])
    end = origin + np.array([depth_m, 0, 0])
    if not straight:
        end[:, 1:] += rng.uniform(-1, 1, (n, 2))
    return HeldOutRays(origin, end, np.full(n, sigma_m))


def scores_of(grid, rays, **options):
    found = held_out_scores(grid, rays, cell_m=CELL_M, max_range_m=RANGE_M, **options)
    assert [(s.name, s.unit) for s in found] == [(name, unit) for name, (unit, _) in HELD_OUT_NAMES.items()]
    return {score.name.removeprefix("held_out_"): score.value for score in found}


def test_a_perfect_map_scores_perfectly():
    found = scores_of(World(), rays_to_wall())
    for name in ("auc", "occupied_recall", "coverage_occupied", "coverage_free"):
        assert found[name] == 1
    for name in ("false_occupied", "brier_balanced"):
        assert found[name] == 0
    assert found["log_loss_balanced"] < 2e-6
    assert scores_of(World(), rays_to_wall(straight=True))["log_likelihood"] == pytest.approx(
        np.log(1 - OUTLIERS + OUTLIERS * CELL_M / RANGE_M)
    )


def test_a_map_of_the_prior_alone_knows_nothing():
    found = scores_of(World(0.5, 0.5, 0.5), rays_to_wall())
    assert found["auc"] == 0.5
    assert found["brier_balanced"] == pytest.approx(0.25)
    assert found["log_loss_balanced"] == pytest.approx(np.log(2))


@pytest.mark.parametrize("prior", [0.2, 0.5])
def test_an_unknown_cell_counts_as_the_prior(prior):
    unknown = scores_of(World(*3 * [np.nan]), rays_to_wall(), prior=prior)
    known = scores_of(World(*3 * [prior]), rays_to_wall(), prior=prior)
    assert unknown.pop("coverage_occupied") == unknown.pop("coverage_free") == 0
    assert known.pop("coverage_occupied") == known.pop("coverage_free") == 1
    assert unknown == known


def test_an_inverted_map_is_as_wrong_as_can_be():
    found = scores_of(World(1.0, 0.0, 0.0), rays_to_wall())
    assert found["auc"] == found["occupied_recall"] == 0
    assert found["false_occupied"] == found["brier_balanced"] == 1
    assert found["log_likelihood"] == pytest.approx(np.log(OUTLIERS * CELL_M / RANGE_M))


def test_scores_do_not_change_when_the_world_is_turned():
    T = from_yaw(0.7, [3.0, -2.0, 0.4]) @ from_rotation(from_yaw(-1.1)[:3, :3][[2, 0, 1]][:, [2, 0, 1]])
    rays = rays_to_wall(sigma_m=0.05)
    turned = HeldOutRays(transform(T, rays.origin_m), transform(T, rays.end_m), rays.sigma_m)
    before = scores_of(World(0.2, 0.8, 0.5), rays)
    after = scores_of(World(0.2, 0.8, 0.5, T_world_here=inverse(T)), turned)
    assert after == pytest.approx(before, abs=1e-6)


def test_a_ray_ends_in_a_step_with_the_probability_that_it_is_the_first_occupied_one():
    p = 0.3
    total = 0.0
    for step in range(int(RANGE_M / CELL_M)):
        rays = rays_to_wall(4, 1e-6, straight=True, depth_m=(step + 0.5) * CELL_M)
        likelihood = np.exp(scores_of(World(p, p, p), rays)["log_likelihood"])
        assert likelihood == pytest.approx((1 - OUTLIERS) * p * (1 - p) ** step + OUTLIERS * CELL_M / RANGE_M)
        total += likelihood
    assert total == pytest.approx(1, abs=1e-6)


def test_a_reading_s_own_error_blurs_where_it_is_foretold():
    sharp, blurred = (scores_of(World(), rays_to_wall(sigma_m=s, straight=True)) for s in (0.001, 0.2))
    expected = (1 - OUTLIERS) * 0.1974 + OUTLIERS * CELL_M / RANGE_M  # a Gaussian within a quarter of its sigma
    assert np.exp(blurred["log_likelihood"]) == pytest.approx(expected, abs=1e-4)
    assert blurred["log_likelihood"] < sharp["log_likelihood"]


@pytest.mark.parametrize("sigma_m", [0.001, 0.1])
def test_nothing_is_said_of_the_margin_before_an_end(sigma_m):
    class Thick(World):
        def probability(self, points_m):
            margin_m = 3 * sigma_m + np.sqrt(3) * CELL_M
            return np.where(points_m[:, 0] > WALL_M + 0.05 - margin_m, 1.0, 0.0)

    assert scores_of(Thick(), rays_to_wall(sigma_m=sigma_m, straight=True))["false_occupied"] == 0


def test_nothing_is_asked_nearer_than_the_smallest_range():
    class Ghost(World):
        def probability(self, points_m):
            return np.where(points_m[:, 0] < 0.8, 1.0, super().probability(points_m))

    rays = rays_to_wall(straight=True)
    assert scores_of(Ghost(), rays, min_range_m=0.8) == scores_of(World(), rays, min_range_m=0.8)
    assert scores_of(Ghost(), rays)["log_likelihood"] < scores_of(World(), rays)["log_likelihood"]


def test_many_rays_score_as_their_parts_do(monkeypatch):
    rays, grid = rays_to_wall(60, 0.05), World(0.2, 0.8, 0.5)
    at_once = scores_of(grid, rays)
    monkeypatch.setattr("stereogrid.scoring.held_out.RAYS_AT_ONCE", 7)
    assert scores_of(grid, rays) == pytest.approx(at_once)
    assert scores_of(grid, HeldOutRays.joined(rays.parts(13))) == pytest.approx(at_once)


def test_no_ray_gives_no_number():
    none = HeldOutRays.joined([])
    assert len(none) == 0
    assert np.isnan(list(scores_of(World(), none).values())).all()


CAMERA = StereoCamera(focal_px=100, cx_px=31.5, cy_px=23.5, baseline_m=0.1, width_px=64, height_px=48)


def drawn(n=100, seed=0, disparity_px=4.0, T_world_cam=None, **options):
    image = np.full(CAMERA.shape, disparity_px, np.float32)
    image[:10] = np.nan
    T = np.eye(4) if T_world_cam is None else T_world_cam
    options = {"max_range_m": RANGE_M, **options}
    rng = np.random.default_rng(seed)
    return HeldOutRays.of_disparity(CAMERA, Disparity(image, 0.5), T, n=n, rng=rng, **options)


def test_rays_end_where_the_pixels_see_something_and_nowhere_twice():
    T = from_yaw(0.3, [1, 2, 3])
    rays = drawn(T_world_cam=T)
    in_cam = transform(inverse(T), rays.end_m)
    assert in_cam[:, 2] == pytest.approx(2.5)  # f b / d
    assert (rays.origin_m == [1, 2, 3]).all()
    assert len(np.unique(rays.end_m, axis=0)) == 100
    assert CAMERA.project(in_cam)[:, 1].min() > 9.5  # rows above have no match
    assert rays.sigma_m == pytest.approx(2.5**2 * 0.5 / 10 * rays.range_m / 2.5)  # Eqs. 8 and 10


def test_the_rng_alone_draws_the_rays():
    assert (drawn(seed=1).end_m == drawn(seed=1).end_m).all()
    assert not (drawn(seed=1).end_m == drawn(seed=2).end_m).all()


def test_pixels_too_far_or_too_uncertain_are_not_drawn():
    assert len(drawn(n=9999)) == 64 * 38
    rays = drawn(n=9999, max_range_m=2.6)
    assert 0 < len(rays) < 64 * 38 and rays.range_m.max() <= 2.6
    assert len(drawn(max_sigma_m=0.3)) == 0


@pytest.mark.parametrize(
    ("wrong", "named"),
    [
        ({"end_m": np.zeros((3, 2))}, r"\(3, 2\)"),
        ({"sigma_m": np.ones(2)}, r"\(2,\)"),
        ({"sigma_m": np.zeros(3)}, "sigma"),
        ({"sigma_m": np.full(3, np.nan)}, "NaN"),
        ({"end_m": np.zeros((3, 3))}, "length"),
    ],
)
def test_rays_that_cannot_be_are_refused(wrong, named):
    arrays = {"origin_m": np.zeros((3, 3)), "end_m": np.ones((3, 3)), "sigma_m": np.ones(3)}
    with pytest.raises(InvalidInputError, match=named):
        HeldOutRays(**{**arrays, **wrong})


@pytest.mark.parametrize(
    ("wrong", "named"),
    [
        ({"cell_m": 0.0}, "cell_m"),
        ({"max_range_m": np.inf}, "max_range_m"),
        ({"min_range_m": 5.0}, "min_range_m"),
        ({"prior": 1.0}, "prior"),
    ],
)
def test_arguments_that_make_no_sense_are_named(wrong, named):
    with pytest.raises(InvalidInputError, match=named):
        held_out_scores(World(), rays_to_wall(), **{"cell_m": CELL_M, "max_range_m": RANGE_M, **wrong})


def test_a_map_that_answers_with_no_probability_is_refused():
    with pytest.raises(InvalidInputError, match=r"\[0, 1\] or NaN"):
        scores_of(World(before=1.5), rays_to_wall())
