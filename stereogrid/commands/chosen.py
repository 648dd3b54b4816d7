"""The config of a command: a file's, or what suits the camera, with the options that were given."""

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import InvalidInputError

if TYPE_CHECKING:
    from ..camera import StereoCamera
    from ..config import MappingConfig, MatcherConfig
    from ..recording import FileRecording


def chosen_config(
    camera: "StereoCamera",
    config: Path | None,
    *,
    recording: "FileRecording | None" = None,
    matcher: str | None = None,
    network: Path | None = None,
    num_disparities: int | None = None,
    cell: float | None = None,
    max_range: float | None = None,
    motion: Path | None = None,
    settings: Iterable[str] | None = None,
) -> "MappingConfig":
    """The config of a file, or what suits camera and recording, with the options that were given on the command line.

    settings: the parameters of --set, which go before the options of their own.
    Without a file a recording that carries disparities of its own is mapped by them; so it can only be then.
    """
    from ..config import RECORDED, MappingConfig, load_config
    from ..matching import MATCHERS
    from ..tomlfile import with_settings

    carried = recording is not None and recording.has_disparity
    if matcher is None and network is None and config is None and carried:
        matcher = RECORDED
    chosen = load_config(MappingConfig, config) if config else MappingConfig.for_camera(camera)
    chosen = with_settings(chosen, settings or ())
    chosen = replace(chosen, matcher=_chosen_matcher(chosen.matcher, matcher, network, num_disparities))
    if chosen.matcher.name == RECORDED and not carried:
        culprit = "a live pair carries" if recording is None else f"{recording.path}: carries"
        raise InvalidInputError(
            f"{culprit} no disparities of its own, so no map by the matcher {RECORDED!r}; "
            f"choose from: {', '.join(sorted(MATCHERS))}"
        )
    return _overridden(chosen, cell, max_range, motion)


def _chosen_matcher(
    config: "MatcherConfig", name: str | None, network: Path | None, num_disparities: int | None
) -> "MatcherConfig":
    """config with the options that were given on the command line; another matcher does not keep its network."""
    name = name or ("onnx" if network else config.name)
    kept = str(network) if network else config.network if name == config.name else ""
    # Whole, because the run's own config.toml will name it from elsewhere.
    kept = str(Path(kept).resolve()) if kept else ""
    count = config.num_disparities if num_disparities is None else num_disparities
    return replace(config, name=name, network=kept, num_disparities=count)


def _overridden(
    config: "MappingConfig", cell: float | None, max_range: float | None, motion: Path | None
) -> "MappingConfig":
    """config with the options that were given on the command line."""
    from ..config import load_config
    from ..motion import MotionError

    if motion is not None:
        error = load_config(MotionError, motion)
        if error.is_zero and error.way != "none":
            raise InvalidInputError(f"{motion}: tells of no error, so way = {error.way!r} has nothing to go by")
        config = replace(config, motion_error=error)
    if cell is not None:
        config = replace(config, grid=replace(config.grid, cell_m=cell))
    if max_range is not None:
        config = replace(config, model=replace(config.model, max_range_m=max_range))
    return config
