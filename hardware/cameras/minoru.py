"""What is special to the Minoru 3D: two cameras with USB ids of their own, on a hub of their own."""

from pathlib import Path

from ..errors import CameraError
from .discovery import DEV, SYSFS, Query, VideoDevice, find_cameras, listed
from .kernel import query_capabilities

IDS = ("0ac8:3410", "0ac8:3420")
"""0ac8:3420 is also a common single webcam: never a Minoru by its id alone."""
BASELINE_M = 0.06
SIZE_PX = (320, 240)
FPS = 30.0


def find_minoru(
    sysfs: Path = SYSFS, dev: Path = DEV, query: Query = query_capabilities
) -> tuple[VideoDevice, VideoDevice]:
    """The two cameras of the one Minoru that is plugged in: 0ac8:3410 and 0ac8:3420 on the same hub, in this order.

    Which of them is the left eye is not fixed: `swap` of open_cameras says so, and the calibration keeps it.
    Raises CameraError, with what was found and what to do.
    """
    cameras = find_cameras(sysfs, dev, query)
    rigs = [
        (first, second)
        for first in cameras
        for second in cameras
        if (first.usb_id, second.usb_id) == IDS and first.hub == second.hub
    ]
    if len(rigs) == 1:
        return rigs[0]
    if rigs:
        raise CameraError(
            f"{len(rigs)} Minorus could be meant: name the left and the right camera, --camera LEFT,RIGHT, by their "
            f"by-path names. {listed(cameras)}"
        )
    raise CameraError(f"no Minoru: {_missing(cameras)}. {listed(cameras)}")


def _missing(cameras: list[VideoDevice]) -> str:
    present = [each for each in IDS if any(camera.usb_id == each for camera in cameras)]
    if len(present) == 2:
        return f"{' and '.join(IDS)} are there, but not on the same hub, as a Minoru's two are"
    if present:
        other = IDS[1 - IDS.index(present[0])]
        return (
            f"{present[0]} is there, but not its twin {other} on the same hub: unplug the Minoru and plug it in again"
        )
    return f"neither {' nor '.join(IDS)} is there: plug it in (two cameras of another make: --camera LEFT,RIGHT)"
