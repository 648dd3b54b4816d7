"""The page's pictures: green what boards have covered, orange where the next one goes, corners where they are."""

import numpy as np
from held_boards import BOARD, SIZE_PX, exact_sight, pictures, pose

from hardware.calibrating.drawing import GREEN, ORANGE, VEIL, Drawing
from hardware.calibrating.session import CalibrationSession

LEFT_BOARD, RIGHT_BOARD = pose((0.35, 0.5), 0.35), pose((0.7, 0.5), 0.35)


def veiled(picture: np.ndarray, gray: np.ndarray) -> np.ndarray:
    """The pixels (H, W) that are gray under a veil of green."""
    expected = (1 - VEIL) * gray[..., None] + VEIL * np.array(GREEN)
    return np.asarray((np.abs(picture - expected) <= 1).all(axis=-1))


def test_what_was_taken_is_green_in_each_picture_until_it_is_forgotten() -> None:
    session = CalibrationSession(BOARD)
    drawing, wall, nothing = Drawing(session, SIZE_PX), pictures(None), exact_sight(LEFT_BOARD)
    nothing = type(nothing)(BOARD, SIZE_PX, 0.0, 0.0, (None, None))
    assert not veiled(drawing.draw(wall, nothing)[0], wall[0]).any()
    session.taken += [exact_sight(LEFT_BOARD), exact_sight(RIGHT_BOARD)]
    for side, picture in enumerate(drawing.draw(wall, nothing)):
        green = veiled(picture, wall[side])
        for sight in session.taken:
            middle = np.round(sight.corners[side].mean(axis=0)).astype(int)
            assert green[middle[1], middle[0]]
        assert not green[:20].any() and 0.05 < green.mean() < 0.5
    before = veiled(drawing.draw(wall, nothing)[0], wall[0])
    session.forget()
    after = veiled(drawing.draw(wall, nothing)[0], wall[0])
    assert 0 < after.sum() < before.sum() and not (after & ~before).any()


def test_the_part_of_the_picture_that_is_wanted_has_an_orange_frame() -> None:
    session = CalibrationSession(BOARD)
    (tile,) = [goal.tile for goal in session.next_goals if goal.tile]
    assert tile == (1, 1)
    for picture in Drawing(session, SIZE_PX).draw(pictures(None), exact_sight(LEFT_BOARD)):
        rows, columns = np.nonzero((picture == ORANGE).all(axis=-1))
        assert 78 <= rows.min() < rows.max() <= 162 and 104 <= columns.min() < columns.max() <= 216


def test_the_corners_that_are_found_are_drawn_and_the_picture_itself_stays_as_it_is() -> None:
    image, _ = pair = pictures(LEFT_BOARD)
    kept = image.copy()
    sight = exact_sight(LEFT_BOARD)
    left, _ = Drawing(CalibrationSession(BOARD), SIZE_PX).draw(pair, sight)
    x, y = np.round(sight.corners[0][0]).astype(int)
    patch = left[y - 3 : y + 4, x - 3 : x + 4].astype(int)
    assert np.ptp(patch, axis=-1).max() > 100
    np.testing.assert_array_equal(image, kept)
