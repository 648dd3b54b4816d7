"""Textures as the renderer reads them: all mip levels of all textures in one flat array."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from stereogrid.errors import InvalidInputError

from ..scene.textures import Texture


@dataclass(frozen=True)
class Atlas:
    """texels: all levels, flat uint8. levels (L, 3): start, columns, rows of each. spans: first and last per name."""

    texels: NDArray[np.uint8]
    levels: NDArray[np.int64]
    spans: dict[str, tuple[int, int]]

    @classmethod
    def pack(cls, textures: dict[str, Texture]) -> "Atlas":
        """Halve every texture until one side is a single texel, and lay all levels end to end."""
        texels: list[NDArray[np.uint8]] = []
        levels: list[tuple[int, int, int]] = []
        spans: dict[str, tuple[int, int]] = {}
        start = 0
        for name, texture in textures.items():
            first = len(levels)
            for image in _pyramid(name, texture):
                levels.append((start, image.shape[1], image.shape[0]))
                texels.append(image.ravel())
                start += image.size
            spans[name] = (first, len(levels))
        return cls(np.concatenate(texels), np.array(levels, dtype=np.int64), spans)


def _pyramid(name: str, texture: Texture) -> list[NDArray[np.uint8]]:
    image = texture.image
    rows, columns = image.shape
    if rows & (rows - 1) or columns & (columns - 1):
        raise InvalidInputError(f"the sides of texture {name!r} must be powers of two, not {columns} x {rows}")
    fine = image.astype(np.float32)
    levels = [image]
    while min(fine.shape) > 1:
        fine = cv2.resize(fine, (fine.shape[1] // 2, fine.shape[0] // 2), interpolation=cv2.INTER_AREA)
        levels.append((fine + 0.5).astype(np.uint8))
    return levels
