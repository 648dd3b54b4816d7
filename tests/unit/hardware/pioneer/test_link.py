"""Links over real sockets and terminals: what addresses mean, and one clear line for whatever is not there."""

import errno
import os
import socket
import time
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from hardware.errors import RobotError
from hardware.pioneer.link import Link, LinkError, SerialLink, TcpLink, _serial_error, open_link
from stereogrid.errors import InvalidInputError


@pytest.fixture
def listener() -> Iterator[socket.socket]:
    with socket.create_server(("127.0.0.1", 0)) as server:
        yield server


@pytest.fixture
def terminal() -> Iterator[tuple[int, str]]:
    ours, theirs = os.openpty()
    path = os.ttyname(theirs)
    os.close(theirs)
    yield ours, path
    os.close(ours)


def heard(link: Link, size: int) -> bytes:
    data = b""
    while len(data) < size:
        data += link.receive(5.0)
    return data


@pytest.mark.parametrize("form", ["tcp:127.0.0.1:{}", "127.0.0.1:{}", "localhost:{}"])
def test_a_tcp_address_is_connected_to_and_bytes_go_both_ways(form: str, listener: socket.socket) -> None:
    link = open_link(form.format(listener.getsockname()[1]))
    assert isinstance(link, TcpLink) and not link.is_serial
    with closing(link), listener.accept()[0] as robot:
        link.send(b"\xfa\xfb\x00")
        assert robot.recv(10) == b"\xfa\xfb\x00"
        robot.send(b"\x00\xff")
        assert heard(link, 2) == b"\x00\xff"
        assert link.receive(0.01) == b""
        robot.close()
        with pytest.raises(LinkError, match="hung up"):
            link.receive(5.0)


@pytest.mark.parametrize("form", ["{}", "serial:{}"])
def test_a_serial_address_is_opened_raw_and_bytes_go_both_ways(form: str, terminal: tuple[int, str]) -> None:
    robot, path = terminal
    every = bytes(range(256))
    with closing(open_link(form.format(path))) as link:
        assert isinstance(link, SerialLink) and link.is_serial and link.byte_s == 0.0
        link.send(every)
        assert os.read(robot, 300) == every
        os.write(robot, every)
        assert heard(link, 256) == every
        link.set_baud(38400)
        assert link.receive(0.01) == b""


def test_a_line_without_its_other_end_is_cut() -> None:
    ours, theirs = os.openpty()
    path = os.ttyname(theirs)
    os.close(theirs)
    with closing(open_link(path)) as link:
        os.close(ours)
        with pytest.raises(LinkError, match=f"the line {path} is cut"):
            link.receive(5.0)
        with pytest.raises(LinkError, match="cannot go at 38400 baud"):
            link.set_baud(38400)
        # It is let go of without a word, so that it can be opened again when it is plugged in.
        link.close(discard=True)
        link.close()


def test_a_line_is_for_one_program_at_a_time(terminal: tuple[int, str]) -> None:
    _, path = terminal
    with closing(open_link(path)), pytest.raises(RobotError, match=f"{path} is in use: another program drives"):
        open_link(path)
    open_link(path).close()


@pytest.mark.parametrize(
    "address", ["", "robot", "tcp:", "tcp:host:", "tcp:host:0", "host:70000", "host:x", ":8101", "serial:", "tcp::8101"]
)
def test_other_addresses_are_refused_with_the_forms_that_there_are(address: str) -> None:
    with pytest.raises(InvalidInputError, match=r"the robot's address '.*' is none of tcp:HOST:PORT"):
        open_link(address)


def test_nobody_there_is_said_with_what_to_look_for(listener: socket.socket, tmp_path: Path) -> None:
    port = listener.getsockname()[1]
    listener.close()
    with pytest.raises(RobotError, match=f"nobody listens at 127.0.0.1:{port}: is the robot, or its simulator, run"):
        open_link(f"127.0.0.1:{port}")
    for host in ("no robot", "a..b"):
        with pytest.raises(RobotError, match=f"no computer named '{host}' is known"):
            open_link(f"{host}:8101")
    with pytest.raises(RobotError, match=r"no serial line /dev/ttyNONE: is the adapter plugged in\?"):
        open_link("/dev/ttyNONE")
    for path in ("/dev/null", str(tmp_path)):
        with pytest.raises(RobotError, match=rf"{path} is no serial line"):
            open_link(path)


def test_a_forbidden_line_names_the_group(tmp_path: Path) -> None:
    error = _serial_error("/dev/ttyUSB0", OSError(errno.EACCES, "Permission denied"))
    assert "join the group dialout (sudo usermod -aG dialout $USER)" in str(error)
    if os.geteuid() != 0:
        line = tmp_path / "line"
        line.touch(0)
        with pytest.raises(RobotError, match="no permission"):
            open_link(str(line))


def test_a_peer_that_does_not_read_does_not_hold_the_driver_up(listener: socket.socket) -> None:
    with closing(open_link(f"127.0.0.1:{listener.getsockname()[1]}")) as link, listener.accept()[0]:
        longest_s = 0.0
        with pytest.raises(LinkError, match="takes no more bytes"):
            for _ in range(10_000):
                start_s = time.monotonic()
                try:
                    link.send(bytes(10_000))
                finally:
                    longest_s = max(longest_s, time.monotonic() - start_s)
        assert longest_s < 0.45, "it waited for longer than a stop may take"


def test_what_was_said_before_a_connection_is_closed_arrives_whatever_was_not_read(listener: socket.socket) -> None:
    link = open_link(f"127.0.0.1:{listener.getsockname()[1]}")
    with listener.accept()[0] as robot:
        robot.send(bytes(1000))
        link.send(b"farewell")
        link.close()
        assert robot.recv(100) == b"farewell"
        assert robot.recv(100) == b""


def test_what_is_discarded_never_arrives_later(listener: socket.socket) -> None:
    link = open_link(f"127.0.0.1:{listener.getsockname()[1]}")
    with listener.accept()[0] as robot:
        link.close(discard=True)
        with pytest.raises(ConnectionResetError):
            robot.recv(10)
