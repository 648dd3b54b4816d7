"""Kolmogorov and Zabih's graph cuts with occlusions and uniqueness (ICCV 2001)."""

import time
from collections.abc import Callable

import numpy as np

from ...observation import Disparity, Image
from ..census import shares_around, side_of
from ..correlation import error_correlation_px
from ..images import check_images, check_num_disparities, is_blank, nothing_known
from ..meter import check_time_budget
from ..sigma import disparity_sigma_px
from .cost import energy_of_pair
from .energy import total_energy
from .solve import LabelImage, minimise
from .start import good_start
from .subpixel import between_labels

AROUND_PX, LIKE_SHARE = 121, 0.25
"""Of a window so large around a pixel so much must be matched and look alike: of noise, a fifth does by chance."""


class KolmogorovZabihMatcher:
    """`kz2`. Labels 0 .. num_disparities - 1 of least energy, each right pixel matched once; NaN where unmatched.

    subpixel: fit disparities between the labels. time_budget_s: after it no further move is begun, so that what is
    found depends on the machine. progress: called with the share done, 0 to 1, from the calling thread.
    """

    def __init__(
        self,
        *,
        num_disparities: int = 64,
        subpixel: bool = True,
        time_budget_s: float | None = None,
        progress: Callable[[float], None] | None = None,
    ) -> None:
        check_num_disparities(num_disparities)
        check_time_budget(time_budget_s)
        self.num_disparities, self.subpixel = num_disparities, subpixel
        self.time_budget_s, self.progress = time_budget_s, progress

    def __repr__(self) -> str:
        return f"KolmogorovZabihMatcher(num_disparities={self.num_disparities})"

    def match(self, left: Image, right: Image) -> Disparity:
        """Disparity of each pixel of the left image, (H, W) or (H, W, 3) uint8; NaN where it is unmatched."""
        images = check_images(left, right, self.num_disparities)
        if is_blank(*images):
            return nothing_known(left, matcher="kz2")
        label, _ = self.labels(left, right)
        sides = [side_of(image) for image in images]
        grey_left, grey_right = (side.grey for side in sides)
        if self.subpixel:
            disparity_px = between_labels(label, grey_left, grey_right)
        else:
            disparity_px = np.where(label >= 0, label, np.nan).astype(np.float32)
        column = np.arange(label.shape[1], dtype=np.float32)
        disparity_px[(disparity_px <= 0) | (disparity_px > column)] = np.nan
        # K adapts itself to the pair: of two images that have nothing in common the energy matches most pixels.
        like_share, _ = shares_around(sides, np.maximum(label, 0).astype(np.int32), label >= 0, AROUND_PX)
        disparity_px[like_share < LIKE_SHARE] = np.nan
        sigma_px = disparity_sigma_px(grey_left, grey_right, disparity_px, matcher="kz2")
        return Disparity(disparity_px, sigma_px, error_correlation_px("kz2"))

    def labels(self, left: Image, right: Image) -> tuple[LabelImage, int]:
        """The labelling (H, W) int16, -1 = unmatched, and its energy in the units of the reference (see cost.py).

        Of a pair without any contrast the labels say nothing; match leaves them out.
        """
        images = check_images(left, right, self.num_disparities)
        deadline_s = np.inf if self.time_budget_s is None else time.monotonic() + self.time_budget_s
        energy, _ = energy_of_pair(*images, self.num_disparities)
        search = minimise(energy, good_start(energy), deadline_s=deadline_s, progress=self.progress or (lambda _: None))
        label = search.labels.label
        return label, int(total_energy(energy, label))
