"""Your own matcher as a plug-in: python examples/own_matcher.py drive.mcap

Whatever has `match(left, right)` and returns sg.Disparity can stand in the mapper. This one is OpenCV's semi-global
matching on smoothed images, with an honest guess of its error; the drive's truth says whether it is any good.
"""

import sys

import cv2
import numpy as np

import stereogrid as sg

if len(sys.argv) != 2:
    sys.exit(__doc__)


class SmoothedMatcher:
    """Disparities of two blurred images (H, W) uint8."""

    def __init__(self) -> None:
        self._sgbm = cv2.StereoSGBM.create(numDisparities=48, blockSize=5, P1=200, P2=800, uniquenessRatio=5)

    def match(self, left: np.ndarray, right: np.ndarray) -> sg.Disparity:
        left, right = (cv2.GaussianBlur(image, (3, 3), 0) for image in (left, right))
        disparity_px = self._sgbm.compute(left, right).astype(np.float32) / 16
        disparity_px[disparity_px <= 0] = np.nan  # NaN: nothing matched there
        sigma_px = np.where(np.isnan(disparity_px), np.nan, 0.3)  # your own standard deviation, pixel by pixel
        return sg.Disparity(disparity_px, sigma_px)


drive = sg.open_recording(sys.argv[1])
truth = sg.MapTruth.of_recording(drive, 0.1, max_range_m=5.0)
for name, matcher in {"yours": SmoothedMatcher(), "sgbm": sg.matcher("sgbm", num_disparities=48)}.items():
    mapper = sg.Mapper(drive.camera, matcher, sg.OccupancyGrid(cell_m=0.1))
    for observation in drive:
        mapper.step(observation)
    mapper.finish()
    scores = {score.name: score.text for score in truth.score(mapper.grid)}
    print(f"{name:6} AUC {scores['auc']}, F1 {scores['occupied_f1']}, log-loss {scores['log_loss']} nat")
