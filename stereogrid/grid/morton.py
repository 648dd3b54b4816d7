"""Morton codes: the place of a cell on the curve that visits an octree's leaves in order."""

import numpy as np

from ..geometry import Array

_STEPS = ((32, 0x1F00000000FFFF), (16, 0x1F0000FF0000FF), (8, 0x100F00F00F00F00F), (4, 0x10C30C30C30C30C3))
_LAST = (2, 0x1249249249249249)


def encode(keys: Array) -> Array:
    """Codes (N,) int64 of keys (N, 3) below 2^20: three bits a level, z y x, the top level first."""
    spread = keys
    for shift, mask in (*_STEPS, _LAST):
        spread = (spread | spread << shift) & mask
    code: Array = spread[:, 0] | spread[:, 1] << 1 | spread[:, 2] << 2
    return code


def decode(codes: Array) -> Array:
    """Keys (N, 3) int64 of codes (N,) int64."""
    spread = np.stack([codes, codes >> 1, codes >> 2], axis=-1) & _LAST[1]
    masks = [mask for _, mask in _STEPS[::-1]] + [0xFFFFF]
    for (shift, _), mask in zip((_LAST, *_STEPS[::-1]), masks, strict=True):
        spread = (spread | spread >> shift) & mask
    return spread
