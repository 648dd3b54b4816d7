"""The robot's two cameras while it is driven by a client: rendered in a thread of their own, as fast as they may."""

import threading
import time
from dataclasses import dataclass
from types import TracebackType

from stereogrid.errors import InvalidInputError
from stereogrid.geometry import FloatArray
from stereogrid.mjpeg import MjpegServer, jpeg

from ..rendering.render import Renderer
from ..rig import MINORU, StereoRig, mount, webcam
from ..scene.scene import World
from .senses import Body


@dataclass(frozen=True)
class EyeSettings:
    """port of the web server (0: any); the pictures' size [px] and how many pairs a second at most."""

    port: int
    width_px: int = 320
    height_px: int = 240
    fps: float = 15.0

    def __post_init__(self) -> None:
        if not 0 < self.fps <= 120:
            raise InvalidInputError(f"pictures a second must be more than 0 and at most 120, not {self.fps}")
        _ = self.rig

    @property
    def rig(self) -> StereoRig:
        """The Minoru's field of view at this size, on its usual stand."""
        return StereoRig(webcam(self.width_px, self.height_px), mount(baseline_m=MINORU.baseline_m))


class Eyes:
    """Publishes pictures of the world from where the body was last seen. Use as a context manager.

    `see` is told of the body after each of its ticks; it never waits. Pictures are stamped with the time of the tick
    that they show, on the clock of time.monotonic(). The server stays its owner's to close.
    """

    def __init__(self, world: World, settings: EyeSettings, body: Body, server: MjpegServer) -> None:
        self._rig = settings.rig
        self._period_s = 1 / settings.fps
        self._renderer = Renderer(world)
        self._server = server
        self._error: BaseException | None = None
        self.see(body)
        # The first picture compiles what draws it, which takes many seconds: not while the robot is driven.
        self._take()
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="eyes", daemon=True)
        self._thread.start()

    def __enter__(self) -> "Eyes":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stop.set()
        self._thread.join()

    def see(self, body: Body) -> None:
        """The body is here now. Raises what went wrong in the cameras' thread, if something did."""
        if self._error is not None:
            raise self._error
        self._seen: tuple[FloatArray, float, float] = body.T_world_base, body.time_s, time.monotonic()

    def _run(self) -> None:
        try:
            next_s = time.monotonic()
            while not self._stop.wait(max(next_s - time.monotonic(), 0.0)):
                # A machine that is too slow for the rate takes the next picture at once, and owes none.
                next_s = max(next_s + self._period_s, time.monotonic())
                self._take()
        except Exception as error:
            self._error = error

    def _take(self) -> None:
        T_world_base, time_s, stamp_s = self._seen
        left, right = self._rig.look(self._renderer, T_world_base, time_s=time_s)
        self._server.publish(jpeg(left.gray), jpeg(right), stamp_s)
