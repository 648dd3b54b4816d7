"""Pairs with known disparity: each layout is read as its makers meant it, and a wrong file is named in one line."""

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as nps

from experiments.pairs import open_pair, open_pairs, seen_by_both
from stereogrid.errors import RecordingError

HEIGHT, WIDTH = 6, 12
NAN = np.nan
TRUTH = np.full((HEIGHT, WIDTH), 3.0)
TRUTH[:, 6:8] = 5.0
TRUTH[0, 0] = NAN
rng = np.random.default_rng(0)
LEFT, RIGHT = rng.integers(0, 256, (2, HEIGHT, WIDTH, 3), dtype=np.uint8)


def write(path, image):
    path.write_bytes(cv2.imencode(path.suffix, image)[1].tobytes())


def write_pfm(path, image):
    """Rows from the bottom up, as the format has it; inf = unknown, as Middlebury has it."""
    values = np.where(np.isnan(image), np.inf, image).astype("<f4")
    path.write_bytes(f"Pf\n{image.shape[1]} {image.shape[0]}\n-1.0\n".encode() + values[::-1].tobytes())


def middlebury_2(folder):
    write(folder / "imL.png", LEFT)
    write(folder / "imR.png", RIGHT)
    write(folder / "groundtruth.png", np.nan_to_num(TRUTH * 8).astype(np.uint8))
    judged, visible = np.full((2, HEIGHT, WIDTH), 255, np.uint8)
    judged[:, -1] = 0
    visible[:, :3] = 128
    visible[:, -1] = 0
    write(folder / "all.png", judged)
    write(folder / "nonocc.png", visible)
    (folder / "info.txt").write_text("8\n10\n")


def motorcycle(folder):
    write(folder / "imL.png", LEFT)
    write(folder / "imR.png", RIGHT)
    np.savez(folder / "disp.npz", disp=np.where(np.isnan(TRUTH), np.inf, TRUTH).astype(np.float32))


def middlebury_3(folder):
    write(folder / "im0.png", LEFT)
    write(folder / "im1.png", RIGHT)
    write_pfm(folder / "disp0.pfm", TRUTH)


def aloe(folder):
    write(folder / "plantL.png", LEFT)
    write(folder / "plantR.png", RIGHT)
    write(folder / "plantGT.png", np.nan_to_num(TRUTH).astype(np.uint8))


LAYOUTS = {"middlebury_2": middlebury_2, "motorcycle": motorcycle, "middlebury_3": middlebury_3, "aloe": aloe}


@pytest.fixture(params=LAYOUTS)
def pair_folder(request, tmp_path):
    folder = tmp_path / request.param
    folder.mkdir()
    LAYOUTS[request.param](folder)
    return folder


def test_every_layout_gives_the_same_images_and_the_same_truth_the_right_way_up(pair_folder):
    pair = open_pair(pair_folder)
    assert pair.name == pair_folder.name
    np.testing.assert_array_equal(pair.left, LEFT)
    np.testing.assert_array_equal(pair.right, RIGHT)
    np.testing.assert_array_equal(pair.truth_px, TRUTH)


def test_no_pixel_is_both_visible_and_hidden_and_none_is_judged_without_a_truth(pair_folder):
    pair = open_pair(pair_folder)
    assert not (pair.visible & pair.hidden).any()
    assert not np.isnan(pair.truth_px[pair.visible | pair.hidden]).any()
    assert pair.hidden[1:, :3].all() and pair.visible[1:, 8:11].all()


def test_the_labels_hold_the_largest_disparity(pair_folder):
    pair = open_pair(pair_folder)
    assert pair.num_disparities == (11 if pair_folder.name == "middlebury_2" else 8)
    assert pair.num_disparities > np.nanmax(pair.truth_px)


@pytest.mark.parametrize(("layout", "step_px"), [(middlebury_2, 1.0), (aloe, 1.0), (motorcycle, 0.0)])
def test_the_step_of_the_truth_is_what_all_its_values_are_multiples_of(tmp_path, layout, step_px):
    layout(tmp_path)  # 24 and 40 eighths: a multiple of 8 / 8
    assert open_pair(tmp_path).step_px == step_px


def test_a_pair_in_grey_has_two_dimensions(pair_folder):
    assert [image.shape for image in open_pair(pair_folder).grey] == [(HEIGHT, WIDTH)] * 2


def test_a_shrunk_pair_is_smaller_by_the_factor_in_every_length(tmp_path):
    motorcycle(tmp_path)
    pair = open_pair(tmp_path)
    half = pair.shrunk(2)
    assert half.name == f"{pair.name} / 2"
    for array in (half.truth_px, half.visible, half.hidden, half.left[..., 0], half.right[..., 0]):
        assert array.shape == (HEIGHT // 2, WIDTH // 2)
    np.testing.assert_array_equal(half.truth_px, TRUTH[1::2, 1::2] / 2)
    np.testing.assert_allclose(half.left[0, 0], LEFT[:2, :2].mean(axis=(0, 1)), atol=0.51)
    assert half.num_disparities == 4


truths = nps.arrays(np.float64, (3, 9), elements=st.one_of(st.just(NAN), st.integers(1, 6).map(float)))


@given(truths)
def test_seen_by_both_agrees_with_a_search_pixel_by_pixel(truth):
    visible, hidden = seen_by_both(truth)
    for y, x in np.ndindex(truth.shape):
        d = truth[y, x]
        landing = x - d
        nearer = [o for u, o in enumerate(truth[y]) if u - o == landing and o > d + 1]
        seen = not np.isnan(d) and landing >= 0 and not nearer
        assert visible[y, x] == seen
        assert hidden[y, x] == (not np.isnan(d) and not seen)


def test_the_masks_from_the_truth_are_nearly_those_of_the_benchmark(real_data):
    """Middlebury's own masks come from the truth of both images."""
    pair = open_pair(real_data("stereo/teddy"))
    visible, _ = seen_by_both(pair.truth_px)
    judged = pair.visible | pair.hidden
    assert (visible == pair.visible)[judged].mean() > 0.97


# Folders of pairs


def test_a_folder_of_pairs_gives_them_by_name_and_passes_over_what_is_none(tmp_path):
    for name, layout in LAYOUTS.items():
        (tmp_path / name).mkdir()
        layout(tmp_path / name)
    (tmp_path / "notes").mkdir()
    (tmp_path / "README.md").write_text("pairs")
    assert [pair.name for pair in open_pairs(tmp_path)] == sorted(LAYOUTS)


def test_a_folder_that_is_a_pair_itself_gives_that_one(pair_folder):
    assert [pair.name for pair in open_pairs(pair_folder)] == [pair_folder.name]


def test_a_folder_without_a_pair_is_refused_with_what_was_expected(tmp_path):
    for opened in (open_pair, open_pairs):
        with pytest.raises(RecordingError, match=r"no stereo pair with truth.*groundtruth\.png.*disp0\.pfm"):
            opened(tmp_path)
    with pytest.raises(RecordingError, match="nowhere: no such folder"):
        open_pairs(tmp_path / "nowhere")


def test_one_wrong_pair_among_others_is_not_passed_over(tmp_path):
    for name in ("good", "wrong"):
        (tmp_path / name).mkdir()
        middlebury_2(tmp_path / name)
    (tmp_path / "wrong" / "info.txt").unlink()
    with pytest.raises(RecordingError, match=r"wrong/info\.txt"):
        open_pairs(tmp_path)


# What is wrong in a folder is named


WRONG_FILES = {
    "info.txt missing": (middlebury_2, "info.txt", None, "two positive numbers"),
    "info.txt of words": (middlebury_2, "info.txt", b"eight ten", "two positive numbers"),
    "info.txt of one number": (middlebury_2, "info.txt", b"8", "two positive numbers"),
    "info.txt with a scale of 0": (middlebury_2, "info.txt", b"0 10", "two positive numbers"),
    "info.txt in UTF-16": (middlebury_2, "info.txt", "8 10".encode("utf-16"), "two positive numbers"),
    "nonocc.png missing": (middlebury_2, "nonocc.png", None, "not a readable image"),
    "all.png cut": (middlebury_2, "all.png", b"\x89PNG\r\n\x1a\n", "not a readable image"),
    "groundtruth.png empty": (middlebury_2, "groundtruth.png", b"", "not a readable image"),
    "imR.png missing": (middlebury_2, "imR.png", None, "not a readable image"),
    "disp.npz of text": (motorcycle, "disp.npz", b"not a zip file", "array of numbers named disp"),
    "disp.npz empty": (motorcycle, "disp.npz", b"", "array of numbers named disp"),
    "disp0.pfm of text": (middlebury_3, "disp0.pfm", b"Pf?", "not a readable image"),
    "im1.png missing": (middlebury_3, "im1.png", None, "not a readable image"),
    "plantR.png missing": (aloe, "plantR.png", None, "not a readable image"),
}


@pytest.mark.parametrize("kind", WRONG_FILES)
def test_a_missing_or_malformed_file_is_named_in_one_line(tmp_path, kind):
    layout, name, content, reason = WRONG_FILES[kind]
    layout(tmp_path)
    (tmp_path / name).unlink()
    if content is not None:
        (tmp_path / name).write_bytes(content)
    with pytest.raises(RecordingError, match=f"{name}.*{reason}") as caught:
        open_pair(tmp_path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("arrays", [{"depth": TRUTH}, {"disp": np.array(["a"])}, {"disp": np.array([{}], object)}])
def test_an_npz_file_without_an_array_of_numbers_named_disp_is_refused(tmp_path, arrays):
    motorcycle(tmp_path)
    np.savez(tmp_path / "disp.npz", **arrays)
    with pytest.raises(RecordingError, match=r"disp\.npz.*named disp"):
        open_pair(tmp_path)


def test_sizes_that_differ_are_refused_with_the_sizes(tmp_path):
    motorcycle(tmp_path)
    write(tmp_path / "imR.png", RIGHT[:, 1:])
    with pytest.raises(RecordingError, match=r"differ in size: \(6, 12\), \(6, 11\), \(6, 12\)"):
        open_pair(tmp_path)
    np.savez(tmp_path / "disp.npz", disp=np.ones((2, 2, 2)))
    with pytest.raises(RecordingError, match=r"the truth must be \(H, W\), not \(2, 2, 2\)"):
        open_pair(tmp_path)


def test_a_mask_of_another_size_is_refused(tmp_path):
    middlebury_2(tmp_path)
    write(tmp_path / "nonocc.png", np.full((HEIGHT, 3), 255, np.uint8))
    with pytest.raises(RecordingError, match=r"nonocc\.png: \(6, 3\), but the truth is \(6, 12\)"):
        open_pair(tmp_path)


@pytest.mark.parametrize("nothing", [0.0, NAN, -1.0])
def test_a_truth_that_is_known_nowhere_is_refused(tmp_path, nothing):
    motorcycle(tmp_path)
    np.savez(tmp_path / "disp.npz", disp=np.full((HEIGHT, WIDTH), nothing))
    with pytest.raises(RecordingError, match="known at no pixel"):
        open_pair(tmp_path)
