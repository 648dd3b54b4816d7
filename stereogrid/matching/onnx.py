"""Learned stereo networks, run by onnxruntime (the extra `onnx`); the user brings the weights."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import ConfigError, InvalidInputError, MissingExtraError
from ..observation import Disparity, FloatImage, Image, check_pair
from ..places import is_file
from ..tomlfile import load_config
from .correlation import error_correlation_px
from .onnx_network import NetworkDescription
from .sigma import GENERIC, disparity_sigma_px

QUIET = 3
"""onnxruntime's log level for errors and worse."""


class OnnxMatcher:
    """`onnx`. The network that the TOML file `network` describes; see onnx_network for what stands in it.

    A network answers everywhere. What is left out (NaN): disparities that are not positive, exceed num_disparities, or
    point outside the right image; and, with left_right_px > 0, those that differ by more than this from the disparity
    found from the right image, for which the network runs twice. Sigma and correlation length are those of no matcher
    in particular.
    Raises MissingExtraError without onnxruntime, ConfigError or InvalidInputError naming the file that is wrong.
    """

    def __init__(self, *, network: str | Path = "", num_disparities: int = 64, left_right_px: float = 0.0) -> None:
        if not str(network):
            raise InvalidInputError("the matcher 'onnx' needs a network: the TOML file that describes it")
        if num_disparities <= 0:
            raise InvalidInputError(f"num_disparities must be positive, not {num_disparities}")
        if not (np.isfinite(left_right_px) and left_right_px >= 0):
            raise InvalidInputError(f"left_right_px must be finite and >= 0, not {left_right_px}")
        self.network, self.num_disparities, self.left_right_px = Path(network), num_disparities, left_right_px
        self._description = load_config(NetworkDescription, network)
        self._weights = self.network.parent / self._description.weights
        self._session = _session(self._weights)
        self._check_names()

    def __repr__(self) -> str:
        return f"OnnxMatcher(network={str(self.network)!r}, num_disparities={self.num_disparities})"

    def match(self, left: Image, right: Image) -> Disparity:
        """Disparity of each pixel of the left image (H, W) uint8; NaN where no match is trusted."""
        check_pair(left, right)
        if min(left.shape) < 2:
            raise InvalidInputError(f"an image of {left.shape[1]}x{left.shape[0]} px is too small for a network")
        disparity_px = self._run(left, right)
        column = np.arange(left.shape[1], dtype=np.float32)
        with_match = (disparity_px > 0) & (disparity_px <= np.minimum(column, self.num_disparities))
        disparity_px = np.where(with_match, disparity_px, np.float32(np.nan))
        if self.left_right_px > 0:
            # The right image, mirrored, sees the left one as a left image sees a right one.
            from_right = self._run(right[:, ::-1], left[:, ::-1])[:, ::-1]
            disparity_px[~agree(disparity_px, from_right, self.left_right_px)] = np.nan
        sigma_px = disparity_sigma_px(left, right, disparity_px, matcher=GENERIC)
        return Disparity(disparity_px, sigma_px, error_correlation_px(GENERIC))

    def _run(self, left: Image, right: Image) -> FloatImage:
        feed = self._description.feed(left, right)
        wanted = [self._description.output] if self._description.output else None
        try:
            output = self._session.run(wanted, feed)[0]
        except Exception as error:  # onnxruntime's errors have no root of their own
            raise InvalidInputError(f"{self._weights}: cannot be run: {_first_line(error)}") from error
        try:
            return self._description.disparity(output, (left.shape[0], left.shape[1]))
        except InvalidInputError as error:
            raise InvalidInputError(f"{self._weights}: {error}") from None

    def _check_names(self) -> None:
        """Raise ConfigError unless the description names the network's inputs and one of its outputs."""
        inputs = [each.name for each in self._session.get_inputs()]
        outputs = [each.name for each in self._session.get_outputs()]
        named = [each.name for each in self._description.inputs]
        for name in named:
            if name not in inputs:
                raise ConfigError(
                    f"{self.network}: the network has no input {name!r}; choose from: {', '.join(inputs)}"
                )
        for name in inputs:
            if name not in named:
                raise ConfigError(f"{self.network}: the network's input {name!r} is not among inputs")
        if self._description.output not in outputs and (self._description.output or len(outputs) > 1):
            raise ConfigError(
                f"{self.network}: the network has no output {self._description.output!r}; "
                f"choose from: {', '.join(outputs)}"
            )


def agree(from_left: FloatImage, from_right: FloatImage, tolerance_px: float) -> NDArray[np.bool_]:
    """Where the disparity (H, W) of the left image is that of the right one (H, W) at its match; False for NaN."""
    row, column = np.indices(from_left.shape)
    there = np.rint(np.nan_to_num(column - from_left)).astype(int).clip(0, from_left.shape[1] - 1)
    same: NDArray[np.bool_] = np.abs(from_left - from_right[row, there]) <= tolerance_px
    return same


def _session(weights: Path) -> Any:
    try:
        import onnxruntime
    except ImportError as error:
        raise MissingExtraError('the matcher onnx needs onnxruntime: pip install "stereogrid[onnx]"') from error
    if not is_file(weights):
        raise InvalidInputError(f"{weights}: no such file of weights")
    options = onnxruntime.SessionOptions()
    options.log_severity_level = QUIET
    try:
        return onnxruntime.InferenceSession(str(weights), options, providers=["CPUExecutionProvider"])
    except Exception as error:  # as above
        raise InvalidInputError(f"{weights}: not a network that onnxruntime can run: {_first_line(error)}") from error


def _first_line(error: Exception) -> str:
    return (str(error).splitlines() or [type(error).__name__])[0]
