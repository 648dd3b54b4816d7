"""Recordings and pictures that camera faults are tested on."""

from collections.abc import Iterator

import numpy as np

from stereogrid.camera import StereoCamera
from stereogrid.observation import Image, Observation, Odometry, Truth

CAMERA = StereoCamera(80.0, 31.5, 23.5, 0.06, 64, 48)


class FewObservations:
    """Observations 0, 1, ... of an endless recording, a second apart, whose gray levels are given one by one."""

    def __init__(self, count: int, grays: tuple[int, ...] = (128,), camera: StereoCamera = CAMERA) -> None:
        self.camera = camera
        self.T_base_cam = np.eye(4)
        self.count, self.grays = count, grays

    def __len__(self) -> int:
        return self.count

    def __iter__(self) -> Iterator[Observation]:
        for i in range(self.count):
            image = np.full(self.camera.shape, self.grays[i % len(self.grays)], np.uint8)
            yield Observation(float(i), image, image, Odometry(np.eye(4)), np.eye(4), Truth(np.eye(4)))


def flat(gray: int, camera: StereoCamera = CAMERA) -> tuple[Image, Image]:
    """A pair of one gray level."""
    image = np.full(camera.shape, gray, np.uint8)
    return image, image.copy()


def spots(camera: StereoCamera, columns_rows: list[tuple[float, float]]) -> Image:
    """Bright, round spots about points [px] on black, wide enough for their centres to be found."""
    row, column = np.mgrid[: camera.height_px, : camera.width_px]
    light = np.zeros(camera.shape)
    for x, y in columns_rows:
        light += np.exp(-((column - x) ** 2 + (row - y) ** 2) / (2 * 2.5**2))
    return (255 * np.sqrt(np.clip(light, 0, 1)) + 0.5).astype(np.uint8)


def centre(image: Image, near: tuple[float, float], reach_px: int = 12) -> np.ndarray:
    """Centroid (column, row) [px] of the light within reach_px of a point."""
    x, y = (round(v) for v in near)
    rows = slice(max(y - reach_px, 0), y + reach_px + 1)
    columns = slice(max(x - reach_px, 0), x + reach_px + 1)
    light = (image[rows, columns] / 255.0) ** 2
    row, column = np.mgrid[rows, columns]
    return np.array([(light * column).sum(), (light * row).sum()]) / light.sum()
