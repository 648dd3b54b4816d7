"""RGB-D recordings as stereo ones: a virtual rig stands where the depth camera stood."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from ..errors import InvalidInputError, RecordingError
from ..geometry import R_BASE_OPTICAL, FloatArray, from_rotation, inverse
from ..observation import Image, Observation, Truth
from ..places import is_directory, is_file
from .file_recording import FileRecording, ObservationAt
from .images import image_size, read_bytes, read_grey
from .rgbd_files import RgbdFiles, RgbdFrame, Straightened, read_depth_m
from .rgbd_frames import PATTERN, is_frames, read_frames, upright
from .rgbd_tum import is_tum, read_tum_folder
from .track import odometry_track
from .virtual_rig import measured_disparity, right_view, sensor_sigma_px

BASELINE_M = 0.06
"""Of the virtual rig: a Minoru's."""
NEAREST_M = 0.5
"""What is nearer is white where depths stand in for colours."""


class RgbdRecording(FileRecording):
    """The frames of an RGB-D folder in TUM's or 7-Scenes' layout, pictures read as they are asked for.

    The left picture is the colour camera's, in grey; where there are no colours, the nearness of what is seen. The
    right picture is synthetic: the left one moved by the measured depths (virtual_rig.right_view), as a rig of
    baseline_m [m] and the depth camera's focal length would see it. `disparity` is what was measured, f b / z, with the
    sensor's noise, and with that of noise_px [px] drawn from seed and the frame's number. Colours and depths are taken
    to be registered, pixel by pixel. The depth image and the pose of the file are the truth, too: a reference
    instrument's, as far as matchers on the synthetic pairs go.

    The world of TUM's layout is the file's, z up; that of 7-Scenes' keeps the file's origin and is turned z up (see
    `upright`). `base` sits at the camera, so T_base_cam is a pure rotation.
    Raises RecordingError, naming the file and line, for what is missing or wrong; an image is checked when it is read.
    """

    has_disparity = True

    def __init__(
        self, folder: str | Path, *, baseline_m: float = BASELINE_M, noise_px: float = 0.0, seed: int = 0
    ) -> None:
        if not (np.isfinite(noise_px) and noise_px >= 0 and seed >= 0):
            raise InvalidInputError(f"noise_px and seed must be >= 0 and finite, not {noise_px} and {seed}")
        self.path, self._noise_px, self._seed = Path(folder), noise_px, seed
        place = _place(self.path)
        self._files: RgbdFiles = read_tum_folder(place) if is_tum(place) else read_frames(place)
        told_by = Path(self._files.lens.source)
        self.beside = (place, told_by) if is_file(told_by) else (place,)
        frames = self._files.frames
        self.left_out, self._has_colours = self._files.left_out, frames[0].colour is not None
        self.camera = self._files.lens.camera(baseline_m, self._files.shape)
        self._straight = Straightened(self._files.lens, self.camera)
        self.stamps_s = np.array([frame.stamp_ns / 10**9 for frame in frames])
        self.T_base_cam = from_rotation(R_BASE_OPTICAL)
        poses = np.stack([frame.T_world_cam for frame in frames])
        self.poses = poses if is_tum(place) else from_rotation(upright(poses)) @ poses
        self._odometry = odometry_track(self.poses @ inverse(self.T_base_cam))
        self.metadata = {"layout": self._files.layout, "intrinsics": self._files.lens.source}
        if self._has_colours:
            self._check_registered(frames[0])

    def notes(self) -> Iterator[str]:
        """What of it is measured and what is made."""
        sigma_px = np.hypot(sensor_sigma_px(self.camera), self._noise_px)
        yield (
            f"RGB-D as a virtual rig of {self.camera.baseline_m:g} m: disparities are measured depths (sigma "
            f"{sigma_px:.3f} px), right pictures are synthetic"
        )
        if not self._has_colours:
            yield "no colour images: left pictures show how near things are"
        if not self._files.lens.is_straight:
            yield "pictures and depths are straightened: the lens bends, or its pixels are not square"

    def true_poses(self) -> FloatArray | None:
        """The file's poses, which the recording claims as well."""
        return self.poses

    @contextmanager
    def _reading(self) -> Iterator[ObservationAt]:
        yield self._observation

    def _observation(self, number: int) -> Observation:
        frame, stamp_s = self._files.frames[number], float(self.stamps_s[number])
        depth_m = self._straight.depth_m(read_depth_m(frame.depth, self._files.shape, self._files.per_m))
        left = self._left(frame, depth_m)
        exact_px = self.camera.disparity_px(depth_m).astype(np.float32)
        rng = np.random.default_rng([self._seed, number])
        return Observation(
            stamp_s,
            left,
            right_view(left, exact_px),
            self._odometry[number],
            self.poses[number],
            Truth(self.poses[number], depth_m.astype(np.float32)),
            measured_disparity(self.camera, depth_m, self._noise_px, rng),
        )

    def _left(self, frame: RgbdFrame, depth_m: FloatArray) -> Image:
        if frame.colour is not None:
            return self._straight.colour(read_grey(frame.colour, self._files.shape))
        nearness = np.nan_to_num(NEAREST_M / depth_m)
        shown: Image = np.clip(255 * nearness, 0, 255).astype(np.uint8)
        return shown

    def _check_registered(self, frame: RgbdFrame) -> None:
        assert frame.colour is not None
        colour = image_size(read_bytes(frame.colour), str(frame.colour))
        if colour != self._files.shape:
            raise RecordingError(
                f"{frame.colour}: the colour image is {colour}, the depth image {self._files.shape} (height, width): "
                "they must be registered, pixel by pixel"
            )


def is_rgbd(path: Path) -> bool:
    """True for a folder in TUM's or 7-Scenes' layout, its rgb or depth folder, or a folder that holds such frames."""
    return path.is_dir() and bool(_holds(path) or _is_part_of_tum(path) or _children(path))


def _place(path: Path) -> Path:
    """Where the frames are that the user means by a path. Raises RecordingError when it could be several."""
    if _holds(path):
        return path
    if _is_part_of_tum(path):
        return path.resolve().parent
    children = _children(path)
    if not children:
        raise RecordingError(f"{path}: no RGB-D recording: neither rgb.txt and depth.txt nor {PATTERN}")
    if len(children) > 1 and path / "frames" not in children:
        names = ", ".join(child.name for child in children)
        raise RecordingError(f"{path}: holds several RGB-D recordings; choose from: {names}")
    return path / "frames" if len(children) > 1 else children[0]


def _holds(path: Path) -> bool:
    return is_tum(path) or is_frames(path)


def _is_part_of_tum(path: Path) -> bool:
    return path.resolve().name in ("rgb", "depth") and is_tum(path.resolve().parent)


def _children(path: Path) -> list[Path]:
    return sorted(child for child in path.iterdir() if is_directory(child) and _holds(child))
