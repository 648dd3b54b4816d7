"""The controls beside the map, and what is chosen by them."""

import html
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from .cell_blocks import Box

AXES = ("x", "y", "z")
WHOLE = "none"
IMAGE, DISPARITY = "left image", "disparity"


@dataclass(frozen=True)
class Choices:
    """What the person at the page chose.

    Cells with a probability above threshold and centres within heights_m are drawn, in `colour`; of the sides of the
    slice plane, through slice_m [m] on axis slice_axis ("none": no plane), the lower one or the upper one is kept.
    """

    threshold: float = 0.6
    heights_m: tuple[float, float] = (-1.0, 1.4)
    colour: str = "height"
    slice_axis: str = WHOLE
    slice_m: float = 0.0
    keep_lower: bool = True
    map_name: str = ""
    number: int = 0
    picture: str = IMAGE
    frustums: bool = True
    truth_opacity: float = 0.0

    def box(self, cell_m: float) -> Box:
        """The cells of cell_m [m] that may be drawn."""
        low, high = np.full(3, -np.inf), np.full(3, np.inf)
        # By their centres: a limit is drawn or not drawn as a whole.
        low[2], high[2] = (each / cell_m - 0.5 for each in self.heights_m)
        if self.slice_axis != WHOLE:
            axis, at = AXES.index(self.slice_axis), self.slice_index(cell_m)
            if self.keep_lower:
                high[axis] = min(high[axis], at)
            else:
                low[axis] = max(low[axis], at + 1)
        return low, high

    def slice_index(self, cell_m: float) -> int:
        """Index along its axis of the cells that the slice plane runs through."""
        return int(np.floor(self.slice_m / cell_m + 1e-6))


@dataclass(frozen=True)
class Offers:
    """What a page lets one choose. ends_m (2, 3): lower and upper corner of what sliders reach [m]; heights_m and
    threshold: at first; maps: names, if there are several; observations: how many a recording has, 0 for none;
    rate: of the replay at first [observations/s]; None: there is none."""

    colours: Sequence[str]
    ends_m: Sequence[Sequence[float]]
    heights_m: tuple[float, float]
    threshold: float = 0.6
    maps: Sequence[str] = ()
    observations: int = 0
    rate: float | None = None
    truth: bool = False


class Controls:
    """Adds them to a viser server. changed is called, on a thread of the server, when one is moved."""

    def __init__(self, server: Any, offers: Offers, changed: Callable[[], None] = lambda: None) -> None:
        self._gui, self._offers = server.gui, offers
        self._changed = changed
        self._words = self._gui.add_html("")
        self._add_map()
        self._legend = self._gui.add_html("")
        if offers.observations:
            self._add_replay()
        self._add_slice()
        if offers.truth:
            self._truth = self._watched(
                self._gui.add_slider("true mesh: opacity", min=0.0, max=1.0, step=0.05, initial_value=0.0)
            )
        if offers.observations:
            self._add_cameras()
        self._missing = self._gui.add_html("")

    @property
    def choices(self) -> Choices:
        """As the controls stand now."""
        offers, seen = self._offers, bool(self._offers.observations)
        return Choices(
            threshold=float(self._threshold.value),
            heights_m=tuple(self._heights.value),
            colour=self._colour.value,
            slice_axis=self._axis.value,
            slice_m=self._slice.value,
            keep_lower=not self._other.value if self._axis.value == "z" else bool(self._other.value),
            map_name=self._map.value if len(offers.maps) > 1 else next(iter(offers.maps), ""),
            number=self.number.value - 1 if seen else 0,
            picture=self._picture.value if seen else IMAGE,
            frustums=self._frustums.value if seen else False,
            truth_opacity=self._truth.value if offers.truth else 0.0,
        )

    def say(self, *lines: str) -> None:
        """The status: lines of plain text."""
        _set(self._words, "content", plain_lines([line for line in lines if line]))

    def say_missing(self, lines: Sequence[str]) -> None:
        """What is not on the page, and why."""
        _set(
            self._missing,
            "content",
            plain_lines(["Not on this page:", *(f"- {line}" for line in lines)] if lines else []),
        )

    def show_legend(self, legend: str) -> None:
        """HTML."""
        _set(self._legend, "content", legend)

    def show_picture(self, picture: Any) -> None:
        """(H, W, 3) uint8, what the camera saw."""
        self._seen.image = picture
        _set(self._seen, "visible", True)

    def show_progress(self, share: float) -> None:
        """Of the replay, 0 to 1; it goes when all is done."""
        if share < 1:
            self.progress.value = 100 * share
        _set(self.progress, "visible", share < 1)

    def move_slice(self, to_m: float) -> None:
        """By the handle in the scene."""
        self._slice.value = float(np.clip(to_m, self._slice.min, self._slice.max))

    def reach_axis(self, axis: str) -> None:
        """Let the slider reach the map's ends along an axis."""
        low, high = (float(end[AXES.index(axis)]) for end in self._offers.ends_m)
        self._slice.min, self._slice.max = round(low, 2), round(max(high, low + 0.1), 2)
        self._slice.value = round((low + high) / 2, 2) if axis != "z" else round(min(1.0, (low + high) / 2), 2)

    def _watched(self, handle: Any) -> Any:
        handle.on_update(lambda _: self._changed())
        return handle

    def _add_map(self) -> None:
        gui, offers = self._gui, self._offers
        if len(offers.maps) > 1:
            self._map = self._watched(gui.add_dropdown("map", tuple(offers.maps)))
        self._colour = self._watched(gui.add_dropdown("colour by", tuple(offers.colours)))
        self._threshold = self._watched(
            gui.add_slider("cells with p above", min=0.5, max=0.99, step=0.01, initial_value=offers.threshold)
        )
        low, high = (float(end[2]) for end in offers.ends_m)
        low, high = np.floor(10 * low) / 10, np.ceil(10 * high) / 10 + 0.1
        first = tuple(float(np.clip(each, low, high)) for each in offers.heights_m)
        self._heights = self._watched(
            gui.add_multi_slider("heights [m]", min=low, max=high, step=0.1, initial_value=first)
        )

    def _add_slice(self) -> None:
        gui = self._gui
        self._axis = gui.add_dropdown("slice across", (WHOLE, *AXES), hint="A plane to drag, across this axis.")
        self._slice = self._watched(gui.add_slider("slice at [m]", min=-1.0, max=1.0, step=0.01, initial_value=0.0))
        self._other = self._watched(gui.add_checkbox("hide the other side", False))

        def choose(_: Any) -> None:
            there = self._axis.value != WHOLE
            self._slice.visible = self._other.visible = there
            if there:
                self.reach_axis(self._axis.value)
            self._changed()

        self._axis.on_update(choose)
        self._slice.visible = self._other.visible = False

    def _add_replay(self) -> None:
        gui, offers = self._gui, self._offers
        n = offers.observations
        self.number = self._watched(gui.add_slider("observation", min=1, max=max(n, 2), step=1, initial_value=n))
        if offers.rate is not None:
            self.play = gui.add_button("play", hint="The map as it grew.")
            most = float(max(100.0, np.ceil(offers.rate)))
            rate = float(np.clip(round(offers.rate), 1.0, most))
            self.rate = gui.add_slider("speed [observations/s]", min=1.0, max=most, step=1.0, initial_value=rate)
            self.progress = gui.add_progress_bar(0.0)

    def _add_cameras(self) -> None:
        gui = self._gui
        self._picture = self._watched(
            gui.add_dropdown("camera shows", (IMAGE, DISPARITY), hint="Disparity: light near, dark far, grey no match.")
        )
        self._seen = gui.add_image(np.full((2, 3, 3), 255, np.uint8), visible=False)
        self._frustums = self._watched(gui.add_checkbox("other cameras", True, hint="Click one to look from there."))


def plain_lines(lines: Sequence[str]) -> str:
    """HTML of lines that are shown as they are, though files of others may be where they come from."""
    text = "<br>".join(map(html.escape, lines))
    return f'<div style="font-size:0.875em;padding:0 0.75em 0.4em;line-height:1.45">{text}</div>' if text else ""


def _set(handle: Any, name: str, value: Any) -> None:
    """Only what is new is sent."""
    if getattr(handle, name) != value:
        setattr(handle, name, value)
