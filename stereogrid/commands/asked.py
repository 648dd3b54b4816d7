"""The recording that a command is asked to open: its path and the options that all such commands have."""

import inspect
from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_type_hints

import typer

from ..errors import InvalidInputError, RecordingError

if TYPE_CHECKING:
    from ..observation import Recording
    from ..recording import FileRecording
    from ..run_record import RunRecord


@dataclass(frozen=True)
class AskedRecording:
    """What was said on the command line. `asked_recording` gives its fields to a command as arguments and options."""

    recording: Annotated[Path, typer.Argument(help="A recording; docs/recordings.md tells the kinds.")]
    start: Annotated[float, typer.Option(help="Leave out what is before: seconds from its beginning.")] = 0.0
    end: Annotated[float | None, typer.Option(help="Leave out what is after: seconds from its beginning.")] = None
    stride: Annotated[int, typer.Option(help="Use every so many observations.")] = 1
    poses: Annotated[
        str, typer.Option(help="odometry (what the recording claims), truth, or standing (one place).")
    ] = "odometry"
    left_topic: Annotated[str, typer.Option(help="Of a ROS bag: where the left pictures are.  [found]")] = ""
    right_topic: Annotated[str, typer.Option(help="The right pictures.  [found]")] = ""
    left_info_topic: Annotated[str, typer.Option(help="The left CameraInfo.  [found]")] = ""
    right_info_topic: Annotated[str, typer.Option(help="The right CameraInfo.  [found]")] = ""
    odometry_topic: Annotated[str, typer.Option(help="An Odometry, poses, or /tf.  [found]")] = ""
    calibration: Annotated[
        Path | None, typer.Option(help="A rig.toml in place of what the recording says; its pictures are raw.")
    ] = None
    mount: Annotated[
        str, typer.Option(help="The left lens on the robot: x,y,z[,pitch,yaw,roll] [m, deg].  [the recording's]")
    ] = ""

    def record(self, program: str, command: str) -> "RunRecord":
        """What is to be said in the run.toml of a run on this recording. Raises InvalidInputError, naming the option,
        for one that cannot be."""
        from ..run_record import RunRecord

        self._check()
        topics = (self.left_topic, self.right_topic, self.left_info_topic, self.right_info_topic, self.odometry_topic)
        return RunRecord(
            program,
            command,
            str(self.recording.resolve()),
            poses=self.poses,
            start_s=self.start,
            end_s=self.end,
            stride=self.stride,
            topics=topics if any(topics) else (),
            mount=self.mount,
        ).reading(("calibration", self.calibration))

    def _check(self) -> None:
        from ..described import docs_of
        from ..run_record import RunRecord

        docs = docs_of(RunRecord)
        said = {"poses": self.poses, "start_s": self.start, "end_s": self.end, "stride": self.stride}
        for name, value in said.items():
            docs[name].check(value, f"--{name.removesuffix('_s')}")
        if self.end is not None and self.end < self.start:
            raise InvalidInputError(f"--end must not be before --start, as {self.end:g} s is before {self.start:g} s")

    def open(self) -> "FileRecording":
        """The recording, or the part that was asked for; `truth` changes nothing here: see `claiming`.

        Raises RecordingError, ConfigError or InvalidInputError when anything that was said is wrong.
        """
        from ..places import is_there

        if not is_there(self.recording):
            raise RecordingError(f"{str(self.recording)[:300]}: no such file or folder")
        return self.record("", "").open_recording(Path())

    def claiming(self, opened: "FileRecording") -> "Recording":
        """An opened recording, claiming the poses that were asked for."""
        return self.record("", "").claiming(opened)


def asked_recording(command: Callable[..., None]) -> Callable[..., None]:
    """A command for typer whose first parameter, `asked`, is made of the arguments and options of AskedRecording."""
    names = [each.name for each in fields(AskedRecording)]
    hints = get_type_hints(AskedRecording, include_extras=True)
    own = list(inspect.signature(command).parameters.values())[1:]
    shared = [
        parameter.replace(kind=inspect.Parameter.KEYWORD_ONLY, annotation=hints[parameter.name])
        for parameter in inspect.signature(AskedRecording).parameters.values()
    ]

    @wraps(command)
    def wrapper(**said: Any) -> None:
        command(AskedRecording(**{name: said.pop(name) for name in names}), **said)

    # The recording, what is the command's own, what all have.
    parameters = [shared[0], *(each.replace(kind=inspect.Parameter.KEYWORD_ONLY) for each in own), *shared[1:]]
    wrapper.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    wrapper.__annotations__ = {each.name: each.annotation for each in parameters}
    return wrapper
