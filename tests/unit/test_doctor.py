"""What the doctor says of a computer that cannot do it, and that it runs on one that can."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from stereogrid.checks import NOT_THERE, OK, PROBLEM, WARNING
from stereogrid.doctor import (
    EXTRAS,
    REQUIRED,
    check_chain,
    check_extra,
    check_folder,
    check_memory,
    check_opencv,
    check_package,
    check_python,
    check_terminal,
)

ROOT = Path(__file__).parents[2]


def test_what_is_well_needs_no_remedy() -> None:
    for check in (check_python((3, 10)), check_package("numpy", "numpy"), check_memory(8.0), check_terminal("utf-8")):
        assert check.state == OK and not check.remedy


def test_a_package_that_cannot_be_imported_is_a_problem_with_its_reason(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "broken_package.py").write_text("raise OSError('libGL.so.1:\\ncannot open shared object file')")
    monkeypatch.syspath_prepend(tmp_path)
    broken = check_package("broken_package", "broken-package")
    assert broken.state == PROBLEM and "OSError: libGL.so.1: cannot open" in broken.found
    assert broken.remedy == "pip install --force-reinstall broken-package"
    assert check_package("no_such_package_at_all", "it").state == PROBLEM


@pytest.mark.parametrize("module", ["cv2", "numba", "numpy", "scipy"])
def test_where_a_package_is_broken_every_check_is_made_and_says_what_to_do(module: str, tmp_path: Path) -> None:
    (tmp_path / f"{module}.py").write_text("raise OSError('libGL.so.1:\\ncannot open shared object file')")
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])}
    line = [sys.executable, "-m", "stereogrid.cli", "doctor", "--json"]
    done = subprocess.run(line, capture_output=True, text=True, timeout=120, env=environment, cwd=ROOT, check=False)
    assert (done.returncode, done.stderr) == (1, "")
    checks = {each["name"]: each for each in json.loads(done.stdout)["checks"]}
    ill = checks[REQUIRED[module]]
    assert ill["state"] == PROBLEM and "OSError: libGL.so.1: cannot open" in ill["found"]
    assert f"not tried without {REQUIRED[module]}" in checks["images to map"]["found"]
    assert {"processor", "compiled kernels", "terminal", "memory", "results"} <= checks.keys()
    assert all(each["remedy"] for each in checks.values() if each["state"] == PROBLEM)


def test_two_packages_of_opencv_are_told() -> None:
    assert check_opencv({"opencv-python-headless": "5.0"}).state == OK
    two = check_opencv({"opencv-python": "4.9", "opencv-python-headless": "5.0"})
    assert two.state == WARNING and "pip uninstall opencv-python opencv-python-headless" in two.remedy


@pytest.mark.parametrize("extra", EXTRAS)
def test_an_extra_that_is_missing_says_how_it_is_got(extra: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda _: None)
    missing = check_extra(extra)
    assert missing.state == NOT_THERE
    assert f"stereogrid[{extra}]" in missing.remedy or sys.version_info[:2] >= (3, 12)


def test_the_extras_are_those_of_the_package() -> None:
    tomllib = pytest.importorskip("tomllib" if sys.version_info >= (3, 11) else "tomli")
    project = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text())["project"]
    for_developers = {"test", "oracle", "bench", "dev"}
    assert EXTRAS.keys() == project["optional-dependencies"].keys() - for_developers


def test_a_folder_that_cannot_be_written_is_a_problem_and_one_that_is_not_there_is_none(tmp_path: Path) -> None:
    assert check_folder(tmp_path / "not" / "yet").state == OK
    assert not (tmp_path / "not").exists()
    read_only = check_folder(Path("/proc/sys"))
    assert read_only.state == PROBLEM and "--runs" in read_only.remedy


def test_little_memory_and_a_poor_terminal_are_warnings() -> None:
    assert check_memory(1.0).state == check_terminal("ANSI_X3.4-1968").state == WARNING
    assert check_python((3, 99)).state == WARNING


def test_a_wall_of_dots_stands_where_it_is() -> None:
    check = check_chain()
    assert check.state == OK and check.values["ms"] > 0


def test_the_command_tells_machines_the_same_and_ends_with_1_where_there_is_a_problem() -> None:
    line = [sys.executable, "-m", "stereogrid.cli", "doctor", "--json"]
    well = subprocess.run(line, capture_output=True, text=True, timeout=120)
    told = json.loads(well.stdout)
    assert well.returncode == 0 and told["healthy"] and len(told["checks"]) > 15
    ill = subprocess.run([*line, "--runs", "/proc/sys"], capture_output=True, text=True, timeout=120)
    assert ill.returncode == 1 and not json.loads(ill.stdout)["healthy"]


def test_kernels_that_no_other_process_will_find_are_told() -> None:
    code = (
        "import os; os.access = lambda *_, **__: False\n"
        "from stereogrid.doctor import check_kernel_cache; print(check_kernel_cache().state)"
    )
    environment = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, timeout=120)
    assert done.stdout == f"{WARNING}\n", done.stderr
