"""A run is repeated from its folder alone: the same hashes, or what is not the same and what changed in between."""

import re
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest
import tomli_w
from small_drives import small_drive

import stereogrid.commands.repeat as repeat_module
from experiments.__main__ import app as experiments_app
from experiments.corridor import CorridorConfig
from stereogrid import cli
from stereogrid.commands.repeat import _options
from stereogrid.config import GridConfig, MappingConfig, MatcherConfig, load_config, save_config
from stereogrid.errors import InvalidInputError
from stereogrid.grid import OccupancyGrid
from stereogrid.motion import Growth, MotionError
from stereogrid.run_record import RunInput, RunRecord
from stereogrid.sensor_model import SensorModel

CONFIG = MappingConfig(
    MatcherConfig("bm", 48),
    SensorModel(max_range_m=3.0),
    MotionError(way="pose", along=Growth(a=1e-4)),
    GridConfig(cell_m=0.1),
)


@pytest.fixture(scope="module")
def work(tmp_path_factory):
    """A folder with a recording and a run of each kind."""
    folder = tmp_path_factory.mktemp("work")
    small_drive(folder / "drive.mcap")
    save_config(CONFIG, folder / "mine.toml")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        patch.setattr(sys, "argv", ["stereogrid", "map", "drive.mcap"])
        options = ["--config", "mine.toml", "--poses", "truth", "--set", "grid.clamp=[-3.5, 3.5]", "--runs", "mapped"]
        assert cli.run(cli.app, ["map", "drive.mcap", *options]) == 0
    return folder


@pytest.fixture
def copy(work, tmp_path, monkeypatch):
    """The map's run in a folder of its own, with the recording beside it."""
    shutil.copytree(work / "mapped", tmp_path / "runs", symlinks=True)
    shutil.copy(work / "drive.mcap", tmp_path)
    run = tmp_path / "runs" / "latest"
    RunRecord.load(run).at(tmp_path / "drive.mcap").save(run)
    monkeypatch.chdir(tmp_path)
    return run


def repeated(capsys, *arguments, run="runs/latest"):
    code = cli.run(cli.app, ["repeat", run, *arguments])
    told = capsys.readouterr()
    return code, told.out, told.err


def test_a_run_folder_tells_what_made_it(work):
    run = work / "mapped" / "latest"
    record = RunRecord.load(run)
    assert (record.program, record.command, record.poses) == ("map", "stereogrid map drive.mcap", "truth")
    assert record.recording == str(work / "drive.mcap") and len(record.recording_sha256) == 64
    assert record.results["map.sgrid"] == OccupancyGrid.load(run / "map.sgrid").sha256()
    assert set(record.results) == {"map.sgrid", "metrics.json"}
    assert {"stereogrid", "numpy", "numba", "python"} <= set(record.versions)
    assert record.machine and record.duration_s > 0
    assert "<td>grid.cell_m</td><td>0.1</td><td>m</td>" in (run / "report.html").read_text()
    config = load_config(MappingConfig, run / "config.toml")
    assert config == replace(CONFIG, grid=replace(CONFIG.grid, clamp=(-3.5, 3.5)))
    assert "# Edge of a cell. [m; positive; default 0.05]\ncell_m = 0.1\n" in (run / "config.toml").read_text()


def test_a_map_is_made_again_with_the_same_hashes(copy, capsys):
    code, out, err = repeated(capsys)
    assert (code, err) == (0, "")
    assert re.search(r"map\.sgrid +(\w{12}) +\1 +yes", out) and "NO" not in out
    again = RunRecord.load(Path("runs/latest"))
    assert again.poses == "truth" and again.command.startswith("stereogrid")
    assert len(list(Path("runs").glob("*/run.toml"))) == 3  # two runs, and latest


def test_a_part_of_a_recording_is_mapped_again_as_that_part(copy, capsys):
    whole = OccupancyGrid.load(copy / "map.sgrid")
    replace(RunRecord.load(copy), stride=2).save(copy)
    code, _, err = repeated(capsys)
    assert code == 1 and re.match(
        r"error: map\.sgrid and 1 more: not the same as in .*; versions, config, machine", err
    )
    assert RunRecord.load(Path("runs/latest")).stride == 2
    assert OccupancyGrid.load("runs/latest/map.sgrid").n_known < whole.n_known


def test_a_changed_config_makes_another_map_and_is_named_as_the_cause(copy, capsys):
    text = (copy / "config.toml").read_text()
    (copy / "config.toml").write_text(text.replace("cell_m = 0.1", "cell_m = 0.2"))
    code, out, err = repeated(capsys)
    assert code == 1 and re.search(r"map\.sgrid +\w{12} +\w{12} +NO", out)
    assert re.fullmatch(r"error: map\.sgrid and 1 more: not the same as in \S+; changed in between: .*\n", err)
    assert err.endswith("changed in between: config.toml of the run\n")


def test_a_recording_with_one_byte_changed_is_refused_unless_it_is_wanted_anyway(copy, capsys):
    content = bytearray(Path("drive.mcap").read_bytes())
    content[-1] ^= 1  # of the closing magic: what is in it stays
    Path("drive.mcap").write_bytes(content)
    code, out, err = repeated(capsys)
    assert (code, out) == (1, "")
    assert re.fullmatch(r"error: \S+drive\.mcap: is not what the run read: its SHA-256 is .*--anyway\n", err)
    assert len(list(Path("runs").glob("*/run.toml"))) == 2


def test_a_recording_that_was_moved_is_asked_for_and_named_by_an_option(copy, capsys):
    Path("drive.mcap").rename("moved.mcap")
    code, _, err = repeated(capsys)
    assert code == 1 and err.endswith("drive.mcap: is not there any more; where it is now: --recording PATH\n")
    record = RunRecord.load(copy)
    replace(record, versions={**record.versions, "numpy": "1.0"}, machine="abacus").save(copy)
    code, out, err = repeated(capsys, "--recording", "moved.mcap")
    assert (code, err) == (0, "")
    assert "the same, although in between changed: numpy 1.0 -> " in out and "machine abacus -> " in out


@pytest.fixture(scope="module")
def experiment(work, tmp_path_factory):
    """A folder with runs/latest, of an experiment; what is named like a module of ours in it must never run."""
    folder = tmp_path_factory.mktemp("experiment")
    save_config(
        CorridorConfig(score_range_m=3.0, mapping=replace(CONFIG, motion_error=MotionError())), folder / "c.toml"
    )
    options = [
        "--config",
        str(folder / "c.toml"),
        "--recording",
        str(work / "drive.mcap"),
        "--runs",
        str(folder / "runs"),
    ]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["experiments", "corridor"])
        assert cli.run(experiments_app, ["corridor", *options]) == 0
    for name in ("experiments/__main__.py", "stereogrid/__init__.py", "random.py"):
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text("from pathlib import Path\n\nPath(__file__).with_suffix('.ran').touch()\n")
    return folder


def test_an_experiment_is_run_again_by_a_process_of_its_own_with_the_same_hashes(experiment, monkeypatch, capfd):
    """And never by what stands in the folder where one is."""
    monkeypatch.chdir(experiment)
    first = RunRecord.load(Path("runs/latest"))
    assert (first.program, first.seed, len(first.results)) == ("experiments corridor", 0, 5)
    assert cli.run(cli.app, ["repeat", "runs/latest"]) == 0
    told = capfd.readouterr()
    assert "NO" not in told.out and told.out.count("yes") == 5
    again = RunRecord.load(Path("runs/latest"))
    assert again.results == first.results and again.started >= first.started and "--config" in again.command
    assert not list(experiment.rglob("*.ran")) and not list(Path("runs").glob(".*"))


def test_an_interrupted_repetition_lets_the_experiment_tidy_up_before_it_ends(experiment):
    runs = experiment / "others"
    line = [sys.executable, "-m", "stereogrid.cli", "repeat", str(experiment / "runs" / "latest"), "--runs", str(runs)]
    with subprocess.Popen(line, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as process:
        until_s = time.monotonic() + 60
        while not list(runs.glob(".*corridor.partial")) and time.monotonic() < until_s:
            time.sleep(0.01)
        assert process.poll() is None and len(list(runs.glob(".repeated-*"))) == 1
        process.send_signal(signal.SIGINT)
        told = process.communicate(timeout=60)[1]
    assert process.returncode == cli.INTERRUPTED and "Traceback" not in told
    assert not list(runs.iterdir())


RECORD = RunRecord("experiments corridor", recording="drive.mcap", config_sha256="x", results={"a": "b"})


def test_of_an_experiment_only_known_inputs_become_options():
    made_its_drive = replace(RECORD, inputs=(RunInput("data", "/data"), RunInput("network", "/net.toml")))
    assert list(_options(made_its_drive, Path("/run"))) == ["--config", "/run/config.toml", "--data", "/data"]
    reused = replace(RECORD, recording="/drive.mcap", config_sha256="", matchers=("bm",))
    assert list(_options(reused, Path("/run"))) == ["--recording", "/drive.mcap", "--matcher", "bm"]
    with pytest.raises(InvalidInputError, match="'--write' is no name of a matcher"):
        list(_options(replace(RECORD, matchers=("--write",)), Path("/run")))


@pytest.mark.parametrize(
    ("record", "said"),
    [
        (None, "no run folder, or one of an older version: it has no run.toml"),
        (replace(RECORD, program="experiments ../evil"), "there is no way to repeat a run of 'experiments ../evil'"),
        (replace(RECORD, program="experiments --help"), "there is no way to repeat a run of"),
        (replace(RECORD, program="os.system"), "there is no way to repeat a run of 'os.system'"),
        (replace(RECORD, program="hardware drive"), "made by hardware drive: a drive happens once; `stereogrid map"),
        (replace(RECORD, results={}), "holds no results that a repetition could be compared with"),
    ],
)
def test_what_cannot_be_repeated_is_said_in_one_line(record, said, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("old").mkdir()
    if record is not None:
        record.save(Path("old"))
    code, out, err = repeated(capsys, run="old")
    assert (code, out) == (1, "")
    assert re.fullmatch(r"error: [^\n]*\n", err) and said in err


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("poses", "dreamt", "no poses named 'dreamt'; choose from: odometry, standing, truth"),
        ("stride", 0, "stride must be >= 1, not 0"),
        ("inputs", [{"kind": "shell", "path": "/bin/sh"}], "no inputs[0].kind named 'shell'"),
        ("code", "import os", "unknown key 'code'"),
    ],
)
def test_a_damaged_run_toml_is_refused_by_its_key(key, value, said, tmp_path, capsys):
    (tmp_path / "run.toml").write_text(tomli_w.dumps({"program": "map", key: value}))
    code, _, err = repeated(capsys, run=str(tmp_path))
    assert code == 1 and re.fullmatch(r"error: \S+run\.toml: [^\n]*\n", err) and said in err


def test_without_a_clone_an_experiments_run_is_not_repeated(tmp_path, monkeypatch, capsys):
    """As where the wheel alone is installed: the package experiments is nowhere."""
    RECORD.save(tmp_path)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(repeat_module, "CLONE", tmp_path)
    (tmp_path / "experiments").mkdir()
    (tmp_path / "experiments" / "__main__.py").touch()  # but no pyproject.toml
    code, _, err = repeated(capsys, run=".")
    assert code == 1
    assert err.endswith("made by an experiment, which only a clone of stereogrid has: repeat it there\n")
