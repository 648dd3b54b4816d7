"""How a learned stereo network wants its images, and where it leaves the disparity: a small TOML file.

weights = "crestereo_480x640.onnx"   # beside this file
output = "next_output"               # (1, 2, H, W): the disparity is channel 0
channel = 0
inputs = [
    { name = "init_left", image = "left", size = 0.5 },
    { name = "init_right", image = "right", size = 0.5 },
    { name = "next_left", image = "left" },
    { name = "next_right", image = "right" },
]
"""

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ..errors import InvalidInputError, unknown_name
from ..observation import FloatImage, Image

Tensor = NDArray[np.float32]
IMAGES = ("left", "right", "stacked")
LAYOUTS = ("NCHW", "NHWC")
ORDERS = ("rgb", "bgr")


SMALLEST, LARGEST = 1e-6, 1e6
"""Of what a network was trained with; float32 has no room for all that a text can say."""
MOST_PADDED_PX, MOST_PX = 1024, 16_384


def _within(numbers: tuple[float, ...], low: float) -> bool:
    return all(low <= number <= LARGEST for number in numbers)


@dataclass(frozen=True)
class NetworkInput:
    """One input: its name, the image it wants ("stacked": left and right, one after the other's channels), its size.

    size: a factor on height and width (CREStereo's first stage takes .5).
    """

    name: str
    image: str
    size: float = 1.0

    def __post_init__(self) -> None:
        if self.image not in IMAGES:
            raise unknown_name("image", self.image, IMAGES)
        if not 0 < self.size <= 1:
            raise InvalidInputError(f"size must be above 0 and at most 1, not {self.size}")


@dataclass(frozen=True)
class NetworkDescription:
    """weights: an ONNX file, relative to the description's folder. The rest is what the network was trained with.

    channels: 1 (grey) or 3 an image. A pixel becomes (grey * scale - mean) / std; mean and std are those of red, green
    and blue, one number serves for all; order: of the channels. pad_multiple: height and width are padded to multiples
    of it by repeating the last row and column. fixed_size: (height, width) that the images are resized to, and the
    disparity back with its values; empty: as they come. output: its name, that of the only one when empty; channel:
    of several; sign: of its disparity, +1 where near is large.
    """

    weights: str
    inputs: tuple[NetworkInput, ...]
    layout: str = "NCHW"
    channels: int = 3
    order: str = "rgb"
    scale: float = 1.0
    mean: tuple[float, ...] = (0.0,)
    std: tuple[float, ...] = (1.0,)
    pad_multiple: int = 1
    fixed_size: tuple[int, ...] = ()
    output: str = ""
    channel: int = 0
    sign: int = 1

    def __post_init__(self) -> None:
        for what, value, choices in (("layout", self.layout, LAYOUTS), ("order", self.order, ORDERS)):
            if value not in choices:
                raise unknown_name(what, value, choices)
        if {"left", "right"} - {side for each in self.inputs for side in _sides(each.image)}:
            raise InvalidInputError("inputs must show the network both images")
        for what, is_right, expected in self._rules():
            if not is_right:
                raise InvalidInputError(f"{what} must be {expected}, not {getattr(self, what)}")

    def _rules(self) -> tuple[tuple[str, bool, str], ...]:
        names, size = [each.name for each in self.inputs], self.fixed_size
        one_each = (1, self.channels)
        return (
            ("inputs", len(set(names)) == len(names), "named once each"),
            ("channels", self.channels in (1, 3), "1 or 3"),
            ("scale", SMALLEST <= self.scale <= LARGEST, f"{SMALLEST:g} to {LARGEST:g}"),
            ("mean", len(self.mean) in one_each and _within(self.mean, -LARGEST), "one finite number or one a channel"),
            ("std", len(self.std) in one_each and _within(self.std, SMALLEST), "positive, one number or one a channel"),
            ("pad_multiple", 1 <= self.pad_multiple <= MOST_PADDED_PX, f"1 to {MOST_PADDED_PX}"),
            ("fixed_size", len(size) in (0, 2) and all(0 < n <= MOST_PX for n in size), "[height, width]"),
            ("channel", self.channel >= 0, ">= 0"),
            ("sign", self.sign in (1, -1), "1 or -1"),
        )

    def feed(self, left: Image, right: Image) -> dict[str, Tensor]:
        """The tensor of each input for a pair (H, W) uint8."""
        images = {"left": self._fitted(left), "right": self._fitted(right)}
        return {
            each.name: self._laid_out(
                [self._channels(_resized(images[side], each.size)) for side in _sides(each.image)]
            )
            for each in self.inputs
        }

    def disparity(self, output: NDArray[Any], shape: tuple[int, int]) -> FloatImage:
        """The disparity (H, W) [px] of images of this shape, in the output for `feed`'s tensors.

        Raises InvalidInputError unless the output is one finite number a pixel and channel of what was fed.
        """
        rows, columns = (side + -side % self.pad_multiple for side in self.fixed_size or shape)
        field = self.sign * self._one_channel(np.asarray(output), (rows, columns))
        if not np.isfinite(field).all():
            raise InvalidInputError(f"{np.count_nonzero(~np.isfinite(field))} values of the output are not finite")
        if self.fixed_size:
            height, width = self.fixed_size
            # Back to the images' size first: the padding lies outside what was resized.
            field = cv2.resize(field[:height, :width], shape[::-1], interpolation=cv2.INTER_LINEAR) * shape[1] / width
        found: FloatImage = field[: shape[0], : shape[1]].astype(np.float32)
        return found

    def _fitted(self, image: Image) -> Image:
        if self.fixed_size:
            smaller = image.shape[0] * image.shape[1] > self.fixed_size[0] * self.fixed_size[1]
            way = cv2.INTER_AREA if smaller else cv2.INTER_LINEAR
            image = cv2.resize(image, self.fixed_size[::-1], interpolation=way)
        below, beyond = (-side % self.pad_multiple for side in image.shape)
        padded: Image = np.pad(image, ((0, below), (0, beyond)), mode="edge")
        return padded

    def _channels(self, image: Image) -> Tensor:
        """(channels, H, W)."""
        mean, std = (np.resize(np.array(v, np.float32), self.channels) for v in (self.mean, self.std))
        if self.order == "bgr":
            mean, std = mean[::-1], std[::-1]
        grey = image.astype(np.float32) * np.float32(self.scale)
        stack: Tensor = (grey - mean[:, None, None]) / std[:, None, None]
        return stack

    def _laid_out(self, images: list[Tensor]) -> Tensor:
        tensor = np.concatenate(images)[None]
        return np.ascontiguousarray(tensor if self.layout == "NCHW" else tensor.transpose(0, 2, 3, 1))

    def _one_channel(self, output: NDArray[Any], size: tuple[int, int]) -> NDArray[Any]:
        """The channel (H, W) of an output (H, W), (1, H, W), (1, C, H, W) or, in NHWC, (1, H, W, C)."""
        seen = output.shape
        if output.ndim == 4 and self.layout == "NHWC":
            output = output.transpose(0, 3, 1, 2)
        output = output.reshape((1,) * (4 - output.ndim) + output.shape)
        if output.ndim != 4 or output.shape[0] != 1 or output.shape[2:] != size or output.shape[1] <= self.channel:
            raise InvalidInputError(
                f"the output is {seen}; expected one image of {size[0]} rows and {size[1]} columns in {self.layout}, "
                f"with a channel {self.channel}"
            )
        field: NDArray[Any] = output[0, self.channel]
        return field


def _sides(image: str) -> tuple[str, ...]:
    return ("left", "right") if image == "stacked" else (image,)


def _resized(image: Image, size: float) -> Image:
    if size == 1:
        return image
    rows, columns = (max(1, round(side * size)) for side in image.shape)
    smaller: Image = cv2.resize(image, (columns, rows), interpolation=cv2.INTER_AREA)
    return smaller
