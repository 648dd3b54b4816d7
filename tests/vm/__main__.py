"""python tests/vm: the tests of tests/vm/inside in the virtual machine, whose names or options may follow a --;
python tests/vm --run -- COMMAND: any other command."""

import argparse
import sys
import time
from pathlib import Path

from debian_kernel import VmError
from machine import Machine, check_host

ROOT = Path(__file__).parents[2]
INSIDE = "tests/vm/inside"
PYTEST = [
    *(str(ROOT / ".venv/bin/python"), "-m", "pytest", f"--confcutdir={INSIDE}", "-o", f"pythonpath={INSIDE}"),
    *("-o", f"testpaths={INSIDE}", "-p", "no:cacheprovider", "--durations=0", "--durations-min=2"),
]


def main() -> int:
    parser = argparse.ArgumentParser(prog="python tests/vm", description=__doc__)
    parser.add_argument("--time-limit", type=float, default=900.0, metavar="S", help="for the command [s]")
    parser.add_argument("--run", action="store_true", help="run the command that follows, not pytest")
    parser.add_argument("command", nargs="*", help="after a --: arguments of pytest, or with --run the command")
    asked = parser.parse_args()
    began_s = time.monotonic()
    cache = ROOT / ".vm"
    color = f"--color={'yes' if sys.stdout.isatty() else 'no'}"
    command = asked.command if asked.run else [*PYTEST, color, *asked.command]
    try:
        check_host()
        cache.mkdir(exist_ok=True)
        machine = Machine(cache=cache, console=cache / "console.log")
        status = machine.run(command, folder=ROOT, time_limit_s=asked.time_limit, say=_say)
    except VmError as error:
        sys.exit(f"test-vm: {error}")
    _say(f"test-vm: exit status {status} after {time.monotonic() - began_s:.0f} s")
    return status


def _say(line: str) -> None:
    sys.stdout.write(line + "\n")
    sys.stdout.flush()


sys.exit(main())
