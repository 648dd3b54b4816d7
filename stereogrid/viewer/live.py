"""A map that grows, in the browser, at little cost to who makes it."""

import threading
import time
from contextlib import AbstractContextManager, nullcontext
from types import TracebackType

import numpy as np

from ..camera import StereoCamera
from ..geometry import FloatArray
from ..grid import OccupancyGrid
from ..mapped import ABOVE_CAMERA_M
from ..observation import Image
from .cells_drawn import draw_map, legend_of
from .controls import Controls, Offers
from .scene import MapScene
from .server import close_server, open_server, url_of
from .snapshot import Snapshot

PERIOD_S = 0.5
MOST_SHARE = 0.1
"""Of one processor's time: where a map is so large that drawing it takes long, it is drawn less often."""
STEP_M = 0.02
"""The path is drawn in steps of at least this."""
HIGHEST_M = 4.0


class LiveView:
    """A page on this machine's loopback with a map, the camera's path and what it sees. Use as a context manager.

    camera: the rectified pair; range_m: how far it maps; camera_height_m: of the lenses over the ground, which says
    what to leave out as too high; port: 0 for any, one that is taken gives way to the next. `show` is told of each
    observation and never waits; a thread of its own draws twice a second at most. Raises MissingExtraError without
    viser.

    drawn: cells that are shown now; fault: what ended the drawing, None while all is well.
    """

    def __init__(
        self,
        camera: StereoCamera,
        *,
        range_m: float = 3.0,
        camera_height_m: float = 0.4,
        port: int = 0,
        title: str = "stereogrid",
    ) -> None:
        self._server = open_server(port, title)
        self._scene = MapScene(self._server, camera, fade_m=8 * range_m)
        self._scene.look_from(
            (-0.45 * range_m, -0.4 * range_m, 0.6 * range_m), look_at_m=(0.6 * range_m, 0.0, 0.1 * range_m)
        )
        ends_m = (-range_m, -range_m, -1.0), (2 * range_m, range_m, HIGHEST_M)
        heights_m = ends_m[0][2], round(camera_height_m + ABOVE_CAMERA_M, 1)
        self._controls = Controls(self._server, Offers(("height", "probability"), ends_m, heights_m))
        self._grid: OccupancyGrid | None = None
        self._lock: AbstractContextManager[object] = nullcontext()
        self._seen: tuple[Image, FloatArray] | None = None
        self._path_m: list[FloatArray] = []
        self._drawn: object = None
        self.drawn = 0
        self.fault: Exception | None = None
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="view", daemon=True)
        self._thread.start()

    @property
    def url(self) -> str:
        """Of the page."""
        return url_of(self._server)

    def __enter__(self) -> "LiveView":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def watch(self, grid: OccupancyGrid, lock: AbstractContextManager[object]) -> None:
        """Draw this map from now on; lock: who changes the map holds it meanwhile."""
        self._lock, self._grid = lock, grid

    def show(self, left: Image, T_world_cam: FloatArray) -> None:
        """The left image (H, W) that was just seen, and from where (4, 4)."""
        if not self._path_m or np.linalg.norm(T_world_cam[:3, 3] - self._path_m[-1]) > STEP_M:
            self._path_m.append(T_world_cam[:3, 3].copy())
        self._seen = left, T_world_cam

    def close(self) -> None:
        """The page goes."""
        self._stop.set()
        self._thread.join()
        close_server(self._server)

    def _run(self) -> None:
        rest_s = 0.0
        while not self._stop.wait(rest_s):
            start_s = time.monotonic()
            try:
                self._draw()
            except Exception as error:  # a view that fails must not fail what it looks at
                self.fault = error
                return
            took_s = time.monotonic() - start_s
            rest_s = max(PERIOD_S - took_s, took_s * (1 / MOST_SHARE - 1))

    def _draw(self) -> None:
        seen, grid = self._seen, self._grid
        if seen is not None:
            self._scene.draw_view(*seen)
            self._scene.draw_path(np.array(self._path_m))
        if grid is None:
            return
        choices = self._controls.choices
        with self._lock:
            snapshot = Snapshot.of(grid)
        blocks = snapshot.cells()
        drawn = choices, hash(blocks.values.tobytes())
        if drawn != self._drawn:
            shown = draw_map(self._scene, blocks, choices, dragged=self._controls.move_slice)
            self._controls.show_legend(legend_of(choices))
            self._controls.say(shown.words)
            self._drawn, self.drawn = drawn, shown.count
