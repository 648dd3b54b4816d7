"""Which two cameras a word means: a Minoru, two V4L2 cameras, web servers, video files."""

import math
import threading
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from stereogrid.errors import InvalidInputError

from ..errors import CameraError
from .controls import lock_controls
from .discovery import VideoDevice, find_camera
from .http import Address, get_json
from .live import LivePairs
from .minoru import find_minoru
from .mjpeg import MjpegCamera
from .pairing import SkewBound
from .v4l2 import V4l2Camera
from .videofiles import VideoPairs

SETTLE_S = 1.0
"""How long the automatics of exposure and white balance may look at the scene before they are switched off."""
CAMERA_JSON = "camera.json"
FORMS = (
    "minoru; LEFT,RIGHT of /dev/video0 or by-path names; http://host:port/ (left.mjpg and right.mjpg below it); two "
    "http:// URLs; two video files"
)


@dataclass(frozen=True)
class Wishes:
    """What is asked of the cameras; see open_cameras."""

    size_px: tuple[int, int] = (320, 240)
    fps: float = 30.0
    fourcc: str = ""
    swap: bool = False
    max_skew_s: float | None = None
    focal_px: float | None = None
    smear_px: float = 1.0
    turn_radps: Callable[[], float] | None = None
    lock: bool = True
    exposure_s: float | None = None
    at_pace: bool = True

    def __post_init__(self) -> None:
        if not (math.isfinite(self.fps) and self.fps > 0 and min(self.size_px) > 0):
            raise InvalidInputError(f"size_px and fps must be > 0, not {self.size_px} and {self.fps}")
        for name in ("max_skew_s", "focal_px", "exposure_s"):
            value = getattr(self, name)
            if value is not None and not (math.isfinite(value) and value > 0):
                raise InvalidInputError(f"{name} must be > 0, not {value}")
        if self.fourcc and len(self.fourcc) != 4:
            raise InvalidInputError(f"a fourcc has 4 letters, as YUYV or MJPG; not {self.fourcc!r}")

    def bound(self, width_px: int, period_s: float) -> SkewBound:
        """The bound of skew: half a period, and while turning what smear_px allows."""
        max_skew_s = self.max_skew_s if self.max_skew_s is not None else 0.5 * period_s
        return SkewBound(max_skew_s, self.focal_px or width_px, self.turn_radps, self.smear_px)


def open_cameras(
    spec: str,
    *,
    size_px: tuple[int, int] = (320, 240),
    fps: float = 30.0,
    fourcc: str = "",
    swap: bool = False,
    max_skew_s: float | None = None,
    focal_px: float | None = None,
    smear_px: float = 1.0,
    turn_radps: Callable[[], float] | None = None,
    lock: bool = True,
    exposure_s: float | None = None,
    at_pace: bool = True,
) -> LivePairs | VideoPairs:
    """Open two cameras: pairs.StereoPairs, and a context manager.

    spec: "minoru"; "/dev/video0,/dev/video2" or by-path names; "http://127.0.0.1:8102/", with left.mjpg, right.mjpg
    and perhaps camera.json below it (about["camera.json"]); "http://a/l.mjpg,http://b/r.mjpg"; "left.mp4,right.mp4".
    size_px, fps, fourcc: asked of V4L2 cameras; web servers and files have their own. swap: left is right.
    max_skew_s: of a pair; None: half a period. focal_px, smear_px, turn_radps: how much stricter while turning, see
    SkewBound; focal_px None: the width. lock: exposure and white balance stand still, with exposure_s if given.
    at_pace: files at their own rate.
    Raises CameraError with the remedy, InvalidInputError for a spec of no known form.
    """
    wishes = Wishes(
        size_px=size_px,
        fps=fps,
        fourcc=fourcc,
        swap=swap,
        max_skew_s=max_skew_s,
        focal_px=focal_px,
        smear_px=smear_px,
        turn_radps=turn_radps,
        lock=lock,
        exposure_s=exposure_s,
        at_pace=at_pace,
    )
    parts = [part.strip() for part in spec.split(",")]
    if parts == ["minoru"]:
        return _open_v4l2(find_minoru(), wishes)
    if parts[0].startswith("https://"):
        raise InvalidInputError("https:// cameras are not read: use http:// in a network of your own")
    if all(part.startswith("http://") for part in parts) and len(parts) <= 2:
        return _open_web(parts, wishes)
    if len(parts) != 2 or not all(parts):
        raise InvalidInputError(f"{spec!r} names no two cameras; give {FORMS}")
    if all(_is_device(part) for part in parts):
        return _open_v4l2((find_camera(parts[0]), find_camera(parts[1])), wishes)
    left, right = reversed(parts) if swap else parts
    return VideoPairs(Path(left), Path(right), fps=fps, at_pace=at_pace)


def _open_v4l2(devices: tuple[VideoDevice, VideoDevice], wishes: Wishes) -> LivePairs:
    if devices[0].node == devices[1].node:
        raise CameraError(f"{devices[0].node} cannot be both cameras: name the left one and the right one")
    first, second = reversed(devices) if wishes.swap else devices
    left, right = (
        V4l2Camera(device, side, size_px=wishes.size_px, fps=wishes.fps, fourcc=wishes.fourcc)
        for device, side in ((first, "left"), (second, "right"))
    )
    pairs = LivePairs(left, right, wishes.bound, wishes.fps)
    pairs.start()
    if wishes.lock:
        try:
            _lock(pairs, (left, right), wishes)
        except BaseException:
            pairs.close()
            raise
    return pairs


def _lock(pairs: LivePairs, cameras: tuple[V4l2Camera, V4l2Camera], wishes: Wishes) -> None:
    """Let the automatics settle, then switch them off; each camera sets the same again whenever it is reopened."""
    threading.Event().wait(SETTLE_S)
    period_s = max(camera.period_s or 1.0 / wishes.fps for camera in cameras)
    nodes = (cameras[0].device.node, cameras[1].device.node)
    chosen, pairs.about["controls"] = lock_controls(nodes, period_s, wishes.exposure_s)
    for camera in cameras:
        camera.controls = chosen


def _open_web(urls: list[str], wishes: Wishes) -> LivePairs:
    addresses = [Address.parse(url) for url in urls]
    base = addresses[0] if len(addresses) == 1 else None
    first, second = (base.below("left.mjpg"), base.below("right.mjpg")) if base is not None else addresses
    left, right = (second, first) if wishes.swap else (first, second)
    pairs = LivePairs(MjpegCamera(left, "left"), MjpegCamera(right, "right"), wishes.bound, wishes.fps)
    pairs.start()
    found = get_json(base.below(CAMERA_JSON)) if base is not None else None
    if found is not None:
        pairs.about[CAMERA_JSON] = found
    return pairs


def _is_device(name: str) -> bool:
    path = Path(name)
    return name.startswith("/dev/") or path.is_char_device()
