"""Who lets commands through to the robot: light, in a thread of its own, whatever mapper and screen are doing."""

import threading
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass

from stereogrid.errors import StereogridError

from ..cameras.pairs import StereoPairs
from ..clock import now_s
from ..pioneer.robot import RobotDriver
from .deadman import DIRECTIONS, DeadMan
from .keyboard import Keyboard
from .mapping import STALE_PAIR_S
from .notes import Notes

PERIOD_S = 0.05
LATE_S = 0.3
"""Keys that waited longer than this to be read may have been let go since, and were pressed for what was then."""
WHATEVER_LATE = ("space", "escape", "e", "q")
STOP_AGAIN_S = 0.25
END_S = 1.0
SCALES = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0)
HELP = (
    "m motors on/off   w s a d or arrows drive while held   space stop   e emergency stop   r reset   "
    "+ - speed   q quit and save"
)


@dataclass(frozen=True)
class Speeds:
    """What a held key asks for at full scale."""

    speed_mps: float
    turn_radps: float


class Helm:
    """Passes motion on to the robot while keys are held, pairs are fresh and nothing is latched, and else stops it.

    keys: None where nobody drives from here. ready: false while the mapper warms up, when nothing may be armed.
    ending: true once the program is to end; then, and when this thread fails, the robot is stopped first.
    quit: set when the user wants to end, and when the terminal is gone.
    """

    def __init__(
        self,
        robot: RobotDriver,
        cameras: StereoPairs,
        keys: Keyboard | None,
        notes: Notes,
        *,
        speeds: Speeds,
        ready: Callable[[], bool],
        ending: Callable[[], bool] = lambda: False,
    ) -> None:
        self._robot, self._cameras, self._keys, self._notes = robot, cameras, keys, notes
        self._speeds, self._ready, self._ending = speeds, ready, ending
        self._held = DeadMan()
        self._scale = len(SCALES) - 1
        self._driving = False
        self._stopped_s = self._read_s = now_s()
        self._arming: threading.Thread | None = None
        self.quit = threading.Event()
        self.fault: BaseException | None = None
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="helm", daemon=True)

    def start(self) -> None:
        """Begin; what was typed before is forgotten."""
        if self._keys is not None:
            self._keys.flush()
        self._read_s = now_s()
        self._thread.start()

    def end(self) -> None:
        """Take no more keys; the robot is stopped as soon as the thread sees it."""
        self._stop.set()
        with suppress(StereogridError):
            self._robot.stop()
        if self._thread.ident is not None:
            self._thread.join(END_S)

    @property
    def scale(self) -> float:
        """The share of the full speeds that keys ask for."""
        return SCALES[self._scale]

    @property
    def speed_mps(self) -> float:
        """What a key that is held for ahead asks for."""
        return self.scale * self._speeds.speed_mps

    def fresh(self) -> bool:
        """Whether the newest pair is young enough to move by."""
        stamp_s = self._cameras.last_stamp_s()
        return stamp_s is not None and now_s() - stamp_s <= STALE_PAIR_S

    def _run(self) -> None:
        try:
            while not (self._stop.is_set() or self.quit.is_set() or self._ending()):
                self._listen()
                self._steer()
        except Exception as error:
            self.fault = error
        finally:
            # A driver that is dead cannot be told, and has told the robot itself.
            with suppress(StereogridError):
                self._robot.stop()
            self.quit.set()

    def _listen(self) -> None:
        if self._keys is None:
            self._stop.wait(PERIOD_S)
            return
        keys = self._keys.read(PERIOD_S)
        late = now_s() - self._read_s > LATE_S
        self._read_s = now_s()
        for key in keys:
            if key in WHATEVER_LATE or not late:
                self._obey(key)
            elif key not in DIRECTIONS:
                self._notes.add(f"the key {key} came late, in a moment when this machine was busy: press it again")
        if self._keys.gone:
            self._notes.add("the terminal is gone")
            self._held.release()
            self.quit.set()

    def _obey(self, key: str) -> None:
        if key in DIRECTIONS:
            self._held.press(key, now_s())
        elif key in _ORDERS:
            self._held.release()
            try:
                _ORDERS[key](self)
            except StereogridError as error:
                self._notes.add(str(error))
        elif key in ("+", "=", "-"):
            self._scale = min(max(self._scale + (-1 if key == "-" else 1), 0), len(SCALES) - 1)

    def _steer(self) -> None:
        """Let through what is held, or stop."""
        ahead, turn = self._held.direction(now_s())
        status = self._robot.status()
        wanted = bool(ahead or turn)
        hindrance = self._hindrance() if wanted or status.armed else ""
        if wanted and not hindrance and status.armed:
            self._drive(ahead * self._speeds.speed_mps, turn * self._speeds.turn_radps)
            return
        if wanted:
            self._notes.add(hindrance or "the motors are off: m switches them on")
        if self._driving or (hindrance and status.armed and now_s() - self._stopped_s > STOP_AGAIN_S):
            self._robot.stop()
            self._driving, self._stopped_s = False, now_s()

    def _hindrance(self) -> str:
        """Why nothing may move now; "" where it may."""
        latched = self._robot.status().latched
        if latched:
            return f"{latched}: r resets, then m"
        if not self._ready():
            return "not yet: the mapper warms up"
        if not self.fresh():
            return f"nothing moves without pictures: {self._cameras.problem() or 'the newest pair is too old'}"
        return ""

    def _drive(self, speed_mps: float, turn_radps: float) -> None:
        try:
            self._robot.drive(self.scale * speed_mps, self.scale * turn_radps)
            self._driving = True
        except StereogridError as error:
            # Latched in this very moment: the driver has stopped the robot.
            self._notes.add(str(error))

    def _order_quit(self) -> None:
        self._robot.stop()
        self.quit.set()

    def _order_stop(self) -> None:
        self._robot.stop()

    def _order_e_stop(self) -> None:
        self._robot.e_stop("the key e")

    def _order_reset(self) -> None:
        self._robot.reset()
        self._notes.add("reset; m switches the motors on")

    def _order_motors(self) -> None:
        if self._robot.status().armed:
            self._robot.disarm()
            self._notes.add("motors off")
            return
        hindrance = self._hindrance()
        if hindrance:
            self._notes.add(f"the motors stay off: {hindrance}")
        elif self._arming is None or not self._arming.is_alive():
            # It waits for the robot's answer, and the keys must not wait for that.
            self._arming = threading.Thread(target=self._arm, name="arming", daemon=True)
            self._arming.start()

    def _arm(self) -> None:
        try:
            self._robot.arm()
            self._notes.add("motors ON: the robot moves while a key is held")
        except StereogridError as error:
            self._notes.add(f"the motors stay off: {error}")


_ORDERS: dict[str, Callable[[Helm], None]] = {
    "q": Helm._order_quit,
    "m": Helm._order_motors,
    "e": Helm._order_e_stop,
    "r": Helm._order_reset,
    "space": Helm._order_stop,
    "escape": Helm._order_stop,
}
