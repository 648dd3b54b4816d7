"""Serial lines are listed, and an adapter without one is told why."""

import pytest
from usb_bus import UsbBus

from hardware.doctor.serial_lines import SerialLine, check_adapters, check_lines, nodes, serial_lines
from hardware.doctor.usb import usb_devices
from stereogrid.checks import NOT_THERE, OK, PROBLEM


@pytest.fixture
def tree(tmp_path):
    return UsbBus(tmp_path)


def test_what_is_on_the_usb_is_read_from_its_tree(tree):
    tree.device("1-1", "1d6b:0002", driver="hub")
    tree.device("1-1.3", "067b:2303", speed=12, product="USB-Serial Controller", tty="ttyUSB0", driver="pl2303")
    tree.device("2-1", "2341:0043", speed=12, tty="ttyACM0", driver="cdc_acm")
    (tree.usb / "usb1").mkdir()
    (tree.usb / "3-1").mkdir()  # unplugged while it is read
    hub, adapter, arduino = usb_devices(tree.usb)
    assert (adapter.port, adapter.id, adapter.bus, adapter.speed_mbps) == ("1-1.3", "067b:2303", 1, 12)
    assert (adapter.product, adapter.ttys, adapter.drivers) == ("USB-Serial Controller", ("ttyUSB0",), ("pl2303",))
    assert (hub.ttys, arduino.ttys, arduino.bus) == ((), ("ttyACM0",), 2)


def test_a_machine_without_usb_has_no_devices(tmp_path):
    assert usb_devices(tmp_path / "none") == []


@pytest.mark.parametrize(
    ("usb_id", "chip"),
    [("067b:2303", "PL2303"), ("0403:6001", "FTDI"), ("10c4:ea60", "CP210x"), ("1a86:7523", "CH340")],
)
def test_an_adapter_without_a_node_is_a_problem_and_one_with_a_node_is_none(tree, usb_id, chip):
    tree.device("1-1", usb_id)
    tree.device("1-2", usb_id, tty="ttyUSB0", driver="any")
    (check,) = check_adapters(usb_devices(tree.usb))
    assert (check.name, check.state) == (f"{chip} adapter", PROBLEM)
    assert "port 1-1 has no" in check.found and "modprobe" in check.remedy


def test_other_devices_of_the_same_vendors_are_no_adapters(tree):
    tree.device("1-1", "0403:ffff")
    tree.device("1-2", "0ac8:3410")
    assert check_adapters(usb_devices(tree.usb)) == []


def test_lines_are_listed_with_their_chip_and_none_is_no_problem():
    lines = [
        SerialLine("/dev/ttyS0", "a port of the computer's own"),
        SerialLine("/dev/ttyUSB0", "FTDI x", "0403:6001"),
    ]
    checks = check_lines(lines)
    assert [check.state for check in checks] == [OK, OK]
    assert (checks[1].name, checks[1].found) == ("serial line /dev/ttyUSB0", "FTDI x (0403:6001)")
    assert [str(node) for node in nodes(lines)] == ["/dev/ttyUSB0"]
    assert [check.state for check in check_lines([])] == [NOT_THERE]


def test_the_lines_of_this_machine_have_names():
    assert all(line.device.startswith("/dev/") and line.about for line in serial_lines())
