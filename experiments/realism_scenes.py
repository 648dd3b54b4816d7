"""Pairs to be measured alike: places along simulated drives, seen with each preset of the cameras, and real ones."""

import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from sim.faults import FaultyCameras, camera_faults
from sim.record import record_drive
from sim.worlds.world import make_world
from stereogrid.camera import StereoCamera
from stereogrid.geometry import FloatArray
from stereogrid.observation import Image, Observation, Recording
from stereogrid.recording import McapRecording, Subset, Ticks, open_recording

from .correlation_scenes import STATIC, STATIC_DISPARITIES, static_pairs
from .fusion_street import STREET
from .matched_pairs import at_most
from .pairs import Mask, open_pair, seen_by_both

SIMULATED_DISPARITIES = 80
STREET_DISPARITIES = 96
MOST_PIXELS = 400_000
"""Larger real pairs are shrunk: the simulated ones have 307 200."""
PAIRS = ("tsukuba", "venus", "teddy", "motorcycle", "aloe")
"""Folders of data/stereo."""


@dataclass(frozen=True)
class Scene:
    """A gray pair (H, W). place: the world or the data set; preset: of the cameras, "" of real ones.

    truth_px (H, W): the left image's true disparity, NaN = unknown, or None; visible: known and shown by both.
    """

    place: str
    preset: str
    left: Image
    right: Image
    num_disparities: int
    truth_px: FloatArray | None = None
    visible: Mask | None = None

    @property
    def is_real(self) -> bool:
        """Whether cameras took it."""
        return not self.preset


def simulated_scenes(
    world: str,
    presets: Sequence[str],
    *,
    seed: int,
    noise_seed: int,
    places: int,
    distance_m: float,
) -> list[Scene]:
    """Places spread over the first distance_m [m] of a drive (0: all of it), each seen with every preset."""
    length_m = make_world(world, seed).path_length_m
    with tempfile.TemporaryDirectory() as folder:
        path = record_drive(
            Path(folder) / "drive.mcap",
            world=world,
            seed=seed,
            every_m=min(distance_m or length_m, length_m) / places,
            max_distance_m=distance_m or None,
        )
        drive = McapRecording(path)
        chosen = Places(drive, spread(drive.true_poses()[:, :3, 3], places))
        return [
            _simulated(drive.camera, world, preset, each)
            for preset in presets
            for each in seen_apart(chosen, preset, noise_seed)
        ]


def seen_apart(places: Recording, preset: str, seed: int) -> FaultyCameras:
    """Places metres apart, as cameras see them that stay at each until their exposure has settled; none is lost."""
    faults = replace(camera_faults(preset), drop_share=0.0, repeat_share=0.0)
    return FaultyCameras(places, faults, seed, settled=True)


class Places:
    """Some observations of a drive, by number: some presets take each picture again, and the others are not wanted."""

    def __init__(self, drive: McapRecording, numbers: Sequence[int]) -> None:
        self.camera, self.T_base_cam, self.metadata = drive.camera, drive.T_base_cam, drive.metadata
        self._drive, self._numbers = drive, set(numbers)

    def __len__(self) -> int:
        return len(self._numbers)

    def __iter__(self) -> Iterator[Observation]:
        return (each for number, each in enumerate(self._drive) if number in self._numbers)

    def ticks(self) -> Ticks | None:
        """The robot's true motion."""
        return self._drive.ticks()


def spread(path_m: FloatArray, n: int) -> list[int]:
    """Which of the points (M, 3) of a path lie nearest to n places that divide its length evenly; M at most.

    Views are taken more densely in corners; all of them together would show little but walls.
    """
    stations_m = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path_m, axis=0), axis=1))])
    wanted_m = np.linspace(0.0, stations_m[-1], n)
    return sorted({int(np.argmin(np.abs(stations_m - station))) for station in wanted_m})


def _simulated(camera: StereoCamera, world: str, preset: str, seen: Observation) -> Scene:
    assert seen.truth is not None
    assert seen.truth.depth_m is not None
    depth_m = np.where(seen.truth.depth_m > 0, seen.truth.depth_m, np.nan)
    truth_px = camera.disparity_px(depth_m).astype(float)
    truth_px[truth_px == 0] = np.nan  # the sky
    visible = seen_by_both(truth_px)[0]
    return Scene(world, preset, seen.left, seen.right, SIMULATED_DISPARITIES, truth_px, visible)


def real_scenes(data: Path | None, places: int) -> tuple[list[Scene], list[str]]:
    """The real pairs and at most so many pairs of each sequence under data, and a sentence for each that is missing."""
    found, skipped = [], []
    sources: dict[str, Callable[[Path], Iterator[Scene]]] = {
        **{str(Path("stereo") / name): _pair for name in PAIRS},
        str(STREET): lambda place: _street(place, places),
        str(STATIC): lambda place: _still(place, places),
    }
    for where, read in sources.items():
        if data is not None and (data / where).is_dir():
            found += read(data / where)
        else:
            skipped.append(f"{where} was not under --data, and is left out.")
    return found, skipped


def _pair(place: Path) -> Iterator[Scene]:
    pair = at_most(open_pair(place), MOST_PIXELS)
    count = -(-pair.num_disparities // 16) * 16
    yield Scene(place.name, "", *pair.grey, count, pair.truth_px, pair.visible)


def _street(place: Path, places: int) -> Iterator[Scene]:
    street = open_recording(place)
    for each in Subset(street, stride=-(-len(street) // places)):
        yield Scene(place.name, "", each.left, each.right, STREET_DISPARITIES)


def _still(place: Path, places: int) -> Iterator[Scene]:
    pairs = static_pairs(place.parents[1])
    for left, right in pairs[:: -(-len(pairs) // places)]:
        yield Scene(place.name, "", left, right, STATIC_DISPARITIES)
