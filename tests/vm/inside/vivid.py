"""Two webcams of the kernel's driver vivid: real V4L2 nodes, drawn pictures."""

from pathlib import Path

from kernel_side import load, set_controls

DRIVER = Path("/sys/bus/platform/drivers/vivid")
NODES = Path("/sys/class/video4linux")
# Each camera a webcam with two nodes, for video and for metadata.
OPTIONS = ("n_devs=2", "node_types=0x20001,0x20001", "num_inputs=1,1", "input_types=0,0")
SIZE_PX, FPS = (320, 180), 30.0
"""vivid's webcams have no 320x240."""
WHITE, BLACK = 6, 5


class Vivid:
    """left, right: the names of the nodes that capture; the left camera sees white, the right one black."""

    def __init__(self) -> None:
        load("vivid", *OPTIONS)

    def renew(self) -> None:
        """Unplug and plug in both: every control is what it is at first."""
        self.unplug()
        self.plug()

    def unplug(self) -> None:
        """Both, unless they are: their nodes go."""
        if (DRIVER / "vivid.0").exists():
            (DRIVER / "unbind").write_text("vivid.0")

    def plug(self) -> None:
        (DRIVER / "bind").write_text("vivid.0")
        self.left, self.right = self._nodes("vid-cap")
        self.left_metadata, self.right_metadata = self._nodes("meta-cap")
        for node, pattern in ((self.left, WHITE), (self.right, BLACK)):
            # The counters in the picture make each one another, as a sensor's noise does. Stamps are vivid's start of
            # exposure, since its end of a frame is later than the frame comes.
            set_controls(node, test_pattern=pattern, osd_text_mode=1, timestamp_source=1)

    @staticmethod
    def _nodes(kind: str) -> tuple[str, str]:
        names = {(path / "name").read_text().strip(): path.name for path in NODES.glob("video*")}
        left, right = (f"/dev/{names[f'vivid-{camera}-{kind}']}" for camera in ("000", "001"))
        return left, right
