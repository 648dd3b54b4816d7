"""The claim's parameters, units and statistics, on made-up numbers whose answer is known."""

import math
from dataclasses import replace

import numpy as np
import pytest

from experiments.claim import TOLD_ZERO, tasks
from experiments.claim_calibration import Calibration, calibration_table
from experiments.claim_config import NOISES, SCORED, Arm, ClaimConfig, NoiseConfig, TuneConfig, arm_of
from experiments.claim_statistics import LIKE_THESE, THESE, Cell, Values, differences_of
from experiments.claim_tables import control_table, coverage_table, difference_tables, end_table, mean_tables
from experiments.claim_units import ANY, BOUND, CONTROLS, MAP, PRIOR, SHUFFLED, TRUE_DEPTH, Unit, claims_of
from stereogrid.config import load_config, save_config
from stereogrid.errors import StereogridError
from stereogrid.geometry import from_yaw
from stereogrid.motion import WAYS, Growth, MotionError
from stereogrid.observation import Observation, Odometry
from stereogrid.scoring import Score
from stereogrid.scoring.paired import Interval

CONFIG = ClaimConfig(
    n_seeds=3, bound_seeds=3, fusions=("cell",), noises=NOISES[:1], arms=(arm_of("none"), arm_of("rss"))
)
GAIN = {"corridor": 0.1, "office": 0.2, "entrance": 0.3}


SEEDS = range(1, 10)


def made_up():
    """rss is better than none by GAIN in each world, whatever the seed does to both."""
    found = {}
    for seed in SEEDS:
        for world, gain in GAIN.items():
            for way in ("none", "rss"):
                auc = 0.5 + 0.01 * seed + gain * (way == "rss")
                found[Unit(world, "independent", seed, "cell", way)] = [Score("auc", auc, "1", 9)]
                bound = [Score("bound_coverage_along", 0.9, "1", 9), Score("end_error_m", 0.3, "m", 9)]
                found[Unit(world, "independent", seed, ANY, way)] = bound
    return found


def of(differences, world):
    return next(each for each in differences if each.world == world)


CELL = Cell("independent", "cell", "rss", "auc")


def test_differences_are_paired_by_seed_and_pooled_over_worlds():
    found = differences_of(Values(made_up()), [CELL], "none")
    for world, gain in GAIN.items():
        interval = of(found, world).interval
        assert (interval.mean, interval.low, interval.high, interval.n) == (*[pytest.approx(gain)] * 3, 9)
        assert of(found, world).excludes_zero
    these, others = of(found, THESE), of(found, LIKE_THESE)
    assert these.interval.mean == others.interval.mean == pytest.approx(0.2)
    assert these.p == pytest.approx(2 / 2**9)  # all of nine signs alike: a seed is one unit in all worlds
    assert these.excludes_zero
    assert others.interval.low <= 0.2 - 4.3 * 0.1 / math.sqrt(3) + 1e-3  # Student's t of two degrees of freedom
    assert not others.excludes_zero


def test_many_arms_raise_the_bar_for_each():
    found = made_up()
    for unit, scores in list(found.items()):
        if unit.way == "rss" and unit.fusion == "cell":
            for n in range(19):
                found[replace(unit, way=f"twin {n}")] = scores
    cells = [CELL, *(replace(CELL, way=f"twin {n}") for n in range(19))]
    many = differences_of(Values(found), cells, "none")
    assert of(many, THESE).p == pytest.approx(20 * 2 / 2**9)
    assert not of(many, THESE).excludes_zero


def test_a_unit_that_is_missing_takes_its_partner_with_it():
    found = made_up()
    del found[Unit("office", "independent", 2, "cell", "none")]
    differences = differences_of(Values(found), [CELL], "none")
    assert of(differences, "office").interval.n == 8 and of(differences, "corridor").interval.n == 9
    assert of(differences, THESE).interval.n == 8


def test_an_arm_that_changes_nothing_is_not_marked():
    found = {u: [Score("auc", 0.7, "1", 9)] for u in made_up()}
    for each in differences_of(Values(found), [CELL], "none"):
        assert each.interval.mean == 0 and not each.excludes_zero


def test_the_mean_counts_every_world_alike():
    found = made_up()
    del found[Unit("entrance", "independent", 3, "cell", "rss")]
    assert Values(found).mean(CELL) == pytest.approx(np.mean([0.65, 0.75, 0.8525]))


def test_tables_say_what_the_numbers_say():
    values = Values(made_up())
    differences = {(d.cell, d.world): d for d in differences_of(values, [CELL], "none")}
    (means,) = mean_tables(CONFIG, values)
    assert means.rows == [["auc", "0.550", "0.750"]]
    (table,) = difference_tables(CONFIG, values, differences)
    assert [row[1] for row in table.rows] == [*SCORED, THESE, LIKE_THESE]
    assert table.rows[0][2] == "+0.1000 [+0.1000, +0.1000] *"
    assert not table.rows[-1][2].endswith("*")
    assert coverage_table(CONFIG, values, [THESE]).rows == [["independent", "along", "0.900", "0.900"]]
    both = coverage_table(CONFIG, values, ["office", THESE])
    assert both.rows[0] == ["independent", "along", "office", "0.900", "0.900"]
    assert end_table(CONFIG, values).rows == [["independent", "0.300", "0.300", "0.300"]]
    assert control_table(CONFIG, values) is None


def test_every_unit_is_made_once_and_all_arms_see_the_same():
    config = ClaimConfig(n_seeds=2, bound_seeds=2, control_seeds=1)
    made = dict(tasks(config))
    assert len(made) == len(list(tasks(config)))
    arms = [unit for unit in made if unit.noise != CONTROLS]
    assert len(arms) == 3 * 2 * 4 * 5 * (2 + 1)
    for unit, task in made.items():
        if unit.noise != CONTROLS:
            twin = made[replace(unit, way="none")]
            assert (task.seed, task.sight, task.error) == (twin.seed, twin.sight, twin.error)
            assert task.kind == (BOUND if unit.fusion == ANY else MAP)
            assert task.mapping.motion_error.way == unit.way
            assert unit.fusion in (ANY, task.mapping.grid.fusion)


def test_an_arm_may_leave_out_a_rule_of_fusion():
    arms = (arm_of("none"), replace(arm_of("pose"), fusions=("cell",)))
    made = [unit for unit, _ in tasks(ClaimConfig(n_seeds=1, bound_seeds=1, control_seeds=1, arms=arms))]
    assert {unit.fusion for unit in made if unit.way in ("pose", TOLD_ZERO + "pose")} == {"cell", ANY}
    assert {unit.fusion for unit in made if unit.way == "none"} == {"cell", "sum_of_rays", ANY}


def test_a_noise_may_have_fewer_seeds():
    fewer = replace(CONFIG, noises=(NOISES[0], replace(NOISES[1], most_seeds=2), replace(NOISES[2], most_seeds=9)))
    seeds = {name: {u.seed for u, _ in tasks(fewer) if u.noise == name} for name in fewer.by_noise}
    assert list(seeds.values()) == [{1, 2, 3}, {1, 2}, {1, 2, 3}]


def test_the_means_say_which_arm_has_fewer_seeds_of_rays():
    arms = (arm_of("none"), replace(arm_of("pose"), ray_seeds=2))
    config = ClaimConfig(n_seeds=3, bound_seeds=3, noises=NOISES[:1], arms=arms)
    made = [(u.fusion, u.seed) for u, _ in tasks(config) if (u.world, u.way) == ("office", "pose")]
    assert {fusion: [seed for each, seed in made if each == fusion] for fusion in (*config.fusions, ANY)} == {
        "cell": [1, 2, 3],
        "sum_of_rays": [1, 2],
        ANY: [1, 2, 3],
    }
    notes = [table.note for table in mean_tables(config, Values({}))]
    assert ["pose: the first 2" in note for note in notes] == [False, True]


def test_the_mapper_is_told_the_size_of_the_noise_and_of_perfect_poses_an_error_that_is_not_there():
    made = dict(tasks(ClaimConfig(n_seeds=2, bound_seeds=2)))
    for unit, task in made.items():
        if unit.noise != CONTROLS:
            believed = "drift" if unit.noise == "perfect" else unit.noise
            size = next(noise.error for noise in NOISES if noise.name == believed)
            assert replace(task.mapping.motion_error, way="rss") == replace(size, way="rss")
    perfect = made[Unit("office", "perfect", 2, "cell", "rss")]
    assert perfect.error.is_zero and perfect.sight.seed == 2  # else its seeds would be one
    assert made[Unit("office", "drift", 2, "cell", "rss")].sight.seed == 1


def test_the_controls_are_there():
    every = [(unit, task) for unit, task in tasks(ClaimConfig()) if unit.noise == CONTROLS]
    assert {unit.way for unit, _ in every if unit.seed > 1} == {SHUFFLED}  # of the others each seed is the same
    made = {unit.way: task for unit, task in every}
    assert set(made) == {TRUE_DEPTH, SHUFFLED, PRIOR, *(TOLD_ZERO + way for way in WAYS)}
    assert all(task.error.is_zero and task.mapping.motion_error.is_zero for task in made.values())


def test_an_arm_sets_what_it_names_and_nothing_else():
    config = ClaimConfig(arms=(arm_of("none"), Arm("bold", {"model": {"p_free": 0.1}, "motion_error": {"kappa": 2.0}})))
    plain, bold = (config.of_arm(arm, "sum_of_rays") for arm in config.arms)
    assert (bold.model.p_free, bold.motion_error.kappa, bold.grid.fusion) == (0.1, 2.0, "sum_of_rays")
    same = replace(bold, model=plain.model, motion_error=plain.motion_error)
    assert same == plain


@pytest.mark.parametrize("config", [ClaimConfig(), TuneConfig()])
def test_the_config_can_be_written_and_read_back(tmp_path, config):
    save_config(config, tmp_path / "config.toml")
    assert load_config(type(config), tmp_path / "config.toml") == config


@pytest.mark.parametrize(
    ("kind", "wrong", "named"),
    [
        (ClaimConfig, {"worlds": ("corridor", "warehouse")}, "warehouse.*never for both"),
        (TuneConfig, {"worlds": ("outdoor", "office")}, "office.*never for both"),
        (ClaimConfig, {"worlds": ("coridor",)}, "coridor"),
        (ClaimConfig, {"worlds": ()}, "worlds"),
        (ClaimConfig, {"worlds": ("office", "office")}, "worlds"),
        (ClaimConfig, {"n_seeds": 0}, "n_seeds"),
        (ClaimConfig, {"control_seeds": -1}, "control_seeds"),
        (ClaimConfig, {"camera_faults": "foggy"}, "foggy"),
        (ClaimConfig, {"fusions": ("cells",)}, "fusion rule.*'cells'"),
        (ClaimConfig, {"arms": (arm_of("rss"),)}, "'none'"),
        (ClaimConfig, {"arms": (arm_of("none"), Arm("x", {"motion_error": {"way": "pos"}}))}, "'pos'.*submaps"),
        (ClaimConfig, {"arms": (arm_of("none"), Arm("x", {}, ("cells",)))}, "of arm 'x'.*'cells'.*cell, sum_of_rays"),
        (ClaimConfig, {"arms": (replace(arm_of("none"), fusions=("cell",)),)}, "reference 'none'.*every rule"),
        (ClaimConfig, {"arms": (arm_of("none"), Arm("x", {"modl": {}}))}, "arms.x.mapping.modl.*model"),
        (ClaimConfig, {"noises": (NoiseConfig("a", believed="b"),)}, "'b'.*choose from: a"),
        (ClaimConfig, {"noises": (NoiseConfig("a", most_seeds=-1),)}, "most_seeds of 'a'"),
        (ClaimConfig, {"width_px": 0}, "width"),
    ],
)
def test_a_wrong_parameter_is_named_before_anything_is_done(kind, wrong, named):
    with pytest.raises(StereogridError, match=named):
        kind(**wrong)


@pytest.mark.parametrize("way", WAYS)
def test_what_is_claimed_of_a_pose_is_what_the_way_says(way):
    error = MotionError(way=way, position_m=0.1, along=Growth(0.01))
    claim, image = claims_of(error), np.zeros((4, 4), np.uint8)
    for travelled_m in (0.0, 4.0):
        T = from_yaw(0.0, (travelled_m, 0.0, 0.0))
        claimed = claim(Observation(travelled_m, image, image, Odometry(T, travelled_m), T))
    if way == "none":
        assert claimed == {}
    elif way in ("linear", "rss"):
        assert claimed == {"motion_sigma_m": pytest.approx(math.sqrt(0.05)), "motion_rule": way}
    else:
        assert claimed["pose_covariance"][0, 0] == pytest.approx(0.05)
        assert claimed["pose_covariance"][1, 1] == pytest.approx(0.01)


def test_the_screen_shows_the_calibration_over_all_worlds_and_what_excludes_zero():
    found = {
        ("independent", "cell", arm): Calibration(
            {"office": 0.5, THESE: 0.03}, {world: Interval(0.01, 0.005, 0.02, 3) for world in ("office", THESE)}
        )
        for arm in CONFIG.by_arm
    }
    short = calibration_table(CONFIG, found, short=True)
    assert short.rows == [["independent", "cell", "0.0300", "0.0300 *"]]
    whole = calibration_table(CONFIG, found)
    assert [row[2] for row in whole.rows] == [*SCORED, THESE]
    assert whole.rows[-1][-1] == "0.0300 (+0.0100 [+0.0050, +0.0200] *)"
