"""What the documents show is there."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
IMAGE = re.compile(r'!\[[^\]]*\]\(([^)\s]+)|<img[^>]*?src="([^"]+)"')
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
