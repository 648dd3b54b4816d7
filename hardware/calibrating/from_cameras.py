"""A calibration from running cameras and a person with a chessboard."""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import Any

from stereogrid.calibration import CameraNames, Chessboard
from stereogrid.errors import InvalidInputError
from stereogrid.files import make_folder
from stereogrid.interrupts import held_interrupts

from ..cameras import StereoPairs
from .enter_key import EnterKey
from .from_files import Track, calibrate_pairs
from .live_session import LiveSession
from .outcome import Outcome
from .picture_files import find_pairs


def pictures_folder(report: Path) -> Path:
    """A new folder of its own for the pictures of a session, in that of the report."""
    folder = report / f"pictures-{datetime.now():%Y%m%d-%H%M%S}"
    make_folder(folder)
    return folder


def calibrate_live(
    cameras: StereoPairs,
    board: Chessboard,
    folder: Path,
    conclude: Callable[[Outcome], str],
    *,
    source: str,
    swap: bool,
    drop_far: bool,
    port: int,
    track: Track,
    say: Callable[[str], None],
) -> None:
    """Take pairs into a folder until there are enough, calibrate from them, and conclude: the page shows what it says.

    An interrupt ends it, and keeps the pairs; so does Enter or the page's button, which calibrate with what there is.
    """
    with LiveSession(cameras, board, folder, port=port, say=say) as live:
        say(f"open {live.url} in a browser on this machine, and show the board to the cameras; Enter ends it early")
        try:
            with held_interrupts() as interrupted:
                ending = live.run(interrupted, EnterKey().pressed)
        finally:
            _tell_kept(live.n_kept, folder, say)
        if ending.why == "interrupted":
            if ending.n:
                say(f"to calibrate from them: python -m hardware calibrate {folder}")
            raise KeyboardInterrupt
        if ending.why == "over":
            say(cameras.problem())
        names = CameraNames(source, swap, _named(cameras.about.get("left")), _named(cameras.about.get("right")))

        def work() -> str:
            if not ending.n:
                raise InvalidInputError("no pair was taken, so there is nothing to calibrate from")
            outcome = calibrate_pairs(find_pairs([folder]), board, drop_far=drop_far, track=track)
            return conclude(replace(outcome, cameras=names))

        live.conclude(work)


def _tell_kept(n: int, folder: Path, say: Callable[[str], None]) -> None:
    if n:
        say(f"{n} {'pair is' if n == 1 else 'pairs are'} kept in {folder}")
    else:
        with suppress(OSError):
            folder.rmdir()


def _named(about: Any) -> str:
    """Where a camera is, in its own words."""
    said = about if isinstance(about, dict) else {}
    return next((str(said[key]) for key in ("plug", "node", "url", "file") if said.get(key)), "")
