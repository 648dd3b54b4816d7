"""What the computer lacks is named, with what to type."""

from pathlib import Path

import pytest

from hardware.doctor.machine import EXTRAS, check_clock, check_disk, check_extra, check_machine, check_tool
from stereogrid.checks import OK, PROBLEM, WARNING


def test_a_missing_program_is_a_warning_with_its_package():
    check = check_tool(lambda _: None)
    assert (check.state, check.remedy) == (WARNING, "sudo apt install v4l-utils")
    assert check_tool(lambda name: f"/usr/bin/{name}").found == "/usr/bin/v4l2-ctl"


@pytest.mark.parametrize(("module", "extra"), [("serial", "hardware"), ("viser", "view")])
def test_a_missing_package_is_a_warning_with_its_extra(module, extra):
    check = check_extra(module, lambda _: None)
    assert (check.state, check.remedy) == (WARNING, f'pip install "stereogrid[{extra}]"')
    assert check_extra(module, lambda _: "there").state == OK


def test_the_extras_that_are_named_are_the_packages_own():
    project = (Path(__file__).parents[4] / "pyproject.toml").read_text()
    for package, extra, _ in EXTRAS.values():
        assert f'{extra} = ["{package}' in project


@pytest.mark.parametrize(
    ("free", "state", "told"),
    [(100e9, OK, "6 h"), (8e9, OK, "29 min"), (4e9, WARNING, "14 min"), (0.2e9, PROBLEM, "43 s")],
)
def test_room_is_told_as_time_to_record(free, state, told):
    check = check_disk(Path("/data"), lambda _: int(free))
    assert (check.state, told in check.found) == (state, True), check.found


def test_a_folder_that_is_not_there_is_a_problem(tmp_path):
    assert check_disk(tmp_path / "none").state == PROBLEM
    assert check_disk(tmp_path).values["free_bytes"] > 0


def test_a_clock_that_was_never_set_is_told():
    assert check_clock(lambda: 1000.0).state == WARNING
    assert check_clock().state == OK


def test_this_machine_is_looked_at_in_every_respect(tmp_path):
    assert [check.name for check in check_machine(tmp_path)] == [
        "v4l2-ctl",
        "pyserial",
        "viser",
        "room for recordings",
        "clock",
    ]
