"""Pairs of pictures among files: which are left, which are right, and which belong together, by their names."""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from stereogrid.errors import InvalidInputError
from stereogrid.observation import Image
from stereogrid.recording.images import decode_grey

SUFFIXES = (".bmp", ".jpeg", ".jpg", ".pgm", ".png", ".ppm", ".tif", ".tiff", ".webp")
NAMING = "left01.png and right01.png, or L_01.png and R_01.png, or left/01.png and right/01.png"
_SIDE = re.compile(r"left|right|(?<![a-z])[lr](?![a-z])", re.IGNORECASE)


@dataclass(frozen=True)
class PicturePair:
    """The files of one moment; name: for messages, of the left one."""

    name: str
    left: Path
    right: Path

    def read(self) -> tuple[Image, Image]:
        """(left, right), (H, W) uint8. Raises InvalidInputError or RecordingError, naming the file."""
        return _read(self.left), _read(self.right)

    def swapped(self) -> "PicturePair":
        """The same with left and right exchanged."""
        return PicturePair(self.name, self.right, self.left)


@dataclass(frozen=True)
class PicturePairs:
    """pairs in the order of their names; alone: a line for each picture that has no partner, or no side."""

    pairs: tuple[PicturePair, ...]
    alone: tuple[str, ...]


def find_pairs(paths: Sequence[Path]) -> PicturePairs:
    """Pair the pictures among files and folders. A folder's own pictures count, and those in its left/ and right/.

    Raises InvalidInputError when there is nothing to pair, or two pictures claim one place.
    """
    given = ", ".join(str(path) for path in paths[:2]) + (", ..." if len(paths) > 2 else "")
    pictures = sorted(set(_pictures(paths)))
    if not pictures:
        raise InvalidInputError(f"{given}: there is no picture in it ({', '.join(SUFFIXES)})")
    sides: dict[str, dict[str, Path]] = {"left": {}, "right": {}}
    alone: list[str] = []
    for path in pictures:
        found = side_of(path)
        if found is None:
            alone.append(f"{path.name}: its name does not say whether it is left or right")
            continue
        side, key = found
        if key in sides[side]:
            raise InvalidInputError(f"{sides[side][key]} and {path}: both are the same {side} picture; keep one")
        sides[side][key] = path
    return PicturePairs(_paired(sides, given), (*alone, *_partnerless(sides)))


def side_of(path: Path) -> tuple[str, str] | None:
    """("left" or "right", what both pictures of the pair have in common); None when no name says it."""
    parts = path.parent.name, path.stem
    for place in (1, 0):
        if match := _SIDE.search(parts[place]):
            common = f"{parts[place][: match.start()]}*{parts[place][match.end() :]}".lower()
            key = str(path.parent / common) if place else str(path.parent.parent / common / path.stem)
            return ("left" if match[0].lower().startswith("l") else "right"), key
    return None


def _pictures(paths: Iterable[Path]) -> Iterable[Path]:
    for path in paths:
        if path.is_dir():
            folders = [path, *(each for each in sorted(path.iterdir()) if each.is_dir() and _SIDE.fullmatch(each.name))]
            yield from (each for folder in folders for each in folder.iterdir() if each.suffix.lower() in SUFFIXES)
        elif not path.exists():
            raise InvalidInputError(f"{path}: there is no such file or folder")
        elif path.suffix.lower() not in SUFFIXES:
            raise InvalidInputError(f"{path}: is no picture ({', '.join(SUFFIXES)})")
        else:
            yield path


def _paired(sides: dict[str, dict[str, Path]], given: str) -> tuple[PicturePair, ...]:
    left, right = sides["left"], sides["right"]
    both = sorted(left.keys() & right.keys())
    if both:
        several = len({left[key].name for key in both}) < len(both)
        names = (str(left[key]) if several else left[key].name for key in both)
        return tuple(PicturePair(name, left[key], right[key]) for name, key in zip(names, both, strict=True))
    if not left and not right:
        raise InvalidInputError(f"{given}: no name says left or right; name the pictures {NAMING}")
    for side, some, none in (("right", left, right), ("left", right, left)):
        if not none:
            raise InvalidInputError(
                f"{given}: {len(some)} {'left' if side == 'right' else 'right'} pictures, but no {side} one; "
                f"name them {NAMING}"
            )
    raise InvalidInputError(f"{given}: no left and right picture belong together; name them {NAMING}")


def _partnerless(sides: dict[str, dict[str, Path]]) -> Iterable[str]:
    for side, other in (("left", "right"), ("right", "left")):
        for key in sorted(sides[side].keys() - sides[other].keys()):
            yield f"{sides[side][key].name}: has no {other} picture beside it"


def _read(path: Path) -> Image:
    try:
        return decode_grey(path.read_bytes(), str(path))
    except OSError as error:
        raise InvalidInputError(f"{path}: cannot be read ({error.strerror})") from None
