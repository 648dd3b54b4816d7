"""The worlds by name."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from stereogrid.errors import InvalidInputError, RecordingError, unknown_name

from ..scene.scene import World
from .corridor import corridor
from .entrance import entrance
from .office import office
from .outdoor import outdoor
from .people import with_people
from .warehouse import warehouse

WORLDS: dict[str, Callable[[int], World]] = {
    "corridor": corridor,
    "entrance": entrance,
    "office": office,
    "outdoor": outdoor,
    "warehouse": warehouse,
}


@dataclass(frozen=True)
class WorldPlan:
    """All that a world follows from: its name, its seed, and how many people walk in it.

    Raises InvalidInputError for an unknown name or a negative number.
    """

    name: str
    seed: int = 0
    people: int = 0

    def __post_init__(self) -> None:
        if self.name not in WORLDS:
            raise unknown_name("world", self.name, WORLDS)
        for name in ("seed", "people"):
            if getattr(self, name) < 0:
                raise InvalidInputError(f"{name} must be >= 0, not {getattr(self, name)}")

    @classmethod
    def of(cls, metadata: Mapping[str, str]) -> "WorldPlan":
        """From a recording's metadata. Raises RecordingError when they do not tell."""
        missing = [key for key in ("world", "seed") if key not in metadata]
        if missing:
            raise RecordingError(f"the recording's metadata do not name its {' and '.join(missing)}")
        numbers = {key: metadata.get(key, "0") for key in ("seed", "people")}
        for key, text in numbers.items():
            if not text.isdecimal():
                raise RecordingError(f"the recording's metadata give the {key} {text!r}, not a whole number")
        return cls(metadata["world"], int(numbers["seed"]), int(numbers["people"]))

    def metadata(self) -> dict[str, str]:
        """What `of` reads."""
        return {"world": self.name, "seed": str(self.seed), "people": str(self.people)}

    def make(self) -> World:
        """The world. Raises InvalidInputError when there is no room for so many people."""
        return with_people(WORLDS[self.name](self.seed), self.people, self.seed)


def make_world(name: str, seed: int = 0, *, people: int = 0) -> World:
    """The world of that name, with so many people who walk in it; see WorldPlan."""
    return WorldPlan(name, seed, people).make()
