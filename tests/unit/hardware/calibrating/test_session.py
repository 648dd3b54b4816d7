"""A session takes what a calibration needs, and who follows its hints gets one; it needs no cameras for that."""

from dataclasses import replace

import numpy as np
import pytest
from held_boards import BASELINE_M, BOARD, FOCAL_PX, SIZE_PX, corners_px, exact_sight, follow, pictures, pose

from hardware.calibrating.session import MIN_PAIRS, MOST_PAIRS, TAKEN, CalibrationSession
from hardware.calibrating.sight import look
from hardware.cameras.pairs import RawPair
from stereogrid.calibration import calibrate_corners
from stereogrid.geometry import FloatArray

MIDDLE = pose((0.5, 0.5), 0.45)


def shown(session: CalibrationSession, T_left_board: FloatArray, start_s: float, **of_sight: float) -> list[str]:
    """What the session says of a board that is held still for a second at 10 pairs a second."""
    return [session.consider(exact_sight(T_left_board, start_s + k / 10, **of_sight)).told for k in range(10)]


def test_a_board_that_is_held_still_is_taken_once() -> None:
    session = CalibrationSession(BOARD)
    told = shown(session, MIDDLE, 5.0)
    assert told == ["hold it still"] * 4 + ["taken"] + [TAKEN] * 5
    assert len(session.taken) == 1


def test_a_board_that_moves_is_not_taken() -> None:
    session = CalibrationSession(BOARD)
    for k in range(30):
        verdict = session.consider(exact_sight(pose((0.4 + 0.01 * k, 0.5), 0.4), k / 10))
        assert not verdict.taken and verdict.told == "hold it still"


def test_a_hand_that_shakes_a_little_is_still_enough() -> None:
    session = CalibrationSession(BOARD)
    rng = np.random.default_rng(1)
    verdicts = []
    for k in range(10):
        T = MIDDLE.copy()
        T[:2, 3] += rng.normal(0, 0.0005, 2)
        verdicts.append(session.consider(exact_sight(T, k / 10)).taken)
    assert sum(verdicts) == 1


@pytest.mark.parametrize("side", [0, 1])
def test_a_board_that_one_camera_does_not_see_is_not_taken_and_the_camera_is_named(side: int) -> None:
    session = CalibrationSession(BOARD)
    seen = exact_sight(MIDDLE)
    session.consider(seen)
    corners = (None, seen.corners[1]) if side == 0 else (seen.corners[0], None)
    for k in range(10):
        verdict = session.consider(replace(seen, stamp_s=k / 10, corners=corners))
        assert verdict.told == f"the {('left', 'right')[side]} camera does not see all of the board"
    assert "9x6" in session.consider(replace(seen, corners=(None, None))).told
    # Who comes back has to hold still anew.
    assert session.consider(exact_sight(MIDDLE, 2.0)).told == "hold it still"
    assert not session.taken


def test_blurred_pictures_and_pictures_of_two_moments_are_not_taken() -> None:
    session = CalibrationSession(BOARD)
    assert shown(session, MIDDLE, 0.0, edge_px=7.0)[-1].startswith("blurred over 7.0 px")
    assert shown(session, MIDDLE, 1.0, skew_s=-0.03)[-1] == "the two pictures are 30 ms apart"
    assert not session.taken
    # Where the squares are too small to tell, sharpness is not asked for.
    assert shown(session, MIDDLE, 2.0, edge_px=np.nan)[-1] == TAKEN


def test_another_tilt_or_place_is_another_pose() -> None:
    session = CalibrationSession(BOARD)
    for n, T in enumerate((MIDDLE, pose((0.5, 0.5), 0.45, (25, 0)), pose((0.6, 0.5), 0.45), pose((0.5, 0.5), 0.6))):
        shown(session, T, 2.0 * n)
        assert len(session.taken) == n + 1


@pytest.mark.parametrize(
    ("tilt_deg", "name"),
    [
        ((25, 0), "right edge nearer"),
        ((-25, 0), "left edge nearer"),
        ((0, 25), "lower edge nearer"),
        ((0, -25), "upper edge nearer"),
    ],
)
def test_a_tilt_is_known_by_the_edge_that_is_nearer(tilt_deg: tuple[float, float], name: str) -> None:
    T = pose((0.5, 0.5), 0.5, tilt_deg)
    edges = {
        "right": BOARD.columns - 1, "left": 0, "lower": (BOARD.rows - 1) * BOARD.columns, "upper": 0,
    }  # fmt: skip
    depth_m = (BOARD.corners_m @ T[:3, :3].T + T[:3, 3])[:, 2]
    assert depth_m[edges[name.split()[0]]] < depth_m.mean() - 0.01
    session = CalibrationSession(BOARD)
    shown(session, T, 0.0)
    assert [goal.name for goal in session.goals if goal.name.endswith("nearer") and goal.have] == [name]


@pytest.mark.parametrize("seed", range(3))
def test_who_follows_the_hints_gets_a_good_calibration_of_few_pairs(seed: int) -> None:
    rng = np.random.default_rng(seed)
    session = CalibrationSession(BOARD)
    for turn in range(30):
        if session.complete:
            break
        assert session.hint[0].isupper() and session.hint != "That is enough"
        shown(session, follow(session, rng), 2.0 * turn)
    assert session.complete and session.hint == "That is enough"
    assert MIN_PAIRS <= len(session.taken) <= 22
    corners = [np.stack([each.corners[side] for each in session.taken]) for side in (0, 1)]
    noisy = [each + rng.normal(0, 0.1, each.shape) for each in corners]
    found = calibrate_corners(*noisy, BOARD, SIZE_PX)
    assert found.K[0][0, 0] == pytest.approx(FOCAL_PX, rel=0.005)
    assert found.baseline_m == pytest.approx(BASELINE_M, rel=0.01)


def test_the_same_view_again_and_again_is_never_enough() -> None:
    rng = np.random.default_rng(0)
    session = CalibrationSession(BOARD)
    for n in range(25):
        x, y = rng.uniform(0.4, 0.6, 2)
        shown(session, pose((x, y), 0.35, (0, 0)), 2.0 * n)
    assert not session.complete
    assert "the upper left" in session.hint and "tilt it" in session.hint


def test_there_is_an_end_to_the_pairs() -> None:
    session = CalibrationSession(BOARD, taken=[exact_sight(MIDDLE)] * MOST_PAIRS)
    assert session.complete


def test_a_pair_can_be_forgotten_and_its_pose_taken_again_once_it_was_left() -> None:
    session = CalibrationSession(BOARD)
    shown(session, MIDDLE, 0.0)
    assert session.forget() and not session.taken and not session.forget()
    assert shown(session, MIDDLE, 1.0)[-1].startswith("this pose was forgotten")
    shown(session, pose((0.7, 0.5), 0.45), 2.0)
    shown(session, MIDDLE, 3.0)
    assert len(session.taken) == 2


def test_what_a_picture_shows_is_seen() -> None:
    T = pose((0.45, 0.55), 0.45, (20, -15))
    left, right = pictures(T)
    found = look(RawPair(left, right, 1.0, 1.004), BOARD)
    assert found.stamp_s == pytest.approx(1.002) and found.skew_s == pytest.approx(0.004)
    assert found.seen is not None
    for corners, exact in zip(found.seen, corners_px(T), strict=True):
        assert np.abs(corners - exact).max() < 0.25
    assert found.edge_px < 4.5
    blurred = look(RawPair(*pictures(T, blur_px=2.5), 1.0, 1.0), BOARD)
    assert blurred.edge_px > 4.5
    nothing = look(RawPair(*pictures(None), 1.0, 1.0), BOARD)
    assert nothing.corners == (None, None) and np.isnan(nothing.edge_px) and nothing.share == 0
