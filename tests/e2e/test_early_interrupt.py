"""Ctrl-C at any moment after a program's first line ends it without a traceback."""

import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

PROGRAMS = {
    "stereogrid": ["stereogrid", "info", "none.mcap"],
    "stereogrid.cli": ["stereogrid.cli", "map", "none.mcap"],
    "sim": ["sim", "record", "moon", "--out", "none.mcap"],
    "hardware": ["hardware", "motion", "--help"],
    "experiments": ["experiments", "corridor", "--recording", "none.mcap"],
}
MOMENTS_S = (0.0, 0.02, 0.05, 0.1, 0.2, 0.3, 0.45, 0.7)
HEAVY = ("typing", "typer", "rich")
BOOT_S = 30


def catches_interrupts(pid: int) -> bool:
    """Whether the process has a handler for SIGINT of its own, as Python sets one up when it boots."""
    status = Path(f"/proc/{pid}/status").read_text(encoding="ascii")
    caught = next(line.split()[1] for line in status.splitlines() if line.startswith("SigCgt:"))
    return bool(int(caught, 16) >> (signal.SIGINT - 1) & 1)


def interrupted(program: str, after_s: float) -> tuple[int, str]:
    """The exit code and stderr of a program that gets SIGINT so long after its first line has run."""
    line = [sys.executable, "-m", *PROGRAMS[program]]
    with subprocess.Popen(line, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as process:
        give_up = time.monotonic() + BOOT_S
        for booted in (True, False):  # Python's handler is set, and then the first line has put it away
            while catches_interrupts(process.pid) is not booted and time.monotonic() < give_up:
                time.sleep(0.0005)
        time.sleep(after_s)
        process.send_signal(signal.SIGINT)
        return process.wait(timeout=60), process.stderr.read()  # type: ignore[union-attr]


@pytest.mark.parametrize("program", PROGRAMS)
def test_an_interrupt_while_a_program_starts_shows_no_traceback(program):
    with ThreadPoolExecutor(2) as pool:
        ends = list(pool.map(lambda after_s: interrupted(program, after_s), MOMENTS_S))
    for code, told in ends:
        assert "Traceback" not in told and "KeyboardInterrupt" not in told
        assert code in (-signal.SIGINT, 130, 0, 1), told  # 0, 1: it had ended before
        if code == 130:
            assert "interrupted; earlier results are as they were\n" in told
    assert -signal.SIGINT in {code for code, _ in ends}


@pytest.mark.parametrize("program", PROGRAMS)
def test_the_first_line_comes_before_anything_that_takes_long_to_import(program):
    line = [sys.executable, "-X", "importtime", "-m", PROGRAMS[program][0], "--help"]
    done = subprocess.run(line, capture_output=True, text=True, timeout=60)
    imported = [row.rpartition("|")[2].strip() for row in done.stderr.splitlines() if row.startswith("import time:")]
    first = imported.index("stereogrid.early")
    assert "typer" in imported
    # What the interpreter itself had loaded by then (editable installs may load typing) cannot be helped.
    begun = imported.index("runpy")
    assert not {*imported[begun:first]} & {*HEAVY}


def test_a_program_in_the_background_whose_interrupts_are_ignored_ignores_them():
    script = (
        "import signal, sys; signal.signal(signal.SIGINT, signal.SIG_IGN)\n"
        "from stereogrid.early import end_at_once; end_at_once()\n"
        "import typer; from stereogrid.cli import run\n"
        "app = typer.Typer()\n"
        "@app.command()\n"
        "def work(): signal.raise_signal(signal.SIGINT); print('done')\n"
        "sys.exit(run(app, []))"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stdout, done.stderr) == (0, "done\n", "")


def test_handlers_of_signals_are_as_before_once_a_command_has_ended(capsys):
    from stereogrid import cli

    before = [signal.getsignal(each) for each in (signal.SIGINT, signal.SIGTERM)]
    assert cli.run(cli.app, ["info", "none.mcap"]) == 1
    assert [signal.getsignal(each) for each in (signal.SIGINT, signal.SIGTERM)] == before
