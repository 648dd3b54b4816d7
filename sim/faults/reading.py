"""A recording as faulty cameras give it."""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import cached_property

from stereogrid.camera import StereoCamera
from stereogrid.geometry import FloatArray
from stereogrid.observation import Image, Observation, Recording
from stereogrid.recording import KnowsMotion, Ticks, poses, stamps_s

from .kinds import CameraFaults
from .pair import FaultyPair
from .streams import LEFT, RIGHT, stream
from .timing import Shutters
from .tone import AutoExposure


class FaultyCameras:
    """A recording seen through faulty cameras: a Recording itself. Stamps, odometry and truth pass untouched.

    The faults of an observation depend on (seed, its index in the recording, side) and on nothing of the reader; a
    pair that is dropped has an index too. Automatic exposure and repeated pictures depend on the observations before
    as well, from the first one on. The stamp is that of the left picture's middle row.
    settled: the observations are places far apart, and automatic exposure has settled on each of them.
    Raises RecordingError when the faults need the robot's motion and the recording does not have it.
    """

    def __init__(self, recording: Recording, faults: CameraFaults, seed: int, *, settled: bool = False) -> None:
        self.camera: StereoCamera = recording.camera
        self.T_base_cam: FloatArray = recording.T_base_cam
        self._recording, self._faults, self._seed, self._settled = recording, faults, seed, settled
        self._pair = FaultyPair(recording.camera, faults, seed)
        self._shutters = Shutters.of(recording, faults, seed) if faults.needs_motion else None

    @property
    def metadata(self) -> Mapping[str, str]:
        """Those of the recording, if it has any."""
        return self._recording.metadata if isinstance(self._recording, KnowsMotion) else {}

    def ticks(self) -> Ticks | None:
        """The robot's true motion, if the recording knows it."""
        return self._recording.ticks() if isinstance(self._recording, KnowsMotion) else None

    @cached_property
    def poses(self) -> FloatArray:
        """The claimed T_world_cam (M, 4, 4), without taking pictures."""
        return poses(self._recording)[self._arrived]

    @cached_property
    def stamps_s(self) -> FloatArray:
        """The stamps (M,) [s], without taking pictures."""
        return stamps_s(self._recording)[self._arrived]

    def __len__(self) -> int:
        return len(self._arrived)

    @cached_property
    def _arrived(self) -> list[int]:
        return [index for index in range(len(self._recording)) if not self._is_dropped(index)]

    def __iter__(self) -> Iterator[Observation]:
        exposure = AutoExposure(self._faults.auto_exposure)
        before: tuple[Image, Image] | None = None
        for index, observation in enumerate(self._recording):
            if self._settled:
                exposure = AutoExposure(self._faults.auto_exposure)
            gains = exposure.gains((observation.left, observation.right), observation.stamp_s)
            if self._is_dropped(index):
                continue
            clean = (observation.left, observation.right)
            if self._shutters is not None:
                clean = self._shutters.pictures(observation)
            pair = self._pair.taken(clean, index, gains)
            stale = self._stale_side(index)
            if before is not None and stale is not None:
                pair = (before[LEFT], pair[RIGHT]) if stale == LEFT else (pair[LEFT], before[RIGHT])
            before = pair
            yield replace(observation, left=pair[LEFT], right=pair[RIGHT])

    def _is_dropped(self, index: int) -> bool:
        return bool(stream(self._seed, "drop", index).random() < self._faults.drop_share)

    def _stale_side(self, index: int) -> int | None:
        """Which camera hands out its last picture once more, if one does."""
        rng = stream(self._seed, "repeat", index)
        chance, side = rng.random(), int(rng.integers(2))
        return side if chance < self._faults.repeat_share else None
