"""The loop that ties body, firmware, link and clock together. One thread; nothing in it waits but for the next tick."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

from ..robot.pioneer import SimulationError
from .firmware import Firmware
from .links import CHUNK, Link, News
from .pacer import Pacer
from .senses import Body, Senses

TALK_S = 0.005
"""A tick spends this on what a client sends, and one poll more at most. What comes on top is lost unheard, as in a
serial port that is overrun: a flood delays neither the robot nor who comes next."""
MOST_POLLS = 256
SLIP_NOTE_S = 5.0
"""A machine that is too slow is told so at most this often [s, simulated]."""


@dataclass
class Loop:
    """A robot that is run and talked to. log: takes lines for the user. watch: called with the body after its ticks.

    Everything that the firmware knows of time, time_s, is a count of ticks: on a machine that is too slow the whole
    robot, watchdog and all, is slow.
    A body that falls is moved no more, and the talk goes on; once a client opens the robot anew, `renew` puts a new
    body in the place of the first one at its start. None: a fall ends the loop.
    """

    body: Body
    firmware: Firmware
    link: Link
    pacer: Pacer
    log: Callable[[str], None] = lambda _: None
    watch: Callable[[Body], None] = lambda _: None
    renew: Callable[[], Body] | None = None
    time_s: float = field(default=0.0, init=False)
    _lies: Senses | None = field(default=None, init=False)
    _noted_s: float = field(default=-SLIP_NOTE_S, init=False)
    _noted_slips: int = field(default=0, init=False)
    _overrun: int = field(default=0, init=False)

    def run(self, running: Callable[[], bool] = lambda: True) -> None:
        """Go on while running() is true. Raises SimulationError when the robot falls and none can take its place."""
        while running():
            self.step()

    def step(self) -> None:
        """Wait for the next ticks that are due, and do them."""
        due = self.pacer.wait()
        answers = self._listen()
        if self._lies and not self.firmware.has_fallen:
            self._stand_up()
        for _ in range(due):
            self.time_s += self.firmware.tick_s
            senses = self._lies or self._drive()
            answers.append(self.firmware.tick(senses, self.time_s))
            if self.firmware.report_due(self.time_s):
                # A robot that lies hears nothing.
                sonar_m = () if self._lies else self.body.sonar_m().tolist()
                answers.append(self.firmware.report(senses, sonar_m, self.time_s))
        for answer in answers:
            # One by one: what there is no room for shall not take a report with it.
            self.link.send(answer)
        if not self._lies:
            self.watch(self.body)
        self._note_slips()

    def _drive(self) -> Senses:
        """One tick of the body; what it felt, or felt last when it falls."""
        before = Senses.of(self.body)
        try:
            self.firmware.wheels.drive(self.body)
            return Senses.of(self.body)
        except SimulationError as error:
            if self.renew is None:
                raise
            self.log(f"{error}: it lies there until a client opens it anew")
        self.firmware.fall()
        self._lies = replace(before, left_mps=0.0, right_mps=0.0)
        return self._lies

    def _stand_up(self) -> None:
        if self.renew is not None:
            self.body, self._lies = self.renew(), None
            self.log("a new robot stands at the start")
            # The time that this took is not made up for.
            self.pacer.restart()

    def _listen(self) -> list[bytes]:
        answers = []
        end_s = self.pacer.now_s() + TALK_S
        for poll in range(MOST_POLLS):
            news = self.link.poll()
            size = len(news.data)
            # The first one is always heard: a machine that was late is no flood.
            if poll and self.pacer.now_s() > end_s:
                self._overrun += size
                news = replace(news, data=b"")
            answers.append(self._hear(news))
            if size < CHUNK:
                break
        return answers

    def _hear(self, news: News) -> bytes:
        for note in news.notes:
            self.log(note)
        if news.came:
            self.log("a client came")
        answer = self.firmware.receive(news.data, self.time_s)
        if news.left:
            self.firmware.hang_up()
            self.log(f"the client left; {self._summary()}")
        return answer

    def _summary(self) -> str:
        parser, counts = self.firmware.parser, self.firmware.counts
        return (
            f"so far {parser.good} packets, {parser.bad} bad ones, {parser.skipped} bytes of garbage, "
            f"{self._overrun} bytes too fast to be heard, "
            f"{counts.unknown} unknown and {counts.malformed} malformed commands"
        )

    def _note_slips(self) -> None:
        if self.pacer.slips == self._noted_slips or self.time_s < self._noted_s + SLIP_NOTE_S:
            return
        self._noted_slips, self._noted_s = self.pacer.slips, self.time_s
        self.log(f"this machine is late: simulated time is {self.pacer.lost_s:.1f} s behind ({self.pacer.slips} slips)")
