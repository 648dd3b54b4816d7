"""JPEG, as webcams send their pictures over USB."""

import cv2
import numpy as np

from stereogrid.observation import Image

NONE = 100


def compressed(image: Image, quality: int) -> Image:
    """The image (H, W) uint8 after JPEG of that quality; 100 leaves it as it is."""
    if quality >= NONE:
        return image
    _, data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, int(quality)])
    decoded = cv2.imdecode(data, cv2.IMREAD_GRAYSCALE)
    assert decoded is not None
    return np.asarray(decoded, dtype=np.uint8)
