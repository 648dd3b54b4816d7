"""A config is read as it was written, and a wrong line in it is named together with what would be right."""

from dataclasses import dataclass, field

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stereogrid.camera import StereoCamera
from stereogrid.config import (
    GridConfig,
    MappingConfig,
    MatcherConfig,
    config_from_table,
    load_config,
    save_config,
)
from stereogrid.errors import ConfigError, InvalidInputError
from stereogrid.matching import MATCHERS
from stereogrid.matching.correlation import temporal_share
from stereogrid.motion import Growth, MotionError
from stereogrid.observation import Disparity
from stereogrid.sensor_model import SensorModel
from stereogrid.tomlfile import with_settings

MINORU = StereoCamera(focal_px=834, cx_px=319.5, cy_px=239.5, baseline_m=0.06, width_px=640, height_px=480)
KITTI = StereoCamera(focal_px=707.0912, cx_px=601.8873, cy_px=183.1104, baseline_m=0.5372, width_px=1226, height_px=370)

positive = st.floats(1e-6, 1e6)
configs = st.builds(
    MappingConfig,
    matcher=st.builds(MatcherConfig, name=st.sampled_from(sorted(MATCHERS)), num_disparities=st.integers(1, 2**40)),
    model=st.builds(
        SensorModel,
        p_free=st.floats(0.01, 0.4),
        prior=st.floats(0.41, 0.6),
        p_occupied=st.floats(0.61, 0.99),
        max_range_m=positive,
        form=st.sampled_from(["corrected", "printed"]),
    ),
    motion_error=st.builds(MotionError, kappa=positive, along=st.builds(Growth, positive, positive)),
    grid=st.builds(
        GridConfig,
        cell_m=positive,
        fusion=st.sampled_from(["cell", "sum_of_rays"]),
        clamp=st.just(()) | st.tuples(positive.map(lambda low: -low), positive),
    ),
)


@given(config=configs)
def test_a_config_is_read_back_equal(tmp_path_factory, config):
    path = tmp_path_factory.mktemp("config") / "config.toml"
    save_config(config, path)
    assert load_config(MappingConfig, path) == config


def from_text(tmp_path, text):
    path = tmp_path / "mine.toml"
    path.write_text(text, encoding="utf-8")
    return load_config(MappingConfig, path)


def test_what_a_file_does_not_say_keeps_its_default(tmp_path):
    config = from_text(tmp_path, '[matcher]\nname = "sgbm"\n')
    assert config == MappingConfig(matcher=MatcherConfig(name="sgbm"))
    assert from_text(tmp_path, "") == MappingConfig()


def test_a_whole_number_will_do_where_a_float_is_expected(tmp_path):
    grid = from_text(tmp_path, "[grid]\ncell_m = 3\nclamp = [-2, 3.5]\n").grid
    assert (grid.cell_m, grid.clamp) == (3.0, (-2.0, 3.5))
    assert [type(number) for number in (grid.cell_m, *grid.clamp)] == [float] * 3


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[grid]\ncel_m = 0.1\n", "unknown key 'grid.cel_m'; did you mean 'cell_m'? choose from: cell_m, fusion"),
        ("[gird]\ncell_m = 0.1\n", "unknown key 'gird'; did you mean 'grid'? choose from: matcher, model"),
        ("zzz = 1\n", "unknown key 'zzz'; choose from: matcher, model, motion_error, grid"),
        ('[grid]\ncell_m = "small"\n', "'grid.cell_m' must be float, not 'small'"),
        ("[grid]\ncell_m = true\n", "'grid.cell_m' must be float, not True"),
        ("[matcher]\nnum_disparities = 64.0\n", "'matcher.num_disparities' must be int, not 64.0"),
        ("[matcher]\nnum_disparities = true\n", "'matcher.num_disparities' must be int, not True"),
        ("[matcher]\nname = 3\n", "'matcher.name' must be str, not 3"),
        ("[grid]\nclamp = 6.0\n", "'grid.clamp' must be a list, not 6.0"),
        ('[grid]\nclamp = [-6.0, "high"]\n', "'grid.clamp[1]' must be float, not 'high'"),
        ("grid = 0.1\n", "'grid' must be a section, not 0.1"),
        ("[[grid]]\ncell_m = 0.1\n", "'grid' must be a section, not [{'cell_m': 0.1}]"),
        ("[model]\np_free = 0.7\n", "[model] expected 0 < p_free < prior < p_occupied < 1, not p_free 0.7"),
        ("[model]\np_free = 1\n", "model.p_free must be > 0 and < 1 and finite, not 1.0"),
        ('[model]\nform = "print"\n', "no model.form named 'print'; did you mean 'printed'? choose from: corrected"),
        ('[matcher]\nname = "sgmb"\n', "no matcher.name named 'sgmb'; did you mean 'sgbm'? choose from: bm"),
        ("[motion_error.along]\na = -1\n", "motion_error.along.a must be >= 0 and finite, not -1.0"),
        ("[grid]\ncell_m = 0\n", "grid.cell_m must be positive and finite, not 0.0"),
        ("[grid]\nmemory_limit_gb = inf\n", "grid.memory_limit_gb must be positive and finite, not inf"),
        ("[matcher]\nnum_disparities = 0\n", "matcher.num_disparities must be positive, not 0"),
        ("[grid\n", "at line 1"),
    ],
)
def test_a_wrong_line_is_named_with_its_file_its_place_and_the_choices(tmp_path, text, message):
    with pytest.raises(ConfigError) as refusal:
        from_text(tmp_path, text)
    assert str(tmp_path / "mine.toml") in str(refusal.value)
    assert message in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_a_file_that_is_missing_a_folder_or_no_text_is_named(tmp_path):
    with pytest.raises(ConfigError, match=r"none\.toml: cannot be read \(No such file"):
        load_config(MappingConfig, tmp_path / "none.toml")
    with pytest.raises(ConfigError, match=r"cannot be read \(Is a directory\)"):
        load_config(MappingConfig, tmp_path)
    (tmp_path / "image.toml").write_bytes(b"\x89PNG\xff")
    with pytest.raises(ConfigError, match=r"image\.toml: "):
        load_config(MappingConfig, tmp_path / "image.toml")


@dataclass(frozen=True)
class Outer:
    mapping: MappingConfig = field(default_factory=MappingConfig)
    seed: int = 0


def test_sections_within_sections_are_named_by_their_whole_path(tmp_path):
    with pytest.raises(ConfigError, match=r"unknown key 'mapping\.grid\.cell'; did you mean 'cell_m'\?"):
        config_from_table(Outer, {"mapping": {"grid": {"cell": 1.0}}})
    with pytest.raises(ConfigError, match=r"\[mapping\.model\] expected 0 < p_free"):
        config_from_table(Outer, {"mapping": {"model": {"prior": 0.95}}})
    outer = Outer(MappingConfig.for_camera(KITTI), seed=3)
    save_config(outer, tmp_path / "outer.toml")
    assert load_config(Outer, tmp_path / "outer.toml") == outer


def test_an_error_of_the_whole_names_no_section(tmp_path):
    @dataclass(frozen=True)
    class Odd:
        number: int = 1

        def __post_init__(self):
            if self.number % 2 == 0:
                raise InvalidInputError(f"number must be odd, not {self.number}")

    (tmp_path / "odd.toml").write_text("number = 2")
    with pytest.raises(ConfigError, match=r"odd\.toml: number must be odd, not 2$"):
        load_config(Odd, tmp_path / "odd.toml")


@pytest.mark.parametrize(
    ("setting", "found"),
    [
        ("grid.cell_m=0.3", lambda c: c.grid.cell_m == 0.3),
        (" grid.cell_m = 2 ", lambda c: c.grid.cell_m == 2.0),
        ("grid.cell_m=.5", lambda c: c.grid.cell_m == 0.5),
        ("matcher.name=sgbm", lambda c: c.matcher.name == "sgbm"),
        ('matcher.name="sgbm"', lambda c: c.matcher.name == "sgbm"),
        ("grid.clamp=[-1, 2.5]", lambda c: c.grid.clamp == (-1.0, 2.5)),
        ("motion_error.along.a=1e-3", lambda c: c.motion_error.along.a == 0.001),
        ('motion_error={way="pose", kappa=2}', lambda c: (c.motion_error.way, c.motion_error.kappa) == ("pose", 2.0)),
    ],
)
def test_a_setting_changes_its_parameter_and_no_other(setting, found):
    config = MappingConfig.for_camera(KITTI)
    changed = with_settings(config, [setting])
    assert found(changed) and not found(config)
    same = {"matcher", "model", "motion_error", "grid"} - {setting.strip().partition(".")[0].partition("=")[0]}
    assert all(getattr(changed, name) == getattr(config, name) for name in same)


@pytest.mark.parametrize("setting", ["x\ny=1", "grid.cell_m=1\n[model]", "=3", "grid.=1", "grid.cell_m.x=1", "a.b.c=1"])
def test_a_setting_that_is_none_is_refused(setting):
    with pytest.raises(ConfigError):
        with_settings(MappingConfig(), [setting])


def test_defaults_suit_the_minoru():
    config = MappingConfig.for_camera(MINORU)
    assert (config.grid.cell_m, config.model.max_range_m, config.matcher.num_disparities) == (0.05, 4.08, 80)


def test_defaults_suit_kitti():
    config = MappingConfig.for_camera(KITTI)
    assert (config.grid.cell_m, config.model.max_range_m, config.matcher.num_disparities) == (0.1, 11.3, 160)


@given(st.floats(100, 5000), st.floats(0.01, 3), st.integers(32, 4000))
def test_defaults_of_any_camera_are_within_their_rule(focal_px, baseline_m, width_px):
    camera = StereoCamera(focal_px, width_px / 2, 100, baseline_m, width_px, 200)
    config = MappingConfig.for_camera(camera)
    cell_m, range_m = config.grid.cell_m, config.model.max_range_m
    # Eq. 8: 0.3 px are 10 cm of depth at the largest range, which is given with three digits.
    assert range_m == pytest.approx((0.1 * focal_px * baseline_m / 0.3) ** 0.5, rel=0.0051)
    assert range_m / 200 * (1 - 1e-9) <= cell_m <= range_m / 80 * (1 + 1e-9)
    assert f"{cell_m:e}"[0] in "125"
    assert float(f"{cell_m:.0e}") == cell_m
    assert config.matcher.num_disparities % 16 == 0
    assert width_px / 8 - 1 <= config.matcher.num_disparities < width_px / 8 + 16


def test_a_mapper_is_built_as_the_config_says():
    config = MappingConfig(
        MatcherConfig("sgbm", 48),
        SensorModel(max_range_m=3.0, form="printed"),
        MotionError(along=Growth(a=0.001)),
        GridConfig(cell_m=0.1, fusion="sum_of_rays", clamp=(-2.0, 3.5), memory_limit_gb=1.0),
    )
    mapper = config.build_mapper(MINORU)
    assert repr(mapper.matcher) == "SemiGlobalMatcher(num_disparities=48, block_px=3)"
    assert mapper.grid.model == config.model
    assert mapper.grid.clamp == (-2.0, 3.5)
    assert (mapper.grid.cell_m, mapper.grid.fusion, mapper.grid.memory_limit_gb) == (0.1, "sum_of_rays", 1.0)
    assert mapper.motion_error == config.motion_error
    assert mapper.camera is MINORU


def test_no_limits_are_written_as_an_empty_list_and_the_default_is_six_nats_either_way(tmp_path):
    assert from_text(tmp_path, "[grid]\nclamp = []\n").build_mapper(MINORU).grid.clamp is None
    assert from_text(tmp_path, "").build_mapper(MINORU).grid.clamp == (-6.0, 6.0)


@pytest.mark.parametrize("limits", ["[3.0]", "[-1.0, 0.0, 1.0]"])
def test_limits_that_are_not_two_are_refused(tmp_path, limits):
    config = from_text(tmp_path, f"[grid]\nclamp = {limits}\n")
    with pytest.raises(InvalidInputError, match="clamp must be a lowest and a highest log-odds, one number or None"):
        config.build_mapper(MINORU)


@pytest.mark.parametrize("limits", ["[6.0, -6.0]", "[1.0, 2.0]", "[0.0, 0.0]", "[nan, 1.0]", "[-inf, inf]"])
def test_limits_that_do_not_lie_around_the_prior_or_are_not_finite_are_refused(tmp_path, limits):
    config = from_text(tmp_path, f"[grid]\nclamp = {limits}\n")
    with pytest.raises(InvalidInputError, match=r"within \+-1000, around the prior's 0, or None; not "):
        config.build_mapper(MINORU)


def test_a_mapper_weighs_by_the_reach_of_its_matchers_errors():
    """A second look from the same place counts for the matcher's temporal share."""
    wall = Disparity(np.full(MINORU.shape, 20.0, np.float32), np.float32(0.3))
    for name in ("bm", "sgbm"):
        novelty = MappingConfig(matcher=MatcherConfig(name)).build_mapper(MINORU).novelty
        assert novelty.weight(wall, np.eye(4)) == 1
        assert novelty.weight(wall, np.eye(4)) == pytest.approx(temporal_share(name))


def test_a_mapper_of_an_unknown_matcher_is_refused_with_the_choices():
    with pytest.raises(InvalidInputError, match=r"no matcher named 'sgmb'; did you mean 'sgbm'\? choose from: bm"):
        MappingConfig(matcher=MatcherConfig("sgmb")).build_mapper(MINORU)


def test_recorded_stands_for_no_matcher():
    config = MatcherConfig("recorded")
    assert MappingConfig(matcher=config).build_mapper(MINORU).matcher is None
    with pytest.raises(
        InvalidInputError, match=r"'recorded' matches no images; .* choose from: bm, gc, kz2, onnx, sgbm$"
    ):
        config.build()
    with pytest.raises(
        InvalidInputError,
        match=r"no matcher named 'recordet'; did you mean 'recorded'\? choose from: .*, recorded, sgbm$",
    ):
        MatcherConfig("recordet").build()


def test_saving_into_a_folder_that_is_not_there_is_refused(tmp_path):
    with pytest.raises(InvalidInputError, match=r"no such folder, so config\.toml cannot be written"):
        save_config(MappingConfig(), tmp_path / "none" / "config.toml")


def test_a_network_is_for_onnx_alone(tmp_path):
    with pytest.raises(ConfigError, match=r"\[matcher\] network is for the matcher 'onnx'; 'bm' takes none"):
        from_text(tmp_path, '[matcher]\nnetwork = "net.toml"\n')
    config = from_text(tmp_path, '[matcher]\nname = "onnx"\nnetwork = "none.toml"\n')
    with pytest.raises(ConfigError, match=r"none\.toml: cannot be read"):
        config.build_mapper(MINORU)
    with pytest.raises(InvalidInputError, match="the matcher 'onnx' needs a network"):
        MappingConfig(matcher=MatcherConfig("onnx")).build_mapper(MINORU)


@dataclass(frozen=True)
class Lists:
    shape: tuple[int, ...]
    grids: tuple[GridConfig, ...] = ()


def test_lists_are_read_item_by_item_and_a_wrong_item_is_named_by_its_place(tmp_path):
    found = config_from_table(Lists, {"shape": [3, 4], "grids": [{"cell_m": 1}, {}]})
    assert found == Lists((3, 4), (GridConfig(cell_m=1.0), GridConfig()))
    save_config(found, tmp_path / "lists.toml")
    assert load_config(Lists, tmp_path / "lists.toml") == found
    with pytest.raises(ConfigError, match=r"'shape\[1\]' must be int, not 'x'"):
        config_from_table(Lists, {"shape": [3, "x"]})
    with pytest.raises(ConfigError, match=r"unknown key 'grids\[0\]\.cell'"):
        config_from_table(Lists, {"shape": [], "grids": [{"cell": 1}]})
    with pytest.raises(ConfigError, match="'shape' must be a list, not 3"):
        config_from_table(Lists, {"shape": 3})


def test_a_key_without_a_default_is_asked_for_by_name():
    with pytest.raises(ConfigError, match="missing key 'shape'"):
        config_from_table(Lists, {})


def test_a_file_that_is_no_text_is_named_as_such(tmp_path):
    path = tmp_path / "config.toml"
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ConfigError, match=r"config\.toml: is no text in UTF-8, as TOML must be"):
        load_config(MappingConfig, path)


def test_lists_nested_deeper_than_the_parser_can_go_are_refused_in_one_line(tmp_path):
    (tmp_path / "deep.toml").write_text("a = " + "[" * 5000 + "]" * 5000)
    with pytest.raises(ConfigError, match=r"deep\.toml: "):
        load_config(MappingConfig, tmp_path / "deep.toml")
