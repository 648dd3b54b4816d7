"""Results that took long are kept under a key of all that makes them: who starts again goes on where it stopped.

A result whose makings change (a parameter, the code) has another key, so that no old one is ever taken for it.
"""

import hashlib
import json
from collections.abc import Iterable
from dataclasses import asdict, is_dataclass
from pathlib import Path
from typing import Any

from stereogrid.errors import InvalidInputError
from stereogrid.files import written_beside
from stereogrid.scoring import Score, scores_from_dict, scores_to_dict

ROOT = Path(__file__).parents[1]
NO_SCORE_DEPENDS_ON = tuple(
    f"stereogrid/{each}"
    for each in (
        *("__main__.py", "cli.py", "commands", "screen.py", "checks.py", "doctor.py", "documented.py", "early.py"),
        *("exporting", "figures", "report", "map_report.py", "map_truth.py", "thumbnails.py", "viewer", "runs.py"),
        *("recorded_run.py", "run_record.py", "digests.py", "scoring/paired.py"),
    )
)
"""What of the library only shows, writes and tells."""


def key_of(*makings: object) -> str:
    """The same for the same makings: dataclasses, texts, numbers, and tables and lists of them."""
    text = json.dumps(makings, sort_keys=True, default=_plain)
    return hashlib.sha256(text.encode()).hexdigest()[:32]


def _plain(thing: Any) -> Any:
    if is_dataclass(thing) and not isinstance(thing, type):
        return asdict(thing)
    raise TypeError(f"{thing!r} cannot be part of a key")


def file_key(path: Path) -> str:
    """The SHA-256 of a file."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def code_key(inside: Iterable[str], *, but: Iterable[str] = ()) -> str:
    """The key of the code and its tables (JSON) in these files and folders of the checkout, `but` some of them."""
    left_out = [ROOT / each for each in but]
    paths = {path for each in inside for path in _sources(ROOT / each)}
    kept = sorted(path for path in paths if not any(path.is_relative_to(each) for each in left_out))
    return key_of([[path.relative_to(ROOT).as_posix(), file_key(path)] for path in kept])


def _sources(place: Path) -> Iterable[Path]:
    return (path for kind in ("*.py", "*.json") for path in place.rglob(kind)) if place.is_dir() else [place]


class KeptScores:
    """A folder with a file of scores for each key; a file is there whole or not at all."""

    def __init__(self, folder: Path) -> None:
        self.folder = _made(folder)

    def get(self, key: str) -> list[Score] | None:
        """The scores of that key; None where there are none, or where their file is damaged."""
        try:
            return scores_from_dict(json.loads(self._path(key).read_text(encoding="utf-8"))["scores"])
        except (OSError, ValueError, KeyError, TypeError):
            return None

    def keep(self, key: str, scores: Iterable[Score], about: object) -> None:
        """Keep scores; about: what they are of, for the curious."""
        text = json.dumps({"of": about, "scores": scores_to_dict(scores)}, indent=1, default=_plain)
        with written_beside(self._path(key)) as temporary:
            temporary.write_text(text + "\n", encoding="utf-8")

    def _path(self, key: str) -> Path:
        return self.folder / f"{key}.json"


class KeptTexts:
    """A folder with a text for each key: why results could not be made."""

    def __init__(self, folder: Path) -> None:
        self.folder = _made(folder)

    def get(self, key: str) -> str | None:
        """The text of that key; None where there is none."""
        try:
            return self._path(key).read_text(encoding="utf-8")
        except (OSError, ValueError):
            return None

    def keep(self, key: str, text: str) -> None:
        """Keep a text."""
        with written_beside(self._path(key)) as temporary:
            temporary.write_text(text, encoding="utf-8")

    def drop(self, key: str) -> None:
        """Forget that key's, if there is one."""
        self._path(key).unlink(missing_ok=True)

    def _path(self, key: str) -> Path:
        return self.folder / f"{key}.txt"


def _made(folder: Path) -> Path:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InvalidInputError(f"{folder}: nothing can be kept there ({error.strerror})") from None
    return folder
