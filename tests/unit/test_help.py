"""Every command shows an example that is one, typing errors cost one line, and the shell completes what is begun."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
import typer

import experiments.__main__
import hardware.__main__
import sim.__main__
import stereogrid.cli
from stereogrid.commands.options import MATCHER_NAMES
from stereogrid.matching import MATCHERS

APPS = {
    "python -m experiments": experiments.__main__.app,
    "python -m hardware": hardware.__main__.app,
    "python -m sim": sim.__main__.app,
    "stereogrid": stereogrid.cli.app,
}


def commands() -> dict[str, typer.models.CommandInfo]:
    """Every command of ours by how it is called."""
    named = {}
    for program, app in APPS.items():
        for command in app.registered_commands:
            name = command.name or command.callback.__name__.replace("_", "-")  # type: ignore[union-attr]
            named[f"{program} {name}"] = command
    return named


@pytest.mark.parametrize("called", commands())
def test_every_command_shows_an_example_of_itself(called: str) -> None:
    epilog = commands()[called].epilog or ""
    assert epilog.startswith("Example: ")
    assert epilog.startswith(f"Example: {called}") or epilog.startswith("Example: make ")


def completed(words: str) -> list[str]:
    """What bash would offer for the last of these words."""
    script = Path(sys.executable).with_name("stereogrid")
    begun = {"COMP_WORDS": words, "COMP_CWORD": str(len(words.split(" ")) - 1), "_STEREOGRID_COMPLETE": "complete_bash"}
    line = [script] if script.exists() else [sys.executable, "-m", "stereogrid.cli"]
    done = subprocess.run(line, env={**os.environ, **begun}, capture_output=True, text=True, timeout=60)
    return done.stdout.split()


def test_the_shell_completes_commands_options_and_matchers() -> None:
    assert {"map", "motion-error"} <= set(completed("stereogrid m"))
    assert "--matcher" in completed("stereogrid map --mat")
    assert completed("stereogrid map drive.mcap --matcher s") == ["sgbm"]


def test_the_matchers_that_are_completed_are_those_that_there_are() -> None:
    assert set(MATCHERS) <= set(MATCHER_NAMES)


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ("mpa drive.mcap", "No such command 'mpa'"),
        ("map drive.mcap --matchr bm", "No such option: --matchr"),
        ("map drive.mcap --cell abc", "--cell"),
        ("map", "Missing argument"),
        ("map drive.mcap --out map.ply", "map.ply: a map's name must end with .sgrid"),
    ],
)
def test_a_typing_error_costs_one_line_that_says_where_to_look(
    line: str, told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert stereogrid.cli.run(stereogrid.cli.app, line.split()) == 1
    out, err = capsys.readouterr()
    assert not out and err.count("\n") == 1 and err.startswith("error: ") and told in err
    assert "--help" in err or "export" in err


def test_the_version_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    assert stereogrid.cli.run(stereogrid.cli.app, ["--version"]) == 0
    assert capsys.readouterr().out == f"{stereogrid.__version__}\n"


def test_help_ends_well_and_a_program_without_a_word_shows_it(capsys: pytest.CaptureFixture[str]) -> None:
    assert stereogrid.cli.run(stereogrid.cli.app, ["map", "--help"]) == 0
    shown = capsys.readouterr()
    assert "Example: stereogrid map" in shown.out + shown.err
    stereogrid.cli.run(stereogrid.cli.app, [])
    shown = capsys.readouterr()
    assert "motion-error" in shown.out + shown.err


def test_a_config_that_is_there_is_not_written_over(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "my.toml"
    assert stereogrid.cli.run(stereogrid.cli.app, ["config", str(path)]) == 0
    path.write_text("# mine\n")
    assert stereogrid.cli.run(stereogrid.cli.app, ["config", str(path)]) == 1
    assert "exists already" in capsys.readouterr().err and path.read_text() == "# mine\n"


UNCACHED = """
import os, stat
os.access = lambda *_, **__: False  # a shared installation, and no home
import stereogrid as sg
place = os.environ["NUMBA_CACHE_DIR"]
assert stat.S_IMODE(os.stat(place).st_mode) == 0o700
print(place)
"""


def test_where_nothing_can_be_written_kernels_are_kept_for_this_process_alone() -> None:
    environment = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}
    done = subprocess.run([sys.executable, "-c", UNCACHED], env=environment, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    assert not Path(done.stdout.strip()).exists()
