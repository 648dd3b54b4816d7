"""Products of many vectors, for what reaches the pixels.

By einsum: unlike matmul, which BLAS may share out, it sums in the same order on any number of threads.
"""

import numpy as np

from stereogrid.geometry import FloatArray


def turned(vectors: FloatArray, T: FloatArray) -> FloatArray:
    """Vectors (N, 3) turned by a pose (4, 4)."""
    rotated: FloatArray = np.einsum("na,ba->nb", vectors, T[:3, :3])
    return rotated


def placed(points: FloatArray, T: FloatArray) -> FloatArray:
    """Points (N, 3) moved by a pose (4, 4)."""
    return turned(points, T) + T[:3, 3]


def lengths_along(vectors: FloatArray, direction: FloatArray) -> FloatArray:
    """Lengths (N,) of vectors (N, K) along a direction (K,), in lengths of it."""
    lengths: FloatArray = np.einsum("na,a->n", vectors, direction)
    return lengths
