"""Pairs drawn with a known disparity, for the tests of several matchers."""

import cv2
import numpy as np

SHAPE = (60, 140)
SUPERSAMPLED = 8


def texture(seed, shape=SHAPE):
    """A random texture (H, 8 (W + 64)), drawn 8 times finer than the pixels along the rows."""
    rng = np.random.default_rng(seed)
    fine = rng.normal(size=(shape[0], (shape[1] + 64) * SUPERSAMPLED)).astype(np.float32)
    fine = cv2.GaussianBlur(fine, (0, 0), 10, sigmaY=1.2)
    return np.clip(np.rint(128 + 45 * fine / fine.std()), 0, 255).astype(np.uint8)


def seen(fine, disparity_px):
    """The image (H, W) of a texture in which column x shows the texture at x + disparity (H, W) [px]."""
    at = np.rint((np.arange(disparity_px.shape[1]) + disparity_px) * SUPERSAMPLED).astype(int)
    return np.take_along_axis(fine, np.clip(at, 0, fine.shape[1] - 1), axis=1)


def plane_pair(disparity_px):
    """A pair of a surface with the given disparity in right image's columns."""
    fine = texture(0, disparity_px.shape)
    return seen(fine, np.zeros_like(disparity_px)), seen(fine, disparity_px)


def shifted_pair(disparity_px, seed=0, shape=SHAPE):
    """A pair of a wall of one disparity, a multiple of 1/8 px."""
    fine = texture(seed, shape)
    return seen(fine, np.zeros(shape)), seen(fine, np.full(shape, disparity_px))


def two_layers():
    """(left, right, truth, hidden): a near square of disparity 14 before a wall of disparity 4."""
    wall, near = texture(1), texture(2)
    truth = np.full(SHAPE, 4.0)
    truth[15:45, 60:100] = 14
    left = np.where(truth == 14, seen(near, np.zeros(SHAPE)), seen(wall, np.zeros(SHAPE)))
    right = seen(wall, np.full(SHAPE, 4.0))
    right[15:45, 46:86] = seen(near, np.full(SHAPE, 14.0))[15:45, 46:86]
    hidden = np.zeros(SHAPE, bool)
    hidden[:, :4] = True
    hidden[15:45, 50:60] = True
    return left, right, truth, hidden
