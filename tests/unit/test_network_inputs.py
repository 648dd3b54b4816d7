"""Whatever experiment maps by a network of the user's, its run remembers what was in the network's files."""

from dataclasses import replace
from pathlib import Path

import pytest

pytest.importorskip("pybullet", reason="experiments drive through simulated worlds")
pytest.importorskip("distributed", reason="sweeps need the extra sweep")
pytest.importorskip("onnx", reason="a network is made for it")

from tiny_networks import write_network

from experiments import drive_experiment, matchers, sweep
from experiments.corridor import STORY, CorridorConfig
from experiments.matchers import MatchersConfig
from experiments.parallel import silent_stage
from experiments.sweep_cluster import Place
from experiments.sweep_config import SweepConfig, UnitConfig
from experiments.sweep_table import Made
from stereogrid.config import MatcherConfig
from stereogrid.run_record import RunRecord


@pytest.fixture
def network(tmp_path: Path) -> Path:
    path = tmp_path / "net.toml"
    inputs = 'inputs = [{name = "left", image = "left"}, {name = "right", image = "right"}]'
    path.write_text(f'weights = "net.onnx"\n{inputs}\n')
    write_network(tmp_path / "net.onnx")
    return path


class BegunError(Exception):
    """The run would begin now."""


def begins(_root: object, _name: str, record: RunRecord, _config: object) -> None:
    """In place of a run folder."""
    raise BegunError(record)


def with_network(kind: type, network: Path):
    config = kind()
    return replace(config, mapping=replace(config.mapping, matcher=MatcherConfig("onnx", network=str(network))))


@pytest.mark.parametrize("experiment", ["drive", "matchers", "sweep"])
def test_the_run_of_an_experiment_names_the_networks_files(experiment, network, tmp_path, monkeypatch):
    module = {"drive": drive_experiment, "matchers": matchers, "sweep": sweep}[experiment]
    monkeypatch.setattr(module, "recorded_run", begins)
    with pytest.raises(BegunError) as begun:
        if experiment == "drive":
            drive_experiment.run_story(STORY, with_network(CorridorConfig, network), silent_stage, runs=tmp_path)
        elif experiment == "matchers":
            net = {"matcher": "onnx", "labels_step": 0, "options": {"network": str(network)}}
            config = MatchersConfig(contenders={"bm": {}, "net": net})
            matchers.run(config, silent_stage, runs=tmp_path, pairs=None)
        else:
            config = SweepConfig(with_network(UnitConfig, network))
            monkeypatch.setattr(sweep, "compute", lambda *_, **__: [Made(each, error="x") for each in config.units()])
            sweep.run(config, place=Place(), runs=tmp_path, work=tmp_path)
    read = {(each.kind, each.path) for each in begun.value.args[0].inputs if each.kind != "pairs"}
    assert read == {("network", str(network)), ("weights", str(network.with_name("net.onnx")))}
