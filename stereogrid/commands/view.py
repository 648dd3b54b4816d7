"""`stereogrid view`."""

import os
import sys
import time
import webbrowser
from typing import TYPE_CHECKING, Annotated

import typer

from ..errors import InvalidInputError, StereogridError
from ..interrupts import held_interrupts, undisturbed
from ..loopback import HOST, LOCAL_NAMES
from ..screen import console, progress_console, warn_of
from .asked import AskedRecording, asked_recording
from .chosen import chosen_config
from .options import (
    CellOption,
    ConfigOption,
    DisparitiesOption,
    MatcherOption,
    MotionOption,
    NetworkOption,
    RangeOption,
    SetOption,
)

if TYPE_CHECKING:
    from ..viewer import MapPage, Subject

LOOK_S = 0.2


@asked_recording
def view_command(
    asked: AskedRecording,
    config: ConfigOption = None,
    matcher: MatcherOption = None,
    network: NetworkOption = None,
    num_disparities: DisparitiesOption = None,
    cell: CellOption = None,
    max_range: RangeOption = None,
    motion: MotionOption = None,
    settings: SetOption = None,
    port: Annotated[int, typer.Option(help="Of the page; the next free one where it is taken, 0 for any.")] = 8104,
    host: Annotated[str, typer.Option(help="Who may look: another one than this lets other machines in.")] = HOST,
    opens: Annotated[bool, typer.Option("--open/--no-open", help="Show the page in the browser.")] = True,
) -> None:
    """Show a run folder, a map (.sgrid, .bt, .ot) or a recording, which is mapped meanwhile, in the browser.

    Ctrl-C ends it. Needs the extra `view`.
    """
    with undisturbed():
        from ..viewer import MapPage, is_run, subject_of_map, subject_of_recording, subject_of_run
        from ..viewer.subject import MAP_SUFFIXES

    path = asked.recording
    if path.suffix in MAP_SUFFIXES or is_run(path):
        given = (config, matcher, network, num_disparities, cell, max_range, motion, settings or None)
        if given != (None,) * len(given) or asked != AskedRecording(path):
            raise InvalidInputError(f"{path} is mapped already: --config, --start and the like are for recordings")
        subject = subject_of_run(path) if path.is_dir() else subject_of_map(path)
    else:
        recording = asked.open()
        warn_of(recording)
        chosen = chosen_config(
            recording.camera,
            config,
            recording=recording,
            matcher=matcher,
            network=network,
            num_disparities=num_disparities,
            cell=cell,
            max_range=max_range,
            motion=motion,
            settings=settings,
        )
        subject = subject_of_recording(recording, chosen, asked.poses)
    _warn(host)
    with MapPage(subject, port=port, host=host) as page:
        _stay(page, subject, opens)


def _warn(host: str) -> None:
    if host not in LOCAL_NAMES:
        progress_console.print(
            f"warning: --host {host}: whoever reaches this machine can see the map and the pictures",
            highlight=False,
            soft_wrap=True,
        )


def _stay(page: "MapPage", subject: "Subject", opens: bool) -> None:
    """Until an interrupt, or the page fails."""
    with held_interrupts() as interrupted:
        console.print(page.url, highlight=False, soft_wrap=True)
        for line in subject.all_missing():
            console.print(f"not on the page: {line}", highlight=False, markup=False, soft_wrap=True)
        if opens and _has_screen():
            webbrowser.open(page.url)
        while not interrupted() and page.fault is None:
            time.sleep(LOOK_S)
    if page.fault is not None:
        raise (
            page.fault
            if isinstance(page.fault, StereogridError)
            else StereogridError(f"the page ended: {page.fault!r}")
        )
    progress_console.print("the page is closed")


def _has_screen() -> bool:
    """Whether a browser would open a window: without one it would open in this terminal."""
    return sys.platform != "linux" or bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
