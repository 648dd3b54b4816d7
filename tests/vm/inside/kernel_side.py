"""What the tests ask of the guest's kernel: modules, mounts, drivers, controls."""

import os
import subprocess
import time
from collections.abc import Callable
from pathlib import Path


def load(name: str, *options: str) -> None:
    """The module, after all that it needs; options are its own. Loaded already: nothing."""
    folder = Path(os.environ["STEREOGRID_VM_MODULES"])
    loaded = {line.split()[0] for line in Path("/proc/modules").read_text().splitlines()}
    for file in (folder / f"{name}.load").read_text().split():
        own = options if file == f"{name}.ko" else ()
        if file.removesuffix(".ko").replace("-", "_") not in loaded:
            subprocess.run(["busybox", "insmod", str(folder / file), *own], check=True)


def mount(kind: str, folder: Path) -> None:
    subprocess.run(["mount", "-t", kind, kind, str(folder)], check=True)


def controls(node: str, *names: str) -> dict[str, int]:
    """The controls' values, asked of the kernel."""
    ask = ["v4l2-ctl", "-d", node, "-C", ",".join(names)]
    said = subprocess.run(ask, check=True, capture_output=True, text=True).stdout
    return {name: int(value.split()[0]) for name, value in (line.split(":") for line in said.splitlines())}


def set_controls(node: str, **values: int) -> None:
    given = ",".join(f"{name}={value}" for name, value in values.items())
    subprocess.run(["v4l2-ctl", "-d", node, "-c", given], check=True, capture_output=True)


def wait_until(true: Callable[[], bool], what: str, limit_s: float = 30.0) -> None:
    end_s = time.monotonic() + limit_s
    while not true():
        assert time.monotonic() < end_s, f"{what} did not come in {limit_s:g} s"
        time.sleep(0.05)
