"""Pictures of the same moment are found by their names, and those that have no partner are named."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from hardware.calibrating.picture_files import find_pairs, side_of
from stereogrid.errors import InvalidInputError, RecordingError


def picture(path: Path, gray: int = 0) -> Path:
    path.parent.mkdir(exist_ok=True)
    assert cv2.imwrite(str(path), np.full((4, 6), gray, np.uint8))
    return path


@pytest.mark.parametrize(
    ("left", "right"),
    [
        ("left01.png", "right01.png"),
        ("L_01.png", "R_01.png"),
        ("01_left.png", "01_right.png"),
        ("Left-7.png", "right-7.png"),
        ("img_l_003.png", "img_r_003.png"),
        ("board3L.png", "board3R.png"),
        ("left/03.png", "right/03.png"),
        ("l.png", "r.png"),
    ],
)
def test_a_pair_is_found_by_what_its_names_share(tmp_path: Path, left: str, right: str) -> None:
    for gray, name in enumerate((left, right), start=1):
        picture(tmp_path / name, gray)
    found = find_pairs([tmp_path])
    assert not found.alone
    (pair,) = found.pairs
    assert (pair.left, pair.right) == (tmp_path / left, tmp_path / right)
    assert [image.mean() for image in pair.read()] == [1, 2]
    assert [image.mean() for image in pair.swapped().read()] == [2, 1]


@pytest.mark.parametrize("name", ["board.png", "roller.png", "clear01.png", "leo.png"])
def test_a_letter_within_a_word_is_no_side(name: str) -> None:
    assert side_of(Path("pictures") / name) is None


def test_files_may_be_given_one_by_one_in_any_order(tmp_path: Path) -> None:
    paths = [picture(tmp_path / f"{side}{n}.png") for side in ("right", "left") for n in (2, 1)]
    assert [pair.name for pair in find_pairs([*paths, paths[0]]).pairs] == ["left1.png", "left2.png"]


def test_pictures_without_a_partner_or_a_side_are_named(tmp_path: Path) -> None:
    for name in ("left1.png", "right1.png", "left2.png", "right3.png", "board.png", "notes.txt"):
        picture(tmp_path / name) if name.endswith("png") else (tmp_path / name).write_text("left")
    found = find_pairs([tmp_path])
    assert len(found.pairs) == 1
    assert found.alone == (
        "board.png: its name does not say whether it is left or right",
        "left2.png: has no right picture beside it",
        "right3.png: has no left picture beside it",
    )


def test_pairs_of_two_folders_with_the_same_names_are_told_apart(tmp_path: Path) -> None:
    for folder in ("a", "b"):
        for side in ("left", "right"):
            picture(tmp_path / folder / f"{side}1.png")
    names = [pair.name for pair in find_pairs([tmp_path / "a", tmp_path / "b"]).pairs]
    assert names == [str(tmp_path / folder / "left1.png") for folder in ("a", "b")]


@pytest.mark.parametrize(
    ("names", "reason"),
    [
        ([], "there is no picture in it"),
        (["left1.png", "left2.png"], "2 left pictures, but no right one"),
        (["R_1.png"], "1 right pictures, but no left one"),
        (["a.png", "b.png"], "no name says left or right"),
        (["left1.png", "right2.png"], "no left and right picture belong together"),
        (["left1.png", "left1.bmp", "right1.png"], "both are the same left picture"),
    ],
)
def test_where_there_is_nothing_to_pair_the_reason_is_told(tmp_path: Path, names: list[str], reason: str) -> None:
    for name in names:
        picture(tmp_path / name)
    with pytest.raises(InvalidInputError, match=reason):
        find_pairs([tmp_path])


def test_what_is_no_picture_is_named(tmp_path: Path) -> None:
    (tmp_path / "rig.yml").write_text("left")
    with pytest.raises(InvalidInputError, match=r"rig\.yml: is no picture"):
        find_pairs([tmp_path / "rig.yml"])
    with pytest.raises(InvalidInputError, match=r"none: there is no such file or folder"):
        find_pairs([tmp_path / "none"])
    picture(tmp_path / "right1.png")
    (tmp_path / "left1.png").write_bytes(b"\x89PNG not really")
    with pytest.raises(RecordingError, match=r"left1\.png: not a readable image"):
        find_pairs([tmp_path]).pairs[0].read()
