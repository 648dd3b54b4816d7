"""The driver of a Pioneer: one thread that owns the link, hears the robot, and says what `Safety` decides."""

import atexit
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from itertools import chain, repeat

import arcos
from arcos import Code, Command, Sip
from stereogrid.observation import Odometry

from ..clock import now_s, slept_s
from ..errors import RobotError
from ..mailbox import Mailbox
from .handshake import Handshake, Session
from .limits import DEFAULT_LIMITS, Limits
from .link import Link, LinkError, open_link
from .odometry import Tracker
from .reports import Reports
from .robot import RobotReport, RobotStatus
from .safety import REST_S, Phase, Safety

TICK_S = 0.02
HALF_PACKET_S = 0.3
"""A packet of which no more has come for so long was none."""
FIRST_S = 1.0
GONE_S = 2.0
"""A robot that is silent for so long is connected to anew: it may have been switched off."""
WATCHDOG_MAX_MS = 3000
SLEPT_S = 0.2
BACK_OFF_S = (0.25, 0.5, 1.0, 2.0, 5.0)
CLOSE_S = REST_S + 2.0
FAREWELL = tuple(
    Command(code, argument).packet()
    for code, argument in ((Code.VEL, 0), (Code.RVEL, 0), (Code.ENABLE, 0), (Code.CLOSE, None))
)


class AnotherRobotError(RobotError):
    """Who answers after a cut is not who was driven."""


class Pioneer:
    """A RobotDriver in this process; also a context manager.

    Raises InvalidInputError for an address of no known form, RobotError when no robot answers there. log: told of what
    happens to the connection and of each latch, from a thread of its own. going: asked while it connects; once false
    it gives up. What holds this process's interpreter delays it: hardware.pioneer.connect does not have that weakness.
    """

    def __init__(
        self,
        address: str,
        *,
        limits: Limits = DEFAULT_LIMITS,
        log: Callable[[str], None] = lambda _: None,
        going: Callable[[], bool] = lambda: True,
    ) -> None:
        self._address, self._limits = address, limits
        self._lock = threading.Lock()
        self._changed = threading.Condition(self._lock)
        self._safety = Safety(limits)
        self._parser = arcos.PacketParser()
        self._reports = Reports()
        self._counts = {"reports": 0, "other_packets": 0, "broken_reports": 0, "reconnections": 0}
        self._closing = threading.Event()
        self._notes: Mailbox[str] = Mailbox(100)
        self._told_trouble = ""
        self._heard_s = self._byte_s = now_s()
        self._asleep_s = slept_s()
        self._quieten, self._met = True, False
        self._link, self.session = self._connect(going)
        self._tracker = Tracker(self.session.robot, limits.low_battery_v)
        self._met = True
        self._opened()
        self._note_watchdog()
        self._thread = threading.Thread(target=self._run, name="pioneer", daemon=True)
        threading.Thread(target=self._speak, args=(log,), name="pioneer log", daemon=True).start()
        self._thread.start()
        with self._changed:
            # So that who is given a driver has a report from it, too.
            self._changed.wait_for(lambda: self._counts["reports"] > 0, FIRST_S)
        # A program that just ends leaves no robot with its motors on.
        atexit.register(self.close)

    def __enter__(self) -> "Pioneer":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def arm(self, timeout_s: float = 2.0) -> None:
        """See RobotDriver."""
        with self._changed:
            self._safety.arm(now_s(), timeout_s)
            self._changed.wait_for(lambda: self._safety.phase is not Phase.ARMING, timeout_s + 1.0)
            if self._safety.phase is not Phase.ARMED:
                raise RobotError(f"the robot could not be armed: {self._safety.latched or self._safety.refused}")

    def disarm(self) -> None:
        """See RobotDriver."""
        with self._lock:
            self._safety.disarm(now_s())

    def drive(self, speed_mps: float, turn_radps: float, *, asked_s: float | None = None) -> None:
        """See RobotDriver; asked_s: when this was asked for, on hardware.clock, where that is not now."""
        with self._lock:
            now = now_s()
            self._safety.drive(speed_mps, turn_radps, now if asked_s is None else asked_s, now)

    def stop(self) -> None:
        """See RobotDriver."""
        with self._lock:
            self._safety.halt()

    def e_stop(self, reason: str = "asked for") -> None:
        """See RobotDriver."""
        with self._lock:
            self._safety.e_stop(reason, now_s())

    def reset(self) -> None:
        """See RobotDriver."""
        with self._lock:
            self._safety.reset(now_s())

    def latest(self) -> RobotReport | None:
        """See RobotDriver."""
        return self._reports.latest()

    def status(self) -> RobotStatus:
        """See RobotDriver."""
        with self._lock:
            safety = self._safety
            counts = {
                **self._counts,
                "bad_packets": self._parser.bad,
                "garbage_bytes": self._parser.skipped,
                "odometry_lost": self._tracker.lost,
                "stale_commands": safety.stale_commands,
            }
            connected = safety.phase is not Phase.AWAY and not safety.is_silent(now_s())
            return RobotStatus(connected, safety.phase is Phase.ARMED, safety.latched, counts)

    def odometry_at(self, stamp_s: float) -> Odometry | None:
        """See RobotDriver."""
        return self._reports.odometry_at(stamp_s)

    def subscribe(self, most: int = 64) -> Mailbox[RobotReport]:
        """See RobotDriver."""
        return self._reports.subscribe(most)

    def close(self) -> None:
        """See RobotDriver."""
        self._closing.set()
        self._thread.join(CLOSE_S)
        atexit.unregister(self.close)

    def _connect(self, going: Callable[[], bool]) -> tuple[Link, Session]:
        """A link and a session on it; a robot that hangs up on being closed is asked once more without that."""
        for last in (False, True):
            link = open_link(self._address)
            try:
                handshake = Handshake(link, self._parser, quieten=self._quieten, log=self._notes.put, going=going)
                return link, handshake.run()
            except LinkError as error:
                link.close(discard=True)
                # Only a robot that never was met may be one that hangs up on that: the one that was may be driving.
                if last or not going() or self._met:
                    raise RobotError(f"{error} while connecting: does another program drive the robot?") from error
                self._quieten = not self._quieten
            except BaseException:
                link.close(discard=True)
                raise
        raise AssertionError("unreachable")

    def _opened(self) -> None:
        self._heard_s = self._byte_s = now_s()
        limits = self._limits.within(self.session.robot, self.session.config)
        with self._changed:
            self._safety.opened(limits, self._heard_s)
        who = self.session.identity
        self._notes.put(f"connected to {who.name} ({who.subclass}) on {self._link.name}")

    def _note_watchdog(self) -> None:
        """The last net is the robot's own: who has none must know."""
        config = self.session.config
        if config is None:
            self._notes.put("whether the robot has a watchdog is not told: see that it stops when the cable is out")
        elif not 0 < config.watchdog_ms <= WATCHDOG_MAX_MS:
            self._notes.put(
                f"the robot's own watchdog is set to {config.watchdog_ms} ms: nothing stops it when the cable is cut"
            )

    # The thread

    def _run(self) -> None:
        try:
            while not self._closing.is_set():
                self._serve()
            self._farewell()
        except AnotherRobotError as error:
            with self._changed:
                self._safety.fault(str(error), now_s())
            self._notes.put(f"{error}: it is left alone, and this connection ends")
        except Exception as error:
            # A defect must not leave a robot driving; the firmware's watchdog is the second net.
            with self._changed:
                self._safety.fault(f"the driver failed ({error!r})", now_s())
            self._notes.put(f"the driver failed: {error!r}")
            with suppress(LinkError):
                self._send(FAREWELL)
        finally:
            self._lose("")
            self._link.close()
            self._reports.close()
            self._notes.close()

    def _serve(self) -> None:
        """Hear and speak, until it is closed or the link is cut; then connect again."""
        try:
            while not self._closing.is_set():
                self._turn()
        except (LinkError, OSError) as error:
            self._lose(str(error))
            self._come_back()

    def _turn(self) -> None:
        """One round: what came first, since it may forbid what would be said."""
        self._check_awake()
        self._listen()
        now = now_s()
        with self._changed:
            packets = [command.packet() for command in self._safety.tick(now)]
            self._changed.notify_all()
            news, self._safety.news = self._safety.news, []
        self._send(packets)
        for line in news:
            self._notes.put(line)

    def _check_awake(self) -> None:
        """hardware.clock stands still while the computer sleeps: a command of before is not young, only preserved."""
        asleep_s = slept_s()
        before_s, self._asleep_s = self._asleep_s, asleep_s
        if asleep_s - before_s > SLEPT_S:
            raise LinkError("this computer slept")

    def _send(self, packets: Sequence[bytes]) -> None:
        if packets:
            self._link.send(b"".join(packets))

    def _listen(self) -> None:
        data = self._link.receive(TICK_S)
        now = now_s()
        if data:
            self._byte_s = now
            bodies = self._parser.feed(data)
        else:
            bodies = self._parser.give_up() if now - self._byte_s > HALF_PACKET_S else []
        for body in bodies:
            self._hear(body, now)
        if now - self._heard_s > GONE_S:
            raise LinkError(f"the robot on {self._link.name} is silent")

    def _hear(self, body: bytes, now: float) -> None:
        if not Sip.is_sip(body):
            self._counts["other_packets"] += 1
            return
        try:
            sip = Sip.decode(body)
        except arcos.ArcosError:
            self._counts["broken_reports"] += 1
            return
        self._heard_s = now
        report = self._tracker.report(sip, now - self._link.byte_s * (len(body) + 5))
        with self._changed:
            self._counts["reports"] += 1
            self._safety.hear(report, now)
        self._reports.put(report)

    def _lose(self, reason: str) -> None:
        with self._changed:
            self._safety.lost()
            self._changed.notify_all()
        if reason:
            self._notes.put(f"{reason}: the robot is disarmed")

    def _come_back(self) -> None:
        """Connect again, however long it takes; nothing but latches is kept."""
        self._link.close(discard=True)
        for pause_s in chain(BACK_OFF_S, repeat(BACK_OFF_S[-1])):
            if self._closing.wait(pause_s) or self._try_again():
                return

    def _try_again(self) -> bool:
        try:
            link, session = self._connect(lambda: not self._closing.is_set())
        except (RobotError, OSError) as error:
            if str(error) != self._told_trouble:
                self._told_trouble = str(error)
                self._notes.put(f"trying to connect again: {error}")
            return False
        if session.identity != self.session.identity:
            link.close()
            raise AnotherRobotError(f"another robot answers: {session.identity.name} ({session.identity.subclass})")
        self._link, self.session = link, session
        self._tracker.reconnected()
        self._counts["reconnections"] += 1
        self._opened()
        return True

    def _farewell(self) -> None:
        """To rest, as far as that is soon, then off."""
        with self._changed:
            away = self._safety.phase is Phase.AWAY
            self._safety.disarm(now_s())
        if away:
            return
        try:
            end_s = time.monotonic() + REST_S
            while self._safety.phase is Phase.STOPPING and time.monotonic() < end_s:
                self._turn()
            self._send(FAREWELL)
        except (LinkError, OSError) as error:
            self._notes.put(f"{error}: the robot's own watchdog stops it")

    def _speak(self, log: Callable[[str], None]) -> None:
        while (note := self._notes.get(3600.0)) is not None:
            log(note)
