"""Who may not open a device is told which group to join."""

import os
import stat
from pathlib import Path

import pytest

from hardware.doctor.permissions import Group, User, check_group, check_node, may_open, read_groups
from stereogrid.checks import NOT_THERE, OK, PROBLEM, WARNING

GROUPS = [Group("root", 0, ()), Group("dialout", 20, ("bob",)), Group("video", 44, ())]


def user(name="alice", *groups, uid=1000):
    return User(name, uid, frozenset(groups))


def status(mode, gid=20, uid=0):
    """As stat tells of a device node that nobody can make in a test."""
    return os.stat_result((stat.S_IFCHR | mode, 0, 0, 1, uid, gid, 0, 0, 0, 0))


@pytest.mark.parametrize(
    ("mode", "who", "may"),
    [
        (0o660, user("alice", 20), True),
        (0o660, user("alice", 44), False),
        (0o640, user("alice", 20), False),
        (0o666, user("alice"), True),
        (0o000, user("root", uid=0), True),
        # The owner's bits count for the owner, even where others may more.
        (0o066, user("alice", 20, uid=7), False),
    ],
)
def test_mode_owner_and_groups_decide(mode, who, may):
    assert may_open(status(mode, uid=7), who) is may


def checked(mode, who, *, gid=20, **given):
    return check_node(Path("/dev/ttyUSB0"), who, GROUPS, look=lambda _: status(mode, gid), **given)


def test_who_is_not_in_the_group_of_a_node_shall_join_it_and_log_in_again():
    check = checked(0o660, user())
    assert check.state == PROBLEM
    assert check.found == "crw-rw---- 0:dialout: not for alice"
    assert check.remedy == "sudo usermod -aG dialout alice, then log out and in again (or: newgrp dialout)"


def test_who_has_joined_already_shall_only_log_in_again():
    check = checked(0o660, user("bob"))
    assert check.remedy == "bob has joined dialout since logging in: log out and in again (or: newgrp dialout)"


def test_nobody_is_told_to_join_root():
    check = checked(0o660, user(), gid=0)
    assert "usermod" not in check.remedy and "udev rule" in check.remedy


def test_a_group_without_the_right_to_write_is_no_remedy():
    assert "usermod" not in checked(0o640, user()).remedy


def test_a_node_that_may_be_opened_is_well_also_where_only_the_system_knows_why():
    assert checked(0o660, user("alice", 20)).state == OK
    assert checked(0o660, user(), opens=True).state == OK


def test_a_node_that_is_gone_is_a_problem(tmp_path):
    assert check_node(tmp_path / "ttyUSB0", user(), GROUPS).state == PROBLEM


@pytest.mark.parametrize(
    ("who", "groups", "state"),
    [
        (user("alice", 20), GROUPS, OK),
        (user(), GROUPS, WARNING),
        (user(), [], NOT_THERE),
        (user("root", uid=0), [], OK),
    ],
)
def test_the_group_of_serial_lines_is_looked_at_with_nothing_plugged_in(who, groups, state):
    assert check_group("serial", who, groups).state == state


def test_a_group_file_is_read_past_its_bad_lines(tmp_path):
    path = tmp_path / "group"
    path.write_text("root:x:0:\nnonsense\n+::::\ndialout:x:20:alice,bob\nvideo:x:many:\n")
    assert read_groups(path) == [Group("root", 0, ()), Group("dialout", 20, ("alice", "bob"))]
    assert read_groups(tmp_path / "none") == []


def test_the_present_user_has_the_groups_of_this_process():
    assert User.current().groups >= {*os.getgroups()}
