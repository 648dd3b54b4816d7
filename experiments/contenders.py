"""Who takes part in the comparison of matchers, and how each is made."""

import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Annotated, Any

from stereogrid.config import MatcherConfig, config_from_table
from stereogrid.described import Doc, check_fields
from stereogrid.errors import ConfigError, InvalidInputError
from stereogrid.matching import matcher
from stereogrid.observation import Image, Matcher

from .pairs import Pair

SEE_COLOUR = ("gc", "kz2")


@dataclass(frozen=True)
class Contender:
    """A matcher of stereogrid.matching as it takes part."""

    matcher: Annotated[str, Doc("Its name.")]
    colour: Annotated[bool, Doc("Whether pairs are shown to it in colour.")] = False
    labels_step: Annotated[
        int, Doc("num_disparities is rounded up to a multiple of it; 0: it takes none.", "px", least=0)
    ] = 1
    options: Annotated[dict, Doc("What else the matcher is made with.")] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.colour and self.matcher not in SEE_COLOUR:
            raise InvalidInputError(f"colour = true: of the matchers only {', '.join(SEE_COLOUR)} see colour")
        if "num_disparities" in self.options:
            raise InvalidInputError("options: num_disparities follows from the pair, by labels_step")
        check_fields(self)

    def labels(self, wanted: int) -> int:
        """How many disparities it searches where `wanted` would do; 0 where it has no say in it."""
        return -(-wanted // self.labels_step) * self.labels_step if self.labels_step else 0

    def make(self, num_disparities: int) -> Matcher:
        """The matcher, which searches num_disparities or a few more."""
        labels = {"num_disparities": self.labels(num_disparities)} if self.labels_step else {}
        return matcher(self.matcher, **labels, **self.options)

    def files(self) -> list[tuple[str, Path]]:
        """What it reads from files, as RunRecord.reading takes it."""
        network = self.options.get("network")
        return MatcherConfig(self.matcher, network=str(network)).files() if network else []

    def images(self, pair: Pair) -> tuple[Image, Image]:
        """The pair as the contender sees it."""
        return (pair.left, pair.right) if self.colour else pair.grey


CONTENDERS = {
    "bm": Contender("bm", labels_step=16),  # OpenCV searches multiples of 16
    "sgbm": Contender("sgbm", labels_step=16),
    "kz2": Contender("kz2", colour=True),  # the published data cost is one of colours
    "gc": Contender("gc"),
}
"""The matchers that need nothing but images. One with a network of the user's comes in through the config:
[contenders.hitnet] with matcher = "onnx" and options = { network = "hitnet.toml" }.
"""


def default_table() -> dict[str, Any]:
    """CONTENDERS as the config holds them."""
    return {name: asdict(each) for name, each in CONTENDERS.items()}


def read_contenders(table: Mapping[str, Any]) -> dict[str, Contender]:
    """The contenders by name from the sections [contenders.<name>] of a config; ConfigError names what is wrong.

    A section that names no matcher means the one that bears the section's name, as CONTENDERS has it.
    """
    contenders = {}
    for name, section in table.items():
        if not isinstance(section, Mapping):
            raise ConfigError(f"'contenders.{name}' must be a section, not {section!r}")
        if not re.fullmatch(r"[\w-]+", name):
            raise ConfigError(f"contender {name!r}: a name must be of letters, digits, - and _, since files bear it")
        known = asdict(CONTENDERS[name]) if name in CONTENDERS else {"matcher": name}
        contenders[name] = config_from_table(Contender, {**known, **section}, f"contenders.{name}.")
    return contenders
