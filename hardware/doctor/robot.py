"""The robot: who answers, how well, and what would keep it from driving. It is never armed."""

import time
from dataclasses import dataclass

from stereogrid.checks import OK, PROBLEM, WARNING, Check, split_trouble
from stereogrid.errors import StereogridError

from ..pioneer.driver import Pioneer
from ..pioneer.handshake import Session
from ..pioneer.limits import DEFAULT_LIMITS
from ..pioneer.robot import RobotReport

LISTEN_S = 2.0
LEAST_REPORTS = 0.8
TIRED_V = 12.0
"""Lead batteries at rest that show less are more than half empty."""
CABLE = "a shorter or better cable; on a radio link, nearer to the robot"


@dataclass(frozen=True)
class Heard:
    """What a robot said in duration_s: the newest report, how many came, and packets that were broken."""

    session: Session
    report: RobotReport | None
    reports: int
    broken: int
    duration_s: float


def listen(address: str, duration_s: float = LISTEN_S) -> Heard:
    """Connect, listen for a while and close. Raises StereogridError where nothing can be heard."""
    with Pioneer(address) as robot:
        before = robot.status().counts
        start_s = time.monotonic()
        time.sleep(duration_s)
        after, lasted_s = robot.status().counts, time.monotonic() - start_s
        broken = after["bad_packets"] + after["broken_reports"]
        return Heard(robot.session, robot.latest(), after["reports"] - before["reports"], broken, lasted_s)


def check_robot(address: str, duration_s: float = LISTEN_S) -> list[Check]:
    """All checks of the robot at an address."""
    try:
        heard = listen(address, duration_s)
    except StereogridError as error:
        what, remedy = split_trouble(str(error), "--robot /dev/ttyUSB0, or --robot tcp:host:port")
        return [Check("robot", PROBLEM, what, remedy)]
    return judge(heard, address)


def judge(heard: Heard, address: str) -> list[Check]:
    """Checks of what was heard."""
    checks = [_identity(heard.session, address), _reports(heard)]
    if heard.report is None:
        return checks
    return [*checks, _battery(heard.report), _fault(heard.report)]


def _identity(session: Session, address: str) -> Check:
    who, config = session.identity, session.config
    found = f"{who.name or 'unnamed'}, a {who.robot_class} {who.subclass}, on {address}"
    values = {"name": who.name, "class": who.robot_class, "subclass": who.subclass}
    if config is None:
        remedy = "nothing to do: the driver's own limits hold, and a serial line stays at 9600 baud"
        return Check("robot", WARNING, f"{found}; it does not answer CONFIG", remedy, values)
    values |= {"version": config.version, "serial": config.serial, "watchdog_ms": str(config.watchdog_ms)}
    found += f", firmware {config.version or 'of no version'}, watchdog {config.watchdog_ms} ms"
    if config.watchdog_ms == 0:
        remedy = "set its watchdog to 2000 ms: without it a robot whose computer dies drives on"
        return Check("robot", PROBLEM, found, remedy, values)
    return Check("robot", OK, found, values=values)


def _reports(heard: Heard) -> Check:
    rate_hz = heard.reports / heard.duration_s
    config = heard.session.config
    usual_hz = 1000 / config.sip_cycle_ms if config is not None and config.sip_cycle_ms else 10.0
    found = f"{rate_hz:.1f} a second of {usual_hz:g}, {heard.broken} broken packets"
    values = {"rate_hz": rate_hz, "broken": heard.broken}
    if not heard.reports:
        return Check("robot reports", PROBLEM, "none came after the handshake", CABLE, values)
    if rate_hz < LEAST_REPORTS * usual_hz or heard.broken:
        return Check("robot reports", WARNING, found, CABLE, values)
    return Check("robot reports", OK, found, values=values)


def _battery(report: RobotReport) -> Check:
    volts, least = report.battery_v, DEFAULT_LIMITS.low_battery_v
    found, values = f"{volts:.1f} V", {"battery_v": volts}
    if volts < least:
        return Check("battery", PROBLEM, f"{found}, below {least:g} V: it will not be armed", "charge it", values)
    if volts < TIRED_V:
        return Check("battery", WARNING, f"{found}, soon below {least:g} V", "charge it before a long drive", values)
    return Check("battery", OK, found, values=values)


def _fault(report: RobotReport) -> Check:
    motors = "motors off" if not report.motors_on else "motors on"
    values = {"fault": report.fault, "motors_on": report.motors_on}
    if report.fault and not report.fault.startswith("battery"):
        remedy = "free it by hand: release the e-stop, and what touches a bumper or blocks a wheel"
        return Check("robot at rest", WARNING, f"{report.fault}: it will not be armed so", remedy, values)
    return Check("robot at rest", OK, f"{motors}, no bumper pressed, no stall, no e-stop", values=values)
