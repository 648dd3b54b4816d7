"""run.toml: what made a run folder, so that it can be looked at and repeated."""

from dataclasses import dataclass, field, replace
from datetime import datetime, timezone
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from .described import Doc, check_fields
from .digests import RUN_NAME, digest_of
from .errors import ConfigError, InvalidInputError
from .tomlfile import load_config, save_config

if TYPE_CHECKING:
    from .observation import Recording
    from .recording import FileRecording

NAME = RUN_NAME
N_TOPICS = 5
POSES = ("odometry", "truth", "standing")
OUTSIDE = "outside"
"""The kind of what belongs to the recording and does not lie in its path."""
INPUTS = ("recording", OUTSIDE, "calibration", "data", "pairs", "network", "weights")
SHA256 = "SHA-256; of more than 512 MB every n-th block stands for the whole."


@dataclass(frozen=True)
class RunInput:
    """Something else that a run read."""

    kind: Annotated[str, Doc("What it is to the program: the option that names it.", choices=INPUTS)]
    path: Annotated[str, Doc("Where it was.")]
    sha256: Annotated[str, Doc(SHA256)] = ""

    def __post_init__(self) -> None:
        check_fields(self)
        check_text(self.path)


def check_text(*texts: str) -> None:
    """Raise InvalidInputError for a text that no file in UTF-8 can hold: Python reads names of other bytes as such."""
    for text in texts:
        if text.encode(errors="ignore").decode() != text:
            raise InvalidInputError(f"{text!a} is no text in UTF-8, as run.toml must be: rename that file")


def _now() -> datetime:
    return datetime.now(timezone.utc).replace(microsecond=0)


@dataclass(frozen=True)
class RunRecord:
    """What was run. config.toml beside it holds the parameters. `stereogrid repeat` reads it, and runs it again."""

    program: Annotated[str, Doc("map, experiments corridor, hardware drive ...")]
    command: Annotated[str, Doc("As it was typed.")] = ""
    recording: Annotated[
        str, Doc("What was mapped: its whole path, or as seen from this folder where the run made it; empty: none.")
    ] = ""
    recording_sha256: Annotated[str, Doc(f"{SHA256} Empty where the run made it.")] = ""
    poses: Annotated[str, Doc("Odometry as the recording claims it, the truth, or one place.", choices=POSES)] = (
        "odometry"
    )
    start_s: Annotated[float, Doc("The part of the recording that was mapped, from here.", "s", least=0)] = 0.0
    end_s: Annotated[float | None, Doc("To here; not set: to its end.", "s", least=0)] = None
    stride: Annotated[int, Doc("Every so many observations.", least=1)] = 1
    topics: Annotated[
        tuple[str, ...],
        Doc("Where topics were given: of the pictures, left and right, their CameraInfo, the odometry; empty: found."),
    ] = ()
    mount: Annotated[str, Doc("Where the left lens on the robot was given: x,y,z[,pitch,yaw,roll] [m, deg].")] = ""
    score: Annotated[
        bool | None, Doc("Whether the map is scored against the recording's truth; not set: where that can be done.")
    ] = None
    matchers: Annotated[tuple[str, ...], Doc("Where only some matchers were asked for: these.")] = ()
    seed: Annotated[int | None, Doc("What all that is random was drawn with; config.toml has it too.")] = None
    config_sha256: Annotated[str, Doc("Of config.toml as the run wrote it.")] = ""
    started: Annotated[datetime, Doc("When, in UTC.")] = field(default_factory=_now)
    duration_s: Annotated[float, Doc("How long it took; 0: it has not ended.", "s", least=0)] = 0.0
    machine: Annotated[str, Doc("What it ran on.")] = ""
    versions: Annotated[dict[str, str], Doc("Of what the numbers depend on.")] = field(default_factory=dict)
    results: Annotated[
        dict[str, str], Doc("SHA-256 of the cells of each map, and of the numbers in each file of them, but for times.")
    ] = field(default_factory=dict)
    inputs: Annotated[tuple[RunInput, ...], Doc("What else was read.")] = ()

    def __post_init__(self) -> None:
        check_fields(self)
        check_text(self.program, self.recording, self.command, *self.topics, self.mount)
        if len(self.topics) not in (0, N_TOPICS):
            raise InvalidInputError(f"topics must be {N_TOPICS} texts or none, not {len(self.topics)}")

    @classmethod
    def of(cls, program: str, command: str = "", recording: Path | None = None, *, made: str = "") -> "RunRecord":
        """Of a program that begins now. recording: what it reads; made: the name of the one that it makes instead."""
        return cls(program, command, str(recording.resolve()) if recording else made)

    @classmethod
    def load(cls, run: Path) -> "RunRecord":
        """Of a run folder. Raises ConfigError for a folder that is none."""
        if not (run / NAME).is_file():
            raise ConfigError(f"{run}: no run folder, or one of an older version: it has no {NAME}")
        return load_config(cls, run / NAME)

    def at(self, recording: Path) -> "RunRecord":
        """This, of the recording there."""
        return replace(self, recording=str(recording.resolve()))

    def anew(self, command: str) -> "RunRecord":
        """This, begun now by another command, with nothing come out of it yet."""
        given = tuple(each for each in self.inputs if each.kind == "calibration")
        return replace(self, command=command, started=_now(), duration_s=0.0, inputs=given, results={})

    def save(self, run: Path) -> None:
        """Into a run folder."""
        save_config(self, run / NAME)

    def reading(self, *paths: tuple[str, Path | None]) -> "RunRecord":
        """This, with other inputs (kind, path); None is left out."""
        more = tuple(RunInput(kind, str(path.resolve())) for kind, path in paths if path is not None)
        return replace(self, inputs=(*self.inputs, *more))

    def reading_once(self, *paths: tuple[str, Path]) -> "RunRecord":
        """The same, without what is an input already, of whatever kind."""
        known = {each.path for each in self.inputs}
        return self.reading(*(each for each in paths if str(each[1].resolve()) not in known))

    def with_digests(self) -> "RunRecord":
        """This, with the digests of all that is read from elsewhere."""
        made_here = not Path(self.recording).is_absolute()
        return replace(
            self,
            recording_sha256="" if made_here else digest_of(Path(self.recording)),
            inputs=tuple(replace(each, sha256=digest_of(Path(each.path))) for each in self.inputs),
        )

    def open_recording(self, run: Path) -> "FileRecording":
        """The part of the recording that the run in this folder was of. Raises RecordingError when it is not there."""
        from .recording import Given, open_recording

        if not self.recording:
            raise InvalidInputError(f"{run}: was made without a recording")
        calibration = next((Path(each.path) for each in self.inputs if each.kind == "calibration"), None)
        return open_recording(
            run / self.recording,
            start_s=self.start_s,
            end_s=self.end_s,
            stride=self.stride,
            given=Given.told(self.topics, calibration=calibration, mount=self.mount, standing=self.poses == "standing"),
        )

    def claiming(self, opened: "FileRecording") -> "Recording":
        """An opened recording, claiming the poses that the run took."""
        from .recording import TruePoses

        return TruePoses(opened) if self.poses == "truth" else opened
