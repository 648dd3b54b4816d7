"""What every recording in files offers, whatever its format."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path

from ..camera import StereoCamera
from ..errors import RecordingError, StereogridError
from ..geometry import FloatArray
from ..observation import Observation
from .ticks import Ticks

ObservationAt = Callable[[int], Observation]


class FileRecording(ABC):
    """A recording that knows its stamps and poses at once and decodes images when they are asked for.

    path; camera: the rectified pair; T_base_cam (4, 4); poses (M, 4, 4): the claimed T_world_cam; stamps_s (M,),
    increasing; metadata: what is known of the drive, as text; left_out: how many pictures, reports and pairs could not
    be used, by the reason; damage: what ended the reading early, None for a recording that reads to its end;
    has_disparity: whether the observations carry disparities of their own; beside: files and folders that it is made
    of besides `path`, some of which may lie in it.
    """

    path: Path
    camera: StereoCamera
    T_base_cam: FloatArray
    poses: FloatArray
    stamps_s: FloatArray
    metadata: Mapping[str, str]
    left_out: Mapping[str, int]
    damage: str | None = None
    has_disparity: bool = False
    beside: tuple[Path, ...] = ()

    def __repr__(self) -> str:
        length_s, camera = self.stamps_s[-1] - self.stamps_s[0], self.camera
        pairs = f"{len(self)} pairs of {camera.width_px} x {camera.height_px} px in {length_s:.1f} s"
        return f"{type(self).__name__}({str(self.path)!r}, {pairs})"

    def __len__(self) -> int:
        return len(self.stamps_s)

    def __iter__(self) -> Iterator[Observation]:
        return self.read(range(len(self)))

    def read(self, numbers: Iterable[int]) -> Iterator[Observation]:
        """The observations of these numbers, in this order; no other image is decoded."""
        with self._reading() as observation_at:
            for number in numbers:
                yield observation_at(number)

    @property
    def files_outside(self) -> tuple[Path, ...]:
        """Those of `beside` that do not lie in `path`: who takes `path` alone has not all."""
        return tuple(each for each in self.beside if not each.resolve().is_relative_to(self.path.resolve()))

    def notes(self) -> Iterator[str]:
        """What a user should know of it beyond the usual, a line each; `info` shows them."""
        yield from ()

    def true_poses(self) -> FloatArray | None:
        """True T_world_cam (M, 4, 4), NaN for an observation without one; None when there are none at all."""
        return None

    def truth_mesh_ply(self) -> bytes | None:
        """The PLY file of the true world's mesh; None when the recording carries none."""
        return None

    def mover_names(self) -> tuple[str, ...]:
        """The movers whose meshes the recording carries."""
        return ()

    def mover_mesh_ply(self, name: str) -> bytes | None:  # noqa: ARG002
        """The PLY file of a mover's mesh in its own frame; None when the recording carries none of that name."""
        return None

    def ticks(self) -> Ticks | None:
        """The robot's true motion between the observations, as a simulator knows it; None when nobody does."""
        return None

    @abstractmethod
    def _reading(self) -> AbstractContextManager[ObservationAt]:
        """Open what is needed to read observations by their numbers."""

    def _leave_out(self, what: str, count: int) -> None:
        """Count what could not be used."""
        if count:
            self.left_out = {**self.left_out, what: count}

    @contextmanager
    def _naming(self, what: str) -> Iterator[None]:
        """Turn whatever goes wrong into a RecordingError that names the recording and what was read."""
        try:
            yield
        except Exception as error:
            # Parsers of foreign bytes raise whatever they stumble on.
            fault = str(error) if isinstance(error, StereogridError) else f"cannot be decoded: {error!r}"
            # One that was named already is not named again.
            fault = fault.removeprefix(f"{self.path}: ")
            raise RecordingError(f"{self.path}: {what}: {fault}") from error
