"""What `drive` and `record` open alike: a calibration, the cameras that it is of, a recording."""

from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from stereogrid.calibration import CalibrationFile, Rig, load_calibration
from stereogrid.errors import InvalidInputError, RecordingError
from stereogrid.files import check_writable

from ..cameras import StereoPairs, open_cameras
from ..errors import CameraError
from ..live.rig import parse_size, rig_of
from ..pioneer.robot import RobotDriver
from ..recording import DriveRecorder, RawRecorder, about_drive
from .options import command_line

SIZE_PX = (320, 240)


@dataclass(frozen=True)
class OpenedRig:
    """Running cameras, and what is known of them. calibration_toml: the calibration file's text, "" without one."""

    cameras: StereoPairs
    rig: Rig
    calibration_toml: str

    def record(self, path: Path, things: ExitStack, robot: RobotDriver | None, address: str) -> DriveRecorder:
        """A recording that runs until things are closed. address: the robot's. Raises RecordingError."""
        about = about_drive(command_line(), self.cameras, address, self.calibration_toml)
        raw = things.enter_context(RawRecorder(path, self.rig, metadata=about))
        return things.enter_context(DriveRecorder(raw, self.cameras, robot))


@dataclass(frozen=True)
class AskedRig:
    """What was asked for on the command line: `of` checks what can be checked before anything is opened."""

    camera: str
    mount: str
    fps: float
    swap: bool
    known: CalibrationFile | None
    calibration_toml: str
    size_px: tuple[int, int]
    size_is_asked: bool

    @classmethod
    def of(cls, camera: str, calibration: Path | None, mount: str, size: str, *, fps: float, swap: bool) -> "AskedRig":
        """Raises ConfigError or InvalidInputError."""
        known = load_calibration(calibration) if calibration else None
        text = calibration.read_text(encoding="utf-8") if calibration else ""
        size_px = parse_size(size) if size else known.calibration.size_px if known else SIZE_PX
        return cls(camera, mount, fps, swap, known, text, size_px, bool(size))

    def open(self, things: ExitStack, robot: RobotDriver | None = None) -> OpenedRig:
        """Open the cameras until things are closed. robot: whose turning bounds how far apart a pair may be taken."""

        def turn_radps() -> float:
            report = robot.latest() if robot is not None else None
            return report.turn_radps if report is not None else 0.0

        cameras = things.enter_context(
            open_cameras(
                self.camera,
                size_px=self.size_px,
                fps=self.fps,
                swap=self.swap,
                focal_px=self.known.camera.focal_px if self.known else None,
                turn_radps=turn_radps if robot is not None else None,
            )
        )
        if self.size_is_asked and cameras.size_px != self.size_px:
            raise CameraError(
                f"{cameras.name} gives {cameras.size_px[0]}x{cameras.size_px[1]}, whatever --size asks for: "
                "the size of network cameras is set where they are served"
            )
        return OpenedRig(cameras, rig_of(cameras, self.known, self.mount), self.calibration_toml)


def check_new(path: Path) -> None:
    """Raise RecordingError or InvalidInputError now where no new recording could be written to path."""
    if path.suffix.lower() != ".mcap":
        raise InvalidInputError(f"{path}: a recording is an MCAP file, so its name must end with .mcap")
    if path.exists():
        raise RecordingError(f"{path}: exists already; choose another path")
    check_writable(path)
