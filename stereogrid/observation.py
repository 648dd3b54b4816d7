"""What flows through the house: readings, disparities, and the protocols of those who make them."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from .camera import StereoCamera
from .errors import InvalidInputError
from .geometry import FloatArray, as_pose, yaw_rad
from .thumbnails import disparity_picture, pair_picture, shown

Image = NDArray[np.uint8]
FloatImage = NDArray[np.float32]


@dataclass(frozen=True)
class Odometry:
    """Where the robot believes it is.

    T_odom_base: (4, 4); travelled_m and turned_rad: path length and sum of |turns| since the pose was
    last certain, which feed eps of Eq. 13.
    """

    T_odom_base: FloatArray
    travelled_m: float = 0.0
    turned_rad: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "T_odom_base", as_pose(self.T_odom_base, "T_odom_base"))
        if not (self.travelled_m >= 0 and self.turned_rad >= 0):
            raise InvalidInputError(
                f"travelled_m and turned_rad must be >= 0, not {self.travelled_m} and {self.turned_rad}"
            )

    def __repr__(self) -> str:
        heading_deg = np.degrees(yaw_rad(self.T_odom_base))
        return (
            f"Odometry({_place(self.T_odom_base)}, heading {heading_deg:.1f} deg; travelled {self.travelled_m:.3f} m, "
            f"turned {self.turned_rad:.3f} rad)"
        )


@dataclass(frozen=True)
class Truth:
    """What only a simulator or a reference instrument knows: T_world_cam (4, 4), depth_m (H, W) or None.

    movers: poses (4, 4) in world, by name, of the people and things that move; they are in no static mesh.
    """

    T_world_cam: FloatArray
    depth_m: FloatImage | None = None
    movers: Mapping[str, FloatArray] = field(default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "T_world_cam", as_pose(self.T_world_cam, "true T_world_cam"))

    def __repr__(self) -> str:
        depth = "" if self.depth_m is None else ", depth " + " x ".join(map(str, self.depth_m.shape)) + " [m]"
        movers = f", {len(self.movers)} movers" if self.movers else ""
        return f"Truth(camera at {_place(self.T_world_cam)}{depth}{movers})"


@dataclass(frozen=True)
class Observation:
    """One stereo reading: rectified images (H, W) uint8, odometry, and the left camera's claimed pose.

    T_world_cam (4, 4) is what the recording claims; truth, where known, is kept apart. disparity: what the recording
    itself measured, in place of a matcher's.
    """

    stamp_s: float
    left: Image
    right: Image
    odometry: Odometry
    T_world_cam: FloatArray
    truth: Truth | None = None
    disparity: "Disparity | None" = None

    def __post_init__(self) -> None:
        check_pair(self.left, self.right)
        if self.disparity is not None and self.disparity.disparity_px.shape != self.left.shape:
            raise InvalidInputError(
                f"the disparity is {self.disparity.disparity_px.shape}, the images are {self.left.shape}"
            )
        if not np.isfinite(self.stamp_s):
            raise InvalidInputError(f"stamp_s must be finite, not {self.stamp_s}")
        object.__setattr__(self, "T_world_cam", as_pose(self.T_world_cam, "T_world_cam"))

    def __repr__(self) -> str:
        extra = "".join(f", with {name}" for name in ("truth", "disparity") if getattr(self, name) is not None)
        size = f"{self.left.shape[1]} x {self.left.shape[0]} px"
        return f"Observation(at {self.stamp_s:.3f} s, pair of {size}, camera at {_place(self.T_world_cam)}{extra})"

    def _repr_html_(self) -> str:
        return shown(repr(self), pair_picture(self.left, self.right), "left and right image")


def _place(T: FloatArray) -> str:
    return "({:.3f}, {:.3f}, {:.3f}) m".format(*T[:3, 3])


def check_pair(left: NDArray[Any], right: NDArray[Any]) -> None:
    """Raise InvalidInputError unless both images are (H, W) uint8 of one size."""
    for side, image in (("left", left), ("right", right)):
        if not isinstance(image, np.ndarray) or image.ndim != 2 or image.dtype != np.uint8:
            seen = f"{getattr(image, 'shape', type(image).__name__)} {getattr(image, 'dtype', '')}".strip()
            colour = isinstance(image, np.ndarray) and image.ndim == 3 and image.shape[2] in (3, 4)
            hint = "; make it grey first, as by cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)" if colour else ""
            raise InvalidInputError(f"the {side} image must be (H, W) uint8, not {seen}{hint}")
    if left.shape != right.shape:
        raise InvalidInputError(f"left and right images differ in size: {left.shape} and {right.shape}")


@dataclass(frozen=True)
class Disparity:
    """disparity_px = x_left - x_right > 0 and its standard deviation sigma_px, (H, W) float32, NaN = no match.

    correlation_px: side [px] of the square of pixels whose errors go together: 1 = independent from pixel to pixel,
    inf = all the pixels on which a cell falls err together, so that an observation gives one look at a cell.
    """

    disparity_px: FloatImage
    sigma_px: FloatImage
    correlation_px: float = math.inf

    def __post_init__(self) -> None:
        if not self.correlation_px >= 1:
            raise InvalidInputError(f"correlation_px must be 1 to inf, not {self.correlation_px}")
        d = np.ascontiguousarray(self.disparity_px, dtype=np.float32)
        sigma = np.asarray(self.sigma_px, dtype=np.float32)
        if d.ndim != 2:
            raise InvalidInputError(f"disparity_px must be (H, W), not {d.shape}")
        if sigma.shape not in ((), d.shape):
            raise InvalidInputError(f"sigma_px must be one number or as disparity_px {d.shape}, not {sigma.shape}")
        sigma = np.ascontiguousarray(np.broadcast_to(sigma, d.shape))
        for name, array in (("disparity_px", d), ("sigma_px", sigma)):
            if np.isinf(array).any() or (array <= 0).any():
                raise InvalidInputError(f"{name} must be positive and finite, or NaN where nothing matched")
        if (np.isnan(sigma) & ~np.isnan(d)).any():
            raise InvalidInputError("sigma_px is NaN where disparity_px is not: a match needs both")
        object.__setattr__(self, "disparity_px", d)
        object.__setattr__(self, "sigma_px", sigma)

    def __repr__(self) -> str:
        height, width = self.disparity_px.shape
        if not self.valid.any():
            return f"Disparity({width} x {height} px, nothing matched)"
        low, high = np.nanmin(self.disparity_px), np.nanmax(self.disparity_px)
        return (
            f"Disparity({width} x {height} px, {100 * self.density:.0f} % matched: {low:.2f} to {high:.2f} px, "
            f"median sigma {np.nanmedian(self.sigma_px):.2f} px)"
        )

    def _repr_html_(self) -> str:
        caption = "disparity: near is yellow, far is dark blue, no match is white"
        return shown(repr(self), disparity_picture(self.disparity_px), caption)

    @property
    def valid(self) -> NDArray[np.bool_]:
        """(H, W) True where a match was found."""
        return ~np.isnan(self.disparity_px)

    @property
    def density(self) -> float:
        """Share of matched pixels, 0 to 1."""
        return float(self.valid.mean())


@runtime_checkable
class Matcher(Protocol):
    """Finds disparities. Implementations: stereogrid.matching.MATCHERS."""

    def match(self, left: Image, right: Image) -> Disparity:
        """The disparity of each pixel of the left image (H, W) uint8, NaN where no match is trusted."""
        ...


@runtime_checkable
class Source(Protocol):
    """Anything that yields observations in the order of their stamps: a recording, a simulator, the robot."""

    camera: StereoCamera
    T_base_cam: FloatArray

    def __iter__(self) -> Iterator[Observation]: ...


@runtime_checkable
class Recording(Source, Protocol):
    """A Source of known length that can be read again."""

    def __len__(self) -> int: ...
