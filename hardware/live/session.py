"""A drive from its first pair to its saved map. Whatever ends it: the robot is stopped first, and explained last."""

import signal
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from stereogrid.calibration import Rig
from stereogrid.config import MappingConfig
from stereogrid.errors import StereogridError
from stereogrid.interrupts import held_interrupts
from stereogrid.mapping_run import Mapped, Track, untracked
from stereogrid.viewer import LiveView

from ..cameras.pairs import StereoPairs
from ..clock import now_s
from ..pioneer.robot import RobotDriver
from ..recording import DriveRecorder
from .helm import HELP, Helm, Speeds
from .keyboard import Keyboard
from .mapping import LiveMapper
from .notes import Notes
from .saving import Saved, save_drive
from .screen import Screen
from .status import Status

LOOK_S = 0.2
"""How often the status is renewed, and the end thought of."""


@dataclass(frozen=True)
class DriveParts:
    """What takes part, opened and running. keys: None where nobody drives from here. notes: where the robot's driver
    puts its lines."""

    cameras: StereoPairs
    rig: Rig
    robot: RobotDriver
    notes: Notes
    keys: Keyboard | None = None
    recorder: DriveRecorder | None = None
    view: LiveView | None = None


@dataclass(frozen=True)
class DriveResult:
    """ended: why, in words; faults: what went otherwise than anybody wanted; saved: None where nothing was mapped;
    recorded: the recording, if there is one."""

    ended: str
    faults: tuple[str, ...]
    saved: Saved | None
    recorded: tuple[Path, ...] = ()


class DriveSession:
    """Maps, records and drives until the user, or trouble, ends it. patience_s: how long robot or cameras may be
    silent before it ends."""

    def __init__(self, parts: DriveParts, config: MappingConfig, speeds: Speeds, *, patience_s: float = 10.0) -> None:
        self._parts, self._config, self._patience_s = parts, config, patience_s
        self._pairs = parts.cameras.subscribe(2)
        shown = parts.view.show if parts.view else lambda *_: None
        self.mapper = LiveMapper(parts.rig, config, self._pairs, parts.robot, shown=shown)
        if parts.view:
            parts.view.watch(self.mapper.grid, self.mapper.lock)
        self._interrupted: Callable[[], bool] = lambda: False
        self.helm = Helm(
            parts.robot,
            parts.cameras,
            parts.keys,
            parts.notes,
            speeds=speeds,
            ready=self.mapper.warm.is_set,
            ending=lambda: self._interrupted(),
        )
        self._status = Status(parts.robot, parts.cameras, self.mapper)

    def run(self, *, runs: Path, out: Path | None, facts: dict[str, str], track: Track = untracked) -> DriveResult:
        """Drive; then stop and close the robot, and save. Interrupts, and a terminal that hangs up, only end it."""
        with held_interrupts(signal.SIGHUP) as self._interrupted:
            ended, fault = "", True
            try:
                ended, fault = self._drive()
            except Exception as error:  # the robot first: whatever it was is told below
                ended = f"{type(error).__name__}: {error}"
            finally:
                self._close_robot()
            mapped = self._close_rest()
            faults = [ended] if fault else []
            if self.mapper.ended:
                faults.append(f"mapping ended early: {self.mapper.ended}")
            recorder = self._parts.recorder.recorder if self._parts.recorder else None
            recorded = (recorder.path,) if recorder else ()
            if recorder and recorder.problem():
                faults.append(f"the recording ended early: {recorder.problem()}")
            if mapped is None:
                return DriveResult(ended, (*faults, "nothing was mapped"), None, recorded)
            facts = {**facts, "ended": ended, **self._counts()}
            place = recorder.path if recorder else None
            saved = save_drive(
                mapped, self._config, self.mapper, runs=runs, out=out, facts=facts, recorded=place, track=track
            )
            return DriveResult(ended, (*faults, *saved.faults), saved, recorded)

    def _drive(self) -> tuple[str, bool]:
        """Until something ends it: why, and whether that is a fault."""
        parts = self._parts
        self.mapper.start()
        self.helm.start()
        alive = _Alive(parts.robot, parts.cameras, self._patience_s)
        told = _Told(self.mapper, parts)
        with Screen() as screen:
            while True:
                told.look()
                screen.say(parts.notes.take())
                speed_mps = self.helm.speed_mps if parts.keys else None
                recorded = parts.recorder.line() if parts.recorder else ""
                line = self._status.line(speed_mps=speed_mps, recorded=recorded)
                screen.status(line, HELP if parts.keys else "Ctrl-C ends and saves")
                ending = self._ending() or alive.silence()
                if ending:
                    screen.say([*parts.notes.take(), "stopping"])
                    return ending
                self.helm.quit.wait(LOOK_S)

    def _ending(self) -> tuple[str, bool] | None:
        if self._interrupted():
            return "interrupted", False
        if self.helm.fault is not None:
            told = isinstance(self.helm.fault, StereogridError)
            return (str(self.helm.fault) if told else f"the helm failed: {self.helm.fault!r}"), True
        if self.helm.quit.is_set():
            return "quit", False
        return None

    def _close_robot(self) -> None:
        # The helm may hang in a terminal that another program has taken: nothing of it is waited for.
        self.helm.end()
        self._parts.robot.close()

    def _close_rest(self) -> Mapped | None:
        """The cameras, the recording and the mapper, in this order: what is still under way is small."""
        parts = self._parts
        mapped = self.mapper.finish()
        parts.cameras.close()
        if parts.recorder:
            parts.recorder.close()
        return mapped

    def _counts(self) -> dict[str, str]:
        counts, seen = self.mapper.counts, self._parts.cameras.counts
        return {
            "pairs": f"{seen.pairs} came, {counts.mapped} mapped; {self.mapper.dropped} dropped for lack of time, "
            f"{counts.stale} too old, {counts.unplaced} without odometry; before that {seen.skewed} skewed and "
            f"{seen.broken} broken ones",
            "mapping": self.mapper.ended or "to the end",
        }


class _Alive:
    """Who has been silent for too long."""

    def __init__(self, robot: RobotDriver, cameras: StereoPairs, patience_s: float) -> None:
        self._robot, self._cameras, self._patience_s = robot, cameras, patience_s
        self._start_s = now_s()

    def silence(self) -> tuple[str, bool] | None:
        """An ending, where it is time for one."""
        report, pair_s = self._robot.latest(), self._cameras.last_stamp_s()
        if now_s() - (report.stamp_s if report else self._start_s) > self._patience_s:
            why = self._robot.status().latched
            return f"the robot is silent for {self._patience_s:g} s" + (f" ({why})" if why else ""), True
        if now_s() - max(pair_s or 0.0, self._start_s) > self._patience_s:
            why = self._cameras.problem() or "no pair came"
            return f"the cameras are silent for {self._patience_s:g} s ({why})", True
        return None


class _Told:
    """Tells once of what changes only once."""

    def __init__(self, mapper: LiveMapper, parts: DriveParts) -> None:
        self._mapper, self._parts = mapper, parts
        self._said: set[str] = set()

    def look(self) -> None:
        """Note what is new."""
        mapper, recorder, view = self._mapper, self._parts.recorder, self._parts.view
        if mapper.warm.is_set():
            self._once("ready")
        if mapper.ended:
            self._once(f"mapping ended: {mapper.ended}; driving and recording go on, and the map so far is kept")
        if recorder and recorder.recorder.problem():
            self._once(f"the recording ended: {recorder.recorder.problem()}; driving and mapping go on")
        if view and view.fault:
            self._once(f"the view ended: {view.fault!r}; all else goes on")

    def _once(self, line: str) -> None:
        if line not in self._said:
            self._said.add(line)
            self._parts.notes.add(line)


def live_view(rig: Rig, config: MappingConfig, port: int) -> LiveView:
    """The view that suits the rig and the map. Raises MissingExtraError without viser."""
    height_m = rig.T_base_cam[2, 3] if rig.T_base_cam is not None else 0.4
    return LiveView(rig.camera, range_m=config.model.max_range_m, camera_height_m=float(height_m), port=port)
