"""Who may open a device node: by its owner, its group and its mode, and by the groups of this session."""

import getpass
import os
import stat
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from stereogrid.checks import NOT_THERE, OK, PROBLEM, WARNING, Check

GROUPS = {"serial": "dialout", "video": "video"}
"""The groups that own these nodes on Debian, Ubuntu and Fedora; elsewhere the nodes themselves tell."""
LOG_IN = "log out and in again (or: newgrp {group})"


@dataclass(frozen=True)
class User:
    """Who runs this. groups: the ids that this process has, which are those of when its user logged in."""

    name: str
    uid: int
    groups: frozenset[int]

    @staticmethod
    def current() -> "User":
        """The user of this process."""
        try:
            name = getpass.getuser()
        except (KeyError, OSError):  # in a container users may have no name
            name = str(os.geteuid())
        return User(name, os.geteuid(), frozenset([*os.getgroups(), os.getegid()]))


@dataclass(frozen=True)
class Group:
    """One line of /etc/group."""

    name: str
    gid: int
    members: tuple[str, ...]


def read_groups(path: Path = Path("/etc/group")) -> list[Group]:
    """The groups of a file such as /etc/group; lines that are none are passed over, and no file has none."""
    try:
        lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return []
    found = (line.split(":") for line in lines)
    return [
        Group(cells[0], int(cells[2]), tuple(filter(None, cells[3].split(","))))
        for cells in found
        if len(cells) == 4 and cells[2].isdigit()
    ]


def may_open(status: os.stat_result, user: User) -> bool:
    """Whether the user may read and write a file by its mode; lists of access beside it are not seen."""
    if user.uid == 0:
        return True
    if status.st_uid == user.uid:
        wanted = stat.S_IRUSR | stat.S_IWUSR
    elif status.st_gid in user.groups:
        wanted = stat.S_IRGRP | stat.S_IWGRP
    else:
        wanted = stat.S_IROTH | stat.S_IWOTH
    return status.st_mode & wanted == wanted


def check_node(
    node: Path,
    user: User,
    groups: list[Group],
    *,
    opens: bool = False,
    look: Callable[[Path], os.stat_result] = os.stat,
) -> Check:
    """Whether the user may use a device node. opens: the system says so, whatever the mode (udev's uaccess)."""
    name = f"permission for {node}"
    try:
        status = look(node)
    except OSError as error:
        return Check(name, PROBLEM, f"cannot be looked at ({error.strerror})", "is it still plugged in?")
    owners = next((group for group in groups if group.gid == status.st_gid), None)
    named = owners.name if owners else str(status.st_gid)
    found = f"{stat.filemode(status.st_mode)} {status.st_uid}:{named}"
    if may_open(status, user) or opens:
        return Check(name, OK, found)
    return Check(name, PROBLEM, f"{found}: not for {user.name}", _remedy(node, owners, user, status.st_mode))


def check_group(kind: str, user: User, groups: list[Group]) -> Check:
    """Whether the user is in the group that devices of a kind ("serial" or "video") belong to, plugged in or not."""
    wanted = GROUPS[kind]
    name = f"group {wanted}"
    group = next((each for each in groups if each.name == wanted), None)
    if user.uid == 0:
        return Check(name, OK, "root may open every device")
    if group is None:
        return Check(name, NOT_THERE, f"this system has no such group; its {kind} devices tell theirs when plugged in")
    if group.gid in user.groups:
        return Check(name, OK, f"{user.name} is in it, for {kind} devices")
    return Check(name, WARNING, f"{user.name} is not in it, for {kind} devices", _join(group, user))


def _remedy(node: Path, owners: Group | None, user: User, mode: int) -> str:
    # Root's own group gives away far more than one device.
    if owners is not None and owners.gid != 0 and mode & stat.S_IRGRP and mode & stat.S_IWGRP:
        return _join(owners, user)
    return f"a udev rule that gives it a group (docs/hardware.md), or for now: sudo setfacl -m u:{user.name}:rw {node}"


def _join(group: Group, user: User) -> str:
    log_in = LOG_IN.format(group=group.name)
    if user.name in group.members and group.gid not in user.groups:
        return f"{user.name} has joined {group.name} since logging in: {log_in}"
    return f"sudo usermod -aG {group.name} {user.name}, then {log_in}"
