"""Pairs for a calibration from running cameras: a page shows a person what to do, good pairs are kept as files."""

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any

from stereogrid.calibration import Chessboard
from stereogrid.calibration.views import MIN_PAIRS
from stereogrid.camera import SIDES
from stereogrid.errors import StereogridError
from stereogrid.files import written_beside
from stereogrid.mjpeg import MjpegServer, jpeg
from stereogrid.recording.images import encode_png

from ..cameras.pairs import RawPair, StereoPairs
from .drawing import Drawing
from .page import PAGE
from .session import CalibrationSession
from .sight import Sight, look

PATIENCE_S = 0.25
"""Without a pair for so long the page says why."""
LINGER_S = 0.6
"""The page sees the result before its server goes."""


@dataclass(frozen=True)
class Ending:
    """n pairs were kept; why it ended: "complete", "asked" (the page's button, or the terminal), "interrupted",
    "over" (the cameras give no more)."""

    n: int
    why: str


class LiveSession:
    """Watches cameras until there are enough pairs. Use as a context manager, then `run` once.

    folder: is there, and gets left01.png, right01.png, ...; say: told a line of each event. The page stays until the
    end of the context, so that it can show the result: `conclude`.
    """

    def __init__(
        self, cameras: StereoPairs, board: Chessboard, folder: Path, *, port: int = 0, say: Callable[[str], None]
    ) -> None:
        self.session = CalibrationSession(board)
        self._cameras = cameras
        self._folder = folder
        self._say = say
        self._drawing = Drawing(self.session, cameras.size_px)
        self._status: dict[str, Any] = {}
        self._finish, self._forget = threading.Event(), threading.Event()
        self._number = self._n_kept = 0
        self._set_status("waiting for the cameras", "")
        self._server = MjpegServer(
            port,
            {},
            page=PAGE,
            status=lambda: self._status,
            buttons={"finish": self._finish.set, "forget": self._forget.set},
        )

    @property
    def url(self) -> str:
        """Of the page."""
        return self._server.url

    def __enter__(self) -> "LiveSession":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._server.close()

    @property
    def n_kept(self) -> int:
        """Pairs in the folder."""
        return self._n_kept

    def run(self, interrupted: Callable[[], bool], asked: Callable[[], bool]) -> Ending:
        """Take pairs until there are enough, or a person has it end."""
        mailbox = self._cameras.subscribe(most=1)
        while not self.session.complete:
            if interrupted():
                return self._end("interrupted")
            if self._finish.is_set() or asked():
                return self._end("asked")
            if self._forget.is_set():
                self._forget.clear()
                self._forget_last()
            pair = mailbox.newest(PATIENCE_S)
            if pair is not None:
                self._see(pair)
            elif mailbox.closed:
                return self._end("over")
            elif problem := self._cameras.problem():
                self._set_status(problem, "problem")
        return self._end("complete")

    def conclude(self, work: Callable[[], str]) -> None:
        """Do the work that makes a calibration of the pairs; the page shows the line that it returns, or its error."""
        try:
            self._tell("Done", work(), "taken")
        except StereogridError as error:
            self._tell("There is no calibration", str(error), "problem")
            raise
        finally:
            # The page asks more often than that.
            time.sleep(LINGER_S)

    def _tell(self, hint: str, told: str, kind: str) -> None:
        """Have the page say this from now on; kind: "taken" (good), "problem" or ""."""
        self._status = {**self._status, "hint": hint, "told": told, "kind": kind, "over": True}

    def _see(self, pair: RawPair) -> None:
        sight = look(pair, self.session.board)
        verdict = self.session.consider(sight)
        if verdict.taken:
            self._keep(pair)
        self._show(pair, sight)
        self._set_status(verdict.told, "" if verdict.kind == "nothing" else verdict.kind)
        if verdict.taken:
            self._say(f"pair {len(self.session.taken)} taken. {self.session.hint}")

    def _keep(self, pair: RawPair) -> None:
        """Raises InvalidInputError where the disk does not take it; there is no half of a pair then."""
        try:
            for side, image in zip(SIDES, (pair.left, pair.right), strict=True):
                with written_beside(self._path(side)) as path:
                    path.write_bytes(encode_png(image))
        except StereogridError:
            self._remove_last()
            raise
        self._n_kept += 1

    def _forget_last(self) -> None:
        if self.session.taken:
            self._remove_last()
            self._n_kept -= 1
            self.session.forget()
            self._say(f"the last pair is forgotten: {len(self.session.taken)} are left")

    def _remove_last(self) -> None:
        for side in SIDES:
            self._path(side).unlink(missing_ok=True)

    def _path(self, side: str) -> Path:
        return self._folder / f"{side}{len(self.session.taken):02d}.png"

    def _show(self, pair: RawPair, sight: Sight) -> None:
        left, right = self._drawing.draw((pair.left, pair.right), sight)
        self._server.publish(jpeg(left), jpeg(right), pair.stamp_s)
        self._number += 1

    def _set_status(self, told: str, kind: str) -> None:
        session = self.session
        self._status = {
            "hint": session.hint,
            "told": told,
            "kind": kind,
            "count": len(session.taken),
            "enough": len(session.taken) >= MIN_PAIRS,
            "folder": str(self._folder),
            "goals": [{"name": goal.name, "have": goal.have, "need": goal.need} for goal in session.goals],
            "number": self._number,
            "over": False,
        }

    def _end(self, why: str) -> Ending:
        self._tell("That is enough" if why == "complete" else "Ended", "calibrating ...", "")
        return Ending(len(self.session.taken), why)
