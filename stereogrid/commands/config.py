"""`stereogrid config`."""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer

from ..errors import InvalidInputError


def config_command(
    path: Annotated[Path | None, typer.Argument(help="Write it there.  [on the screen]")] = None,
    suits: Annotated[
        Path | None, typer.Option("--for", help="With what suits this recording's camera, as `map` would choose it.")
    ] = None,
    check: Annotated[Path | None, typer.Option(help="Say whether this file is fine, and print nothing else.")] = None,
) -> None:
    """Print a config.toml with every parameter of `map`: what it is, its unit, what it may be, its default."""
    from ..config import MappingConfig

    def suiting() -> MappingConfig:
        from ..recording import open_recording

        return MappingConfig.for_camera(open_recording(suits).camera) if suits else MappingConfig()

    show_config(MappingConfig, "stereogrid map", out=path, check=check, make=suiting)


def show_config(
    kind: type,
    of: str,
    *,
    out: Path | None = None,
    check: Path | None = None,
    make: Callable[[], Any] | None = None,
) -> None:
    """Print the documented config of a command, or write it to out; or check a file, which raises ConfigError.

    kind: its dataclass; make: makes one, in place of the defaults; of: the command, as it is typed.
    """
    from ..documented import documented_toml
    from ..tomlfile import load_config, save_config

    if check is not None:
        if out is not None:
            raise InvalidInputError(f"{out}: nothing is written where a file is checked")
        load_config(kind, check)
        sys.stdout.write(f"{check}: fine\n")
        return
    config, heading = (make or kind)(), f"The parameters of `{of}`, for its --config."
    if out is not None:
        if out.exists():
            raise InvalidInputError(f"{out}: exists already; choose another path, or remove it")
        save_config(config, out, heading=heading)
        sys.stdout.write(f"{out}: written\n")
    else:
        sys.stdout.write(documented_toml(config, heading=heading))
