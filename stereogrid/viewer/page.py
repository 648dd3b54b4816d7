"""The page of `stereogrid view`: a map, how it grew, and what there is to hold it against."""

import threading
import time
from dataclasses import replace
from types import TracebackType
from typing import Any

import numpy as np

from ..loopback import HOST
from ..observation import Image
from .cells_drawn import Ages, draw_map, legend_of, legend_of_errors
from .controls import DISPARITY, Choices, Controls
from .judging import Judging, below
from .layout import CAMERAS, lay_out
from .moments import Moment, Moments
from .replay import Replay, picture_of, small
from .server import close_server, open_server, url_of
from .subject import Subject

LOOK_S = 0.3
"""How often what happens in the background is looked at."""
PLAY_S = 0.05


class MapPage:
    """A running page about a subject, drawn by a thread of its own. Use as a context manager.

    host: loopback unless the user asked for another; port: 0 for any, one that is taken gives way to the next.
    drawn: cells that are shown now; fault: what ended the drawing, None while all is well. Raises what opening a map
    raises, and MissingExtraError without viser.
    """

    def __init__(self, subject: Subject, *, port: int = 0, host: str = HOST) -> None:
        self.subject = subject
        self.replay = (
            Replay(subject.source, subject.config, makes_map=subject.replays)
            if subject.source is not None and subject.config is not None
            else None
        )
        self._moments = Moments(subject.maps, self.replay)
        first = self._moments.at(Choices(map_name=next(iter(subject.maps)))) if subject.maps else None
        self._judging = Judging(subject.recording)
        self._changed, self._stop = threading.Event(), threading.Event()
        self._sent: dict[str, Any] = {}
        self._played: tuple[float, int] | None = None
        self.drawn = 0
        self.fault: Exception | None = None
        self._server = open_server(port, subject.title, host)
        self._scene, offers = lay_out(self._server, subject, first.cells if first else None)
        self.controls = Controls(self._server, offers, self._changed.set)
        self._add_actions()
        self._thread = threading.Thread(target=self._run, name="page", daemon=True)
        self._thread.start()
        if self.replay is not None:
            self.replay.start()

    @property
    def url(self) -> str:
        """Of the page."""
        return url_of(self._server)

    def __enter__(self) -> "MapPage":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """The page goes, and what is still under way ends."""
        self._stop.set()
        self._changed.set()
        if self.replay is not None:
            self.replay.close()
        self._thread.join()
        close_server(self._server)

    def _add_actions(self) -> None:
        poses = self.subject.poses
        if len(poses):
            rows = np.unique(np.linspace(0, len(poses) - 1, min(CAMERAS, len(poses))).astype(int))
            rows = rows[np.isfinite(poses[rows]).all(axis=(1, 2))]
            self._scene.add_frustums(poses[rows], lambda row: self._go_to(int(rows[row])))
        if self._replays:
            self.controls.play.on_click(lambda _: self._play_or_pause())
        self.controls.say_missing(self.subject.all_missing())

    @property
    def _replays(self) -> bool:
        return self.replay is not None and self.replay.makes_map

    def _go_to(self, number: int) -> None:
        self.controls.number.value = number + 1
        self._changed.set()

    def _play_or_pause(self) -> None:
        if self._played is not None:
            self._played = None
        else:
            at = self.controls.choices.number
            self._played = time.monotonic(), 0 if at + 1 >= len(self.subject.poses) else at
        self.controls.play.label = "play" if self._played is None else "pause"
        self._changed.set()

    def _run(self) -> None:
        while not self._stop.is_set():
            self._changed.wait(PLAY_S if self._played else LOOK_S)
            self._changed.clear()
            if self._stop.is_set():
                return
            try:
                self._advance()
                self._draw(self.controls.choices)
            except Exception as error:
                self.fault = error
                self.controls.say(f"The page ended: {str(error) or repr(error)}")
                return

    def _advance(self) -> None:
        """Where it plays, on to the observation whose time has come."""
        if self._played is None:
            return
        start_s, first = self._played
        number = first + int((time.monotonic() - start_s) * self.controls.rate.value)
        if number + 1 >= len(self.subject.poses):
            number = len(self.subject.poses) - 1
            self._play_or_pause()
        if number != self.controls.choices.number:
            self.controls.number.value = number + 1

    def _draw(self, choices: Choices) -> None:
        moment = self._moments.at(choices)
        words = self._draw_cells(moment, choices)
        if len(self.subject.poses):
            self._draw_cameras(choices)
        self._draw_truth(choices)
        self.controls.say(words, *self._observation_words(moment, choices))

    def _draw_cells(self, moment: Moment | None, choices: Choices) -> str:
        """The line that says how many."""
        if moment is None:
            return "mapping begins"
        beside, errors = None, choices.colour == "errors"
        if errors:
            beside = self._judging.beside(moment.cells.cell_m, moment.range_m)
            if beside is None:
                return self._judging.fault or f"preparing the truth: {100 * self._judging.progress:.0f} %"
        # What does not change the cells must not have them sent again.
        cause = replace(choices, number=0, picture="", frustums=False, truth_opacity=0.0)
        if not self._is_new("cells", (moment.key, cause)):
            return str(self._sent["words"])
        blocks = moment.cells if errors else moment.drawn
        ages = self._ages(moment)
        shown = draw_map(self._scene, blocks, choices, dragged=self.controls.move_slice, ages=ages, beside=beside)
        errors_legend = legend_of_errors(shown.kinds, moment.range_m) if errors else ""
        self.controls.show_legend(errors_legend or legend_of(choices, ages))
        self.drawn, self._sent["words"] = shown.count, shown.words
        return shown.words

    def _draw_truth(self, choices: Choices) -> None:
        highest_m = choices.heights_m[1]
        if choices.truth_opacity > 0 and self._is_new("truth", highest_m):
            mesh = self._judging.mesh()
            if mesh is not None:
                self._scene.draw_truth(*below(mesh, highest_m))
        if self._is_new("opacity", (choices.truth_opacity, highest_m)):
            self._scene.fade_truth(choices.truth_opacity)

    def _ages(self, moment: Moment) -> Ages | None:
        if moment.number is None or self.replay is None:
            return None
        return Ages(self.replay.history.unit, moment.number // self.replay.history.unit)

    def _draw_cameras(self, choices: Choices) -> None:
        number, poses = choices.number, self.subject.poses
        if self._is_new("path", number):
            path_m = poses[:, :3, 3]
            self._scene.draw_path(_known(path_m[: number + 1]), _known(path_m[number:]))
        self._scene.show_frustums(choices.frustums)
        kept = self.replay.history.pictures(number) if self.replay is not None else None
        which = kept is not None and kept[0] == number
        if self._is_new("picture", (number, choices.picture, which or (kept and kept[0]))):
            picture = self._picture(number, choices.picture)
            if picture is not None and np.isfinite(poses[number]).all():
                self._scene.draw_view(picture, poses[number])
                self.controls.show_picture(picture)

    def _picture(self, number: int, what: str) -> Image | None:
        """RGB of an observation, or of the last one before of which the replay kept any."""
        kept = self.replay.history.pictures(number) if self.replay is not None else None
        if kept is not None and (kept[0] == number or what == DISPARITY):
            return picture_of(kept[1][what == DISPARITY])
        if self.subject.recording is None or what == DISPARITY:
            return None
        left = next(iter(self.subject.recording.read([number]))).left
        return np.repeat(small(left)[:, :, None], 3, axis=2)

    def _observation_words(self, moment: Moment | None, choices: Choices) -> list[str]:
        recording, replay = self.subject.recording, self.replay
        if recording is None:
            return []
        stamp_s, total = float(recording.stamps_s[choices.number]), len(self.subject.poses)
        lines = [f"observation {choices.number + 1} of {total}, stamp {stamp_s:.3f} s"]
        if replay is not None:
            lines += self._replay_words(replay, moment, choices)
        return lines

    def _replay_words(self, replay: Replay, moment: Moment | None, choices: Choices) -> list[str]:
        total = len(self.subject.poses)
        if self._replays:
            self.controls.show_progress(replay.done / total)
        if replay.fault:
            return [f"ended after observation {replay.done}: {replay.fault}"]
        lines = []
        if not replay.ended:
            lines.append(f"{'mapping' if replay.makes_map else 'pictures'}: {replay.done} of {total} done")
        if moment is not None and moment.number is not None and moment.number < choices.number:
            lines.append(f"the map is that of observation {moment.number + 1}")
        saved = set(self._moments.sha256.values())
        if replay.sha256 and self._replays and saved and replay.sha256 not in saved:
            lines.append("the replay ends in another map than the one saved: recording or program have changed since")
        if replay.history.every > 1:
            lines.append(f"kept: every {replay.history.every} observations")
        return lines

    def _is_new(self, what: str, value: Any) -> bool:
        if what in self._sent and self._sent[what] == value:
            return False
        self._sent[what] = value
        return True


def _known(path_m: Any) -> Any:
    return path_m[np.isfinite(path_m).all(axis=1)]
