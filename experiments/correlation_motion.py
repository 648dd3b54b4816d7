"""How the error of one surface point goes on from one observation to the next: at rest, and as the camera moves."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from stereogrid.camera import StereoCamera
from stereogrid.geometry import FloatArray, inverse

from .correlation_length import LARGEST_ERROR
from .correlation_scenes import STATIC_DISPARITIES, ShortDrive, View, matched
from .pairs import seen_by_both
from .sigma_scenes import CORRIDOR_DISPARITIES

WITHIN_ONE = 0.6827
STEPS = (1, 2, 4, 8)
EVERY_PX = 3
"""Of so many rows and columns one is followed."""
SAME_SURFACE = 0.01
"""Depths that differ by less, as a share, are of one surface."""
MOTION_PX = (0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0)
MOVED_M = (0.01, 0.03, 0.06, 0.12, 0.2, 0.4, 0.8, 1.5, 3.0)
"""Bounds of the bins."""
FEWEST = 2000
"""Points in a bin, below which it says nothing."""
DECORRELATED = 0.3
"""1 / e is passed at once by matchers whose temporal share is large; .3 is just above what lasts."""
LASTING_PX = (16.0, 64.0)


@dataclass(frozen=True)
class Followed:
    """N surface points seen twice: errors (2, N) in sigmas, image motion_px (N), moved_m (N), first depth_m (N)."""

    errors: FloatArray
    motion_px: FloatArray
    moved_m: FloatArray
    depth_m: FloatArray

    @classmethod
    def joined(cls, parts: "Sequence[Followed]") -> "Followed":
        """All the points of the parts."""
        names = ("errors", "motion_px", "moved_m", "depth_m")
        return cls(*(np.concatenate([getattr(part, name) for part in parts], axis=-1) for name in names))

    def rho(self, among: FloatArray | None = None) -> float:
        """Correlation coefficient of the two errors; NaN of fewer than FEWEST points."""
        first, second = self.errors if among is None else self.errors[:, among]
        if first.size < FEWEST:
            return float("nan")
        return float((first @ second) / np.sqrt((first @ first) * (second @ second)))


@dataclass(frozen=True)
class Bin:
    """rho of the points whose motion is from least to most, of all and of the nearer and the farther half."""

    least: float
    most: float
    rho: float
    near: float
    far: float
    n: int

    @property
    def middle(self) -> float:
        """Geometric."""
        return float(np.sqrt(self.least * self.most))


@dataclass(frozen=True)
class Decorrelation:
    """rho at rest with other noise, and by image motion [px] and by distance moved [m]."""

    at_rest: float
    by_px: Sequence[Bin]
    by_m: Sequence[Bin]
    lasting_share: float

    @property
    def decorrelation_px(self) -> float:
        """The image motion of the first bin with rho below DECORRELATED; 0 when so at rest, inf when never."""
        if self.at_rest < DECORRELATED:
            return 0.0
        return next((each.middle for each in self.by_px if each.rho < DECORRELATED), float("inf"))

    def collapse(self) -> dict[str, float]:
        """How far apart (rms) near and far points are at one image motion, and at one distance."""
        found = {}
        for name, bins in (("px", self.by_px), ("m", self.by_m)):
            apart = [each.near - each.far for each in bins if np.isfinite(each.near + each.far)]
            found[name] = float(np.sqrt(np.mean(np.square(apart)))) if apart else float("nan")
        return found


def static_share(name: str, pairs: Sequence[tuple[FloatArray, FloatArray]], step: Callable[[], None]) -> float:
    """temporal_share of a matcher over pairs of a rig that stands still."""
    found = []
    for left, right in pairs:
        found.append(matched(name, left, right, STATIC_DISPARITIES))
        step()
    disparity_px, sigma_px = (np.stack(each).astype(float) for each in zip(*found, strict=True))
    return temporal_share(disparity_px, sigma_px)


def temporal_share(disparity_px: FloatArray, sigma_px: FloatArray) -> float:
    """Share of the error variance that changes over the frames (T, H, W), of pixels matched in all of them.

    sigma holds 68 % of the errors; what holds 68 % of the differences between frames half the sequence apart, over the
    root of two, is set against it: a few jumps to another surface count in neither.
    """
    half = len(disparity_px) // 2
    always = ~np.isnan(disparity_px).any(axis=0)
    d, sigma = disparity_px[:, always], np.median(sigma_px[:, always], axis=0)
    deviation = np.abs(d[half : 2 * half] - d[:half]) / (np.sqrt(2) * sigma)
    return float(min(np.quantile(deviation, WITHIN_ONE) ** 2, 1.0))


def decorrelation(name: str, drives: Sequence[ShortDrive], step: Callable[[], None]) -> Decorrelation:
    """How rho falls with motion, over all pairs of views of a drive that are one of STEPS apart."""
    rest, moved = [], []
    for drive in drives:
        errors = []
        for n, view in enumerate(drive.views):
            errors.append(view_errors(name, drive.camera, view))
            if n in drive.again:
                again = view_errors(name, drive.camera, drive.again[n])
                rest.append(follow(drive.camera, (view, drive.again[n]), (errors[n], again)))
            step()
        for apart in STEPS:
            for n in range(len(errors) - apart):
                both = (drive.views[n], drive.views[n + apart])
                moved.append(follow(drive.camera, both, (errors[n], errors[n + apart])))
    return summarised(Followed.joined(rest), Followed.joined(moved))


def summarised(rest: Followed, moved: Followed) -> Decorrelation:
    """The points' correlations in bins."""
    least, most = LASTING_PX
    lasting = moved.rho((moved.motion_px >= least) & (moved.motion_px < most))
    by_px, by_m = binned(moved, moved.motion_px, MOTION_PX), binned(moved, moved.moved_m, MOVED_M)
    return Decorrelation(rest.rho(), by_px, by_m, lasting)


def binned(points: Followed, by: FloatArray, bounds: Sequence[float]) -> list[Bin]:
    """Bins of the points between successive bounds, without those that hold fewer than FEWEST."""
    near = points.depth_m < np.median(points.depth_m)
    bins = []
    for least, most in pairwise(bounds):
        among = (by >= least) & (by < most)
        rho = [points.rho(among), points.rho(among & near), points.rho(among & ~near)]
        bins.append(Bin(least, most, *rho, int(among.sum())))
    return [each for each in bins if each.n >= FEWEST]


def view_errors(name: str, camera: StereoCamera, view: View) -> FloatArray:
    """(found - true) / sigma (H, W) of matched pixels that both images show, clipped, without the image's mean."""
    truth_px = camera.disparity_px(view.depth_m)
    disparity_px, sigma_px = matched(name, view.left, view.right, CORRIDOR_DISPARITIES)
    error = np.where(seen_by_both(truth_px)[0], (disparity_px - truth_px) / sigma_px, np.nan)
    clipped = np.clip(error, -LARGEST_ERROR, LARGEST_ERROR)
    return np.asarray(clipped - np.nanmean(clipped))


def follow(camera: StereoCamera, views: tuple[View, View], errors: tuple[FloatArray, FloatArray]) -> Followed:
    """The surface points with an error (H, W) in both views, found in the second by true depth and true poses."""
    first, second = views
    chosen = np.zeros(camera.shape, bool)
    chosen[::EVERY_PX, ::EVERY_PX] = True
    row, column = np.nonzero(chosen & ~np.isnan(errors[0]))
    T_second_first = inverse(second.T_world_cam) @ first.T_world_cam
    depth_m = first.depth_m[row, column]
    there = camera.ray_directions[row, column] * depth_m[:, None] @ T_second_first[:3, :3].T + T_second_first[:3, 3]
    ahead = there[:, 2] > 0.01
    row, column, depth_m, there = row[ahead], column[ahead], depth_m[ahead], there[ahead]
    at = camera.project(there)
    c, r = (np.rint(at[:, axis]).astype(int) for axis in (0, 1))
    inside = np.flatnonzero((c >= 0) & (c < camera.width_px) & (r >= 0) & (r < camera.height_px))
    error, seen_m = errors[1][r[inside], c[inside]], second.depth_m[r[inside], c[inside]]
    same = ~np.isnan(error) & (np.abs(seen_m - there[inside, 2]) < SAME_SURFACE * there[inside, 2])
    kept, error = inside[same], error[same]
    motion_px = np.hypot(at[kept, 0] - column[kept], at[kept, 1] - row[kept])
    moved_m = np.full(kept.size, np.linalg.norm(T_second_first[:3, 3]))
    return Followed(np.stack([errors[0][row[kept], column[kept]], error]), motion_px, moved_m, depth_m[kept])
