"""What the documents show is there."""

import re
import shlex
from pathlib import Path

import pytest
import typer

import hardware.__main__
import sim.__main__
import stereogrid.cli

ROOT = Path(__file__).parents[2]
IMAGE = re.compile(r'!\[[^\]]*\]\(([^)\s]+)|<img[^>]*?src="([^"]+)"')
BLOCK = re.compile(r"^```[a-z]*\n(.*?)^```", re.DOTALL | re.MULTILINE)
INLINE = re.compile(r"`((?:python -m|stereogrid) [^`]+)`")
APPS = {
    "python -m hardware ": hardware.__main__.app,
    "python -m sim ": sim.__main__.app,
    "stereogrid ": stereogrid.cli.app,
}
# Of the click that typer brings, or of click itself, by typer's version.
UsageError: type[Exception] = typer.BadParameter.__mro__[1]
DOCUMENTS = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]


def images(document: Path) -> list[str]:
    """The places of the pictures in a document, but for those on the web."""
    found = [a or b for a, b in IMAGE.findall(document.read_text())]
    return [place for place in found if not place.startswith(("http://", "https://"))]


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_every_picture_of_a_document_exists(document: Path) -> None:
    missing = [place for place in images(document) if not (document.parent / place).is_file()]
    assert not missing


def test_the_documents_have_pictures() -> None:
    assert sum(len(images(document)) for document in DOCUMENTS) >= 5


def commands(document: Path) -> list[str]:
    """The command lines in a document's blocks."""
    lines = [line.strip() for block in BLOCK.findall(document.read_text()) for line in block.splitlines()]
    return [line for line in lines if line.startswith((*APPS, "make "))]


def mentions(document: Path) -> list[str]:
    """Commands with options in a document's text, which may leave out what is plain there."""
    text = BLOCK.sub("", document.read_text())
    return [" ".join(line.split()) for line in INLINE.findall(text) if "--" in line and line.startswith((*APPS,))]


def refusal(line: str, *, whole: bool = True) -> str:
    """Why a command of ours would refuse its own words, "" where it takes them; whole: it needs all of them."""
    start = next(start for start in APPS if line.startswith(start))
    name, *arguments = shlex.split(line.removeprefix(start), comments=True)
    try:
        typer.main.get_command(APPS[start]).commands[name].make_context(name, arguments)  # type: ignore[attr-defined]
    except (UsageError, KeyError) as error:
        return "" if not whole and type(error).__name__ == "MissingParameter" else f"{line}: {error!r}"
    return ""


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_every_command_of_a_document_is_one(document: Path) -> None:
    ours, made = [], []
    for line in commands(document):
        (made if line.startswith("make ") else ours).append(line)
    targets = (ROOT / "Makefile").read_text()
    refused = [line for line in made if f"\n{line.split()[1]}:" not in targets]
    refused += filter(None, map(refusal, ours))
    refused += filter(None, (refusal(line, whole=False) for line in mentions(document)))
    assert not refused


def test_the_hardware_page_shows_every_command_of_hardware() -> None:
    shown = " ".join(commands(ROOT / "docs" / "hardware.md"))
    for command in hardware.__main__.app.registered_commands:
        assert f"python -m hardware {command.callback.__name__} " in shown  # type: ignore[union-attr]


def test_a_command_that_is_none_would_be_found() -> None:
    assert not refusal("python -m hardware doctor --robot /dev/ttyUSB0  # listens")
    for wrong in ("python -m hardware doctor --robots x", "python -m hardware record", "stereogrid scare"):
        assert refusal(wrong)
    assert not refusal("python -m hardware record --fps 5", whole=False)
