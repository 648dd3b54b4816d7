"""Semi-global matching (Hirschmueller 2008) as OpenCV has it (StereoSGBM)."""

import cv2

from ..observation import Disparity, Image
from .opencv import check_options, match_padded


class SemiGlobalMatcher:
    """`sgbm`. Disparities 1/16 .. num_disparities px; three path directions."""

    def __init__(
        self,
        *,
        num_disparities: int = 64,
        block_px: int = 3,
        uniqueness_percent: int = 0,
        left_right_px: int = 1,
        speckle_pixels: int = 100,
    ) -> None:
        check_options(num_disparities, block_px, smallest_block_px=1)
        self.num_disparities, self.block_px = num_disparities, block_px
        # By keyword: positionally, OpenCV's order puts preFilterCap before uniquenessRatio.
        self._algorithm = cv2.StereoSGBM.create(
            minDisparity=0,
            numDisparities=num_disparities,
            blockSize=block_px,
            P1=8 * block_px**2,
            P2=32 * block_px**2,
            preFilterCap=63,
            uniquenessRatio=uniqueness_percent,
            disp12MaxDiff=left_right_px,
            speckleWindowSize=speckle_pixels,
            speckleRange=2,
            mode=cv2.STEREO_SGBM_MODE_SGBM_3WAY,
        )

    def __repr__(self) -> str:
        return f"SemiGlobalMatcher(num_disparities={self.num_disparities}, block_px={self.block_px})"

    def match(self, left: Image, right: Image) -> Disparity:
        """Disparity of each pixel of the left image (H, W) uint8; NaN where no match is trusted."""
        count, block_px = self.num_disparities, self.block_px
        return match_padded(self._algorithm, left, right, num_disparities=count, block_px=block_px, name="sgbm")
