"""Block matching: sums of absolute differences over a window, winner takes all (OpenCV's StereoBM)."""

import cv2

from ..observation import Disparity, Image
from .opencv import check_options, match_padded


class BlockMatcher:
    """`bm`. Disparities 1/16 .. num_disparities px by windows of block_px."""

    def __init__(
        self,
        *,
        num_disparities: int = 64,
        block_px: int = 9,
        uniqueness_percent: int = 0,
        left_right_px: int = 1,
        speckle_pixels: int = 100,
    ) -> None:
        check_options(num_disparities, block_px, smallest_block_px=5)
        self.num_disparities, self.block_px = num_disparities, block_px
        self._algorithm = cv2.StereoBM.create(numDisparities=num_disparities, blockSize=block_px)
        self._algorithm.setPreFilterCap(31)
        self._algorithm.setUniquenessRatio(uniqueness_percent)
        self._algorithm.setDisp12MaxDiff(left_right_px)
        self._algorithm.setSpeckleWindowSize(speckle_pixels)
        self._algorithm.setSpeckleRange(2)

    def __repr__(self) -> str:
        return f"BlockMatcher(num_disparities={self.num_disparities}, block_px={self.block_px})"

    def match(self, left: Image, right: Image) -> Disparity:
        """Disparity of each pixel of the left image (H, W) uint8; NaN where no match is trusted."""
        count, block_px = self.num_disparities, self.block_px
        return match_padded(self._algorithm, left, right, num_disparities=count, block_px=block_px, name="bm")
