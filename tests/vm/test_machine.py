"""What `make test-vm` says where it cannot run, and that it always ends; whether it can run, it shows itself."""

import subprocess
import sys
import time
from pathlib import Path

VM = Path(__file__).parent


def test_every_package_that_is_absent_is_named_in_one_line(tmp_path: Path) -> None:
    done = subprocess.run([sys.executable, VM], env={"PATH": str(tmp_path)}, capture_output=True, text=True)
    assert done.returncode == 1 and done.stdout == ""
    assert done.stderr.count("\n") == 1
    for package in ("qemu-system-x86", "busybox-static", "v4l-utils", "apt", "dpkg"):
        assert package in done.stderr


def watched(shell: str, time_limit_s: float) -> list[str]:
    """What the guest said, and last what its end was; for a machine that is a shell's command."""
    code = (
        "import sys; from machine import watched;"
        "print(watched(['sh', '-c', sys.argv[1]], mark='MARK', time_limit_s=float(sys.argv[2]), say=print))"
    )
    command = [sys.executable, "-c", code, shell, str(time_limit_s)]
    return subprocess.run(command, cwd=VM, capture_output=True, text=True, check=True).stdout.splitlines()


def test_the_exit_status_in_the_guest_is_what_follows_the_mark() -> None:
    assert watched("echo hello; echo MARK 7", 60.0) == ["hello", "7"]


def test_a_machine_that_dies_without_a_status_gives_none() -> None:
    assert watched("echo hello", 60.0) == ["hello", "no exit status came"]


def test_a_machine_that_hangs_is_killed_when_its_time_is_over() -> None:
    began_s = time.monotonic()
    assert watched("exec sleep 60", 0.5) == ["not done in 0.5 s"]
    assert time.monotonic() - began_s < 30.0
