"""Cameras that take their pictures late, or row by row, see the world from where the robot then was."""

from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from time import sleep

import numpy as np
import pytest
from faults_scenes import CAMERA, FewObservations

pytest.importorskip("embreex")

from sim.faults import CameraFaults, FaultyCameras, timing
from sim.faults.shared import Shared
from sim.faults.timing import Shutters, skew_s
from sim.rendering.render import View
from sim.rig import StereoRig, mount
from stereogrid.camera import StereoCamera
from stereogrid.errors import RecordingError, StereogridError
from stereogrid.geometry import FloatArray, from_yaw, yaw_rad
from stereogrid.observation import Observation, Odometry
from stereogrid.recording import Ticks

SKEW = CameraFaults(time_skew_s=0.010)
ROLLING = CameraFaults(rolling_shutter_s=0.030)


@dataclass
class Notebook:
    """A photographer that writes down where it was sent, and gives blank pictures."""

    calls: list[tuple[str, FloatArray, float]] = field(default_factory=list)

    def view(self, camera: StereoCamera, T_world_cam: FloatArray, *, time_s: float = 0.0) -> View:
        return self._note("view", camera, T_world_cam, time_s)

    def view_rows(self, camera: StereoCamera, T_world_cam: FloatArray, *, time_s: float = 0.0) -> View:
        return self._note("rows", camera, T_world_cam, time_s)

    def _note(self, kind: str, camera: StereoCamera, T: FloatArray, time_s: float) -> View:
        self.calls.append((kind, T, time_s))
        shape = camera.shape
        return View(np.zeros(shape, np.uint8), np.zeros(shape, np.float32), np.zeros(shape, np.int32))


def turning(turn_radps: float = 0.5, speed_mps: float = 0.3) -> Ticks:
    """Ten seconds of turning on the spot, or along a straight line."""
    stamps = np.arange(301) / 30
    poses = [from_yaw(turn_radps * t, (speed_mps * t, 0, 0)) for t in stamps]
    return Ticks(stamps, np.stack(poses), np.zeros((301, 2)))


def shutters(faults: CameraFaults, ticks: Ticks, seed: int = 0) -> tuple[Shutters, Notebook]:
    notebook = Notebook()
    return Shutters(StereoRig(CAMERA, mount()), ticks, lambda: notebook, faults, seed), notebook


def at(stamp_s: float) -> Observation:
    image = np.full(CAMERA.shape, 77, np.uint8)
    return Observation(stamp_s, image, image, Odometry(np.eye(4)), np.eye(4))


def test_the_skew_drifts_through_its_whole_range_and_never_leaves_it() -> None:
    skews = np.array([skew_s(SKEW, 4, t) for t in np.arange(0, 60, 0.25)])
    assert np.abs(skews).max() <= 0.010
    assert np.histogram(skews, bins=5, range=(-0.01, 0.01))[0] == pytest.approx([48] * 5, abs=2)
    steps = np.diff(skews)
    assert (np.abs(steps) < 1e-4).sum() == len(steps) - 1
    assert skew_s(SKEW, 4, 1.0) != skew_s(SKEW, 5, 1.0)
    assert skew_s(CameraFaults(), 4, 1.0) == 0


def test_a_skewed_right_picture_is_taken_where_the_robot_is_then_and_the_left_one_stays() -> None:
    pair, notebook = shutters(SKEW, turning())
    left, _ = pair.pictures(at(5.0))
    assert (left == 77).all()
    ((kind, T_world_cam, time_s),) = notebook.calls
    late_s = skew_s(SKEW, 0, 5.0)
    assert kind == "view" and time_s == 5.0 + late_s
    rig = pair.rig
    expected = rig.right_of(from_yaw(0.5 * time_s, (0.3 * time_s, 0, 0)) @ rig.T_base_cam)
    assert T_world_cam == pytest.approx(expected, abs=1e-4)


def test_the_rows_of_a_rolling_shutter_are_seen_one_after_the_other_about_the_stamp() -> None:
    pair, notebook = shutters(ROLLING, turning(speed_mps=0.0))
    pair.pictures(at(5.0))
    assert [(kind, time_s) for kind, _, time_s in notebook.calls] == [("rows", 5.0)] * 2
    left = notebook.calls[0][1]
    assert left.shape == (48, 4, 4)
    headings = np.array([yaw_rad(T @ np.linalg.inv(mount())) for T in left])
    assert headings == pytest.approx(2.5 + 0.5 * 0.030 * np.linspace(-0.5, 0.5, 48), abs=1e-9)


def test_a_recording_without_motion_is_refused_in_one_line() -> None:
    with pytest.raises(RecordingError, match=r"time_skew_s need the robot's motion .* FewObservations has neither"):
        FaultyCameras(FewObservations(2), SKEW, 0)


class Told(FewObservations):
    """A recording that names its world, and knows of no ticks."""

    def __init__(self, metadata: dict[str, str]) -> None:
        super().__init__(2)
        self.metadata = metadata

    def ticks(self) -> Ticks | None:
        return None


@pytest.mark.parametrize(
    ("metadata", "reason"),
    [
        ({}, "do not name its world and seed"),
        ({"world": "corridor"}, "do not name its seed"),
        ({"world": "corridor", "seed": "0"}, "has no ticks: record the drive again"),
        (
            {"world": "corridor", "seed": "0", "renderer": "bullet"},
            "rolling_shutter_s need .* drawn by the renderer 'raster'; the recording is drawn by 'bullet'$",
        ),
    ],
)
def test_what_a_recording_lacks_is_named(metadata: dict[str, str], reason: str) -> None:
    with pytest.raises(RecordingError, match=reason):
        FaultyCameras(Told(metadata), ROLLING, 0)
    assert len(FaultyCameras(Told(metadata), CameraFaults(full_well_e=900.0), 0)) == 2


@pytest.mark.parametrize(
    ("metadata", "reason"),
    [
        ({"world": "maze", "seed": "0"}, "no world named 'maze'; choose from: .*corridor"),
        ({"world": "corridor", "seed": "x"}, "the seed 'x', not a whole number"),
    ],
)
def test_a_world_that_cannot_be_made_again_is_named(metadata: dict[str, str], reason: str) -> None:
    told = Told(metadata)
    told.ticks = turning  # type: ignore[method-assign]
    with pytest.raises(StereogridError, match=reason):
        FaultyCameras(told, SKEW, 0)


def test_a_renderer_is_made_once_for_all_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    made: Counter[str] = Counter()

    def slow_renderer(_: object) -> Notebook:
        made["renderers"] += 1
        sleep(0.1)
        return Notebook()

    monkeypatch.setattr(timing, "Renderer", slow_renderer)
    monkeypatch.setattr(timing, "_RENDERERS", Shared(2))
    monkeypatch.setattr(timing.WorldPlan, "make", lambda plan: plan)
    told = Told({"world": "corridor", "seed": "0", "renderer": "raster"})
    told.ticks = turning  # type: ignore[method-assign]
    arms = [Shutters.of(told, SKEW, seed) for seed in (0, 1)]
    with ThreadPoolExecutor(2) as pool:
        first, second = pool.map(lambda arm: arm.photographer(), arms)
    assert first is second and made["renderers"] == 1


def test_arms_that_read_side_by_side_take_each_picture_once() -> None:
    pair, notebook = shutters(ROLLING, turning())
    stamps_s = [0.5 * k for k in range(12)]
    with ThreadPoolExecutor(2) as pool:
        # Side by side, and not further apart than what is held, however late the machine lets one of them go on.
        seen = [picture for stamp_s in stamps_s for picture in pool.map(pair.pictures, [at(stamp_s), at(stamp_s)])]
    assert len(seen) == 24 and len(notebook.calls) == 24


def test_what_could_not_be_made_is_tried_again_and_the_oldest_is_forgotten() -> None:
    shared: Shared[int, str] = Shared(2)

    def fail() -> str:
        raise RecordingError("no light")

    with pytest.raises(RecordingError, match="no light"):
        shared.get(0, fail)
    assert [shared.get(key, lambda: "first") for key in (0, 1, 2)] == ["first"] * 3
    assert [shared.get(key, lambda: "again") for key in (2, 1, 0)] == ["first", "first", "again"]


@pytest.fixture(scope="module")
def turn_in_place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording of the corridor seen by a robot that turns on the spot: five pairs, 720 px of focal length."""
    from sim.rendering.render import Renderer
    from sim.worlds.world import make_world
    from stereogrid.recording import McapWriter

    camera = StereoCamera(720.0, 159.5, 119.5, 0.06, 320, 240)
    rig, renderer = StereoRig(camera, mount()), Renderer(make_world("corridor", 0))
    path, motion = tmp_path_factory.mktemp("turn") / "turn.mcap", turning(speed_mps=0.0)
    with McapWriter(path, camera, rig.T_base_cam, metadata={"world": "corridor", "seed": "0"}) as writer:
        for stamp_s, T_world_base, wheels in zip(motion.stamp_s, motion.T_world_base, motion.wheels_rad, strict=True):
            writer.write_tick(float(stamp_s), T_world_base, wheels)
        for stamp_s in (0.2, 0.4, 0.6, 0.8):
            T_world_base = motion.T_world_base_at(stamp_s)
            left, right = rig.look(renderer, T_world_base)
            writer.write(Observation(stamp_s, left.gray, right, Odometry(T_world_base), T_world_base @ rig.T_base_cam))
    return path


def shift_px(before: np.ndarray, after: np.ndarray) -> float:
    """How far a picture moved to the right [px], by the slope of brightness along its middle rows."""
    a, b = (image[40:200, 20:-20].astype(float) for image in (before, after))
    shifts = np.arange(-8, 9)
    cost = [np.abs(np.roll(a, s, axis=1) - b)[:, 20:-20].mean() for s in shifts]
    k = int(np.clip(np.argmin(cost), 1, len(shifts) - 2))
    low, mid, high = cost[k - 1 : k + 2]
    return float(shifts[k] + 0.5 * (low - high) / (low - 2 * mid + high))


def test_the_right_picture_of_a_turning_robot_is_shifted_by_focal_times_turn_times_skew(turn_in_place: Path) -> None:
    """.5 rad/s and 10 ms at 720 px are 3.6 px: turning left, what is seen later lies further right."""
    from stereogrid.recording import open_recording

    clean = open_recording(turn_in_place)
    skewed = FaultyCameras(clean, SKEW, seed=6)
    assert skewed.ticks() is not None and skewed.metadata["world"] == "corridor"
    for a, b in zip(clean, skewed, strict=True):
        assert np.array_equal(a.left, b.left) and a.stamp_s == b.stamp_s
        expected_px = 720 * 0.5 * skew_s(SKEW, 6, a.stamp_s)
        assert abs(expected_px) > 1
        assert shift_px(a.right, b.right) == pytest.approx(expected_px, abs=0.35)


def test_pictures_taken_again_without_delay_are_those_that_were_recorded(turn_in_place: Path) -> None:
    from stereogrid.recording import open_recording

    clean = open_recording(turn_in_place)
    for a, b in zip(clean, FaultyCameras(clean, CameraFaults(time_skew_s=1e-12), seed=0), strict=True):
        assert np.abs(a.right.astype(int) - b.right).max() <= 1


def test_a_rolling_shutter_shears_what_a_turning_robot_sees(turn_in_place: Path) -> None:
    """The last row is read 30 ms after the first: .015 rad, 10.8 px at 720 px; the middle row is where it was."""
    from stereogrid.recording import open_recording

    clean = open_recording(turn_in_place)
    first, sheared = next(iter(clean)), next(iter(FaultyCameras(clean, ROLLING, seed=0)))
    for rows, lean in (
        (slice(8, 24), -0.5 + 15.5 / 239),
        (slice(112, 128), 0.0),
        (slice(216, 232), -0.5 + 223.5 / 239),
    ):
        a, b = (np.repeat(image[rows], 15, axis=0) for image in (first.left, sheared.left))
        assert shift_px(a, b) == pytest.approx(720 * 0.5 * 0.030 * lean, abs=0.5)


def test_faults_of_time_belong_on_the_recording_itself(turn_in_place: Path) -> None:
    from stereogrid.recording import Subset, open_recording

    clean = open_recording(turn_in_place)
    with pytest.raises(RecordingError, match="Subset has neither: faults belong on the recording itself"):
        FaultyCameras(Subset(clean, 0, 1), SKEW, 0)
    assert len(Subset(FaultyCameras(clean, SKEW, 0), 0, 1)) == 1
