"""Procedural textures: square-root (perceptual) reflectance as uint8 images that tile, sizes powers of two."""

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import fft

from stereogrid.observation import FloatImage, Image


@dataclass(frozen=True)
class Texture:
    """image (H, W) uint8, H and W powers of two, rows downwards; size_m (width, height) of one tile [m].

    A glowing texture is its own light (a lamp); it is shown as bright as it is, without shading.
    gloss: share of the light that is mirrored head-on, 0 to 1 (varnish 0.04; more at grazing angles, as Fresnel
    has it). clear: glass; what is behind is seen through it, with what it mirrors and the texture as dirt on top.
    """

    image: Image
    size_m: tuple[float, float] = (1.0, 1.0)
    glows: bool = False
    gloss: float = 0.0
    clear: bool = False


Painter = Callable[[np.random.Generator], Texture]


def noise(rng: np.random.Generator, shape: tuple[int, int], *, power: float, finest_px: float = 1.0) -> FloatImage:
    """Tileable noise (H, W) of mean 0 and deviation 1 whose amplitude falls as frequency^-power.

    Details smaller than finest_px [px] are damped.
    """
    frequency = np.hypot(fft.fftfreq(shape[0])[:, None], fft.rfftfreq(shape[1])[None, :])
    frequency[0, 0] = np.inf
    gain = (frequency**-power * np.exp(-((frequency * finest_px) ** 2))).astype(np.float32)
    white = rng.standard_normal(shape, dtype=np.float32)
    field: FloatImage = fft.irfft2(fft.rfft2(white) * gain, s=shape).astype(np.float32)
    field /= field.std()
    return field


def to_image(brightness: NDArray[np.float32]) -> Image:
    """uint8 of a brightness in 0 to 1."""
    return (np.clip(brightness, 0.0, 1.0) * 255 + 0.5).astype(np.uint8)


def wall(rng: np.random.Generator) -> Texture:
    """Painted plaster with a darker, scuffed dado below 0.9 m; 2.6 m high, some stretches nearly bare."""
    rows, columns = 1024, 2048
    # Rollers and patches leave texture in places only: where `worn` is low the wall is honestly hard to match.
    worn = np.clip(0.45 + 0.35 * noise(rng, (rows, columns), power=2.0, finest_px=300), 0.12, 1.0)
    grain = noise(rng, (rows, columns), power=0.6, finest_px=4)
    stains = noise(rng, (rows, columns), power=1.6, finest_px=12)
    image = 0.80 + worn * (0.022 * grain + 0.020 * stains)
    dado = slice(int(rows * (1 - 0.9 / 2.6)), rows)
    image[dado] = 0.56 + worn[dado] * (0.035 * grain[dado] + 0.045 * stains[dado])
    scuff(rng, image, rows=(dado.start, rows), count=90)
    return Texture(to_image(image), (5.2, 2.6))


def floor(rng: np.random.Generator) -> Texture:
    """Speckled vinyl tiles of 0.64 m with joints."""
    n, tile = 1024, 256
    chips = noise(rng, (n, n), power=0.0, finest_px=5)
    image = 0.46 + 0.05 * noise(rng, (n, n), power=1.2, finest_px=8) + 0.11 * (chips > 1.5) - 0.09 * (chips < -1.5)
    image += np.kron(rng.uniform(-0.03, 0.03, (n // tile, n // tile)), np.ones((tile, tile))).astype(np.float32)
    for edge in range(0, n, tile):
        image[edge : edge + 2, :] *= 0.72
        image[:, edge : edge + 2] *= 0.72
    return Texture(to_image(image), (2.56, 2.56))


def ceiling(rng: np.random.Generator) -> Texture:
    """Mineral-fibre tiles of 0.6 m in a white grid."""
    n, tile = 512, 256
    pores = noise(rng, (n, n), power=0.2, finest_px=3)
    image = 0.84 + 0.02 * noise(rng, (n, n), power=1.0, finest_px=6) - 0.22 * (pores > 1.6)
    for edge in range(0, n, tile):
        image[edge : edge + 8, :] = 0.93
        image[:, edge : edge + 8] = 0.93
        image[edge + 8 : edge + 10, :] *= 0.75
        image[:, edge + 8 : edge + 10] *= 0.75
    return Texture(to_image(image), (1.2, 1.2))


def wood(rng: np.random.Generator) -> Texture:
    """A veneered door leaf with grain along its height."""
    grain = noise(rng, (512, 64), power=0.5, finest_px=1)
    streaks = cv2.resize(grain, (256, 512), interpolation=cv2.INTER_LINEAR)
    streaks = cv2.GaussianBlur(streaks, (1, 0), sigmaX=0.6, sigmaY=14)
    rings = np.sin(26 * np.linspace(0, 1, 256) + 2.5 * noise(rng, (512, 256), power=2.2, finest_px=60))
    base = rng.uniform(0.46, 0.62)
    image = base + 0.10 * streaks / streaks.std() * 0.6 + 0.05 * rings + 0.02 * noise(rng, (512, 256), power=0.3)
    return Texture(to_image(image.astype(np.float32)), (0.9, 2.05))


def cardboard(rng: np.random.Generator) -> Texture:
    """A carton with tape, a label and print."""
    image = 0.58 + 0.03 * noise(rng, (256, 256), power=0.8, finest_px=3)
    image[118:138] = 0.66 + 0.02 * noise(rng, (20, 256), power=0.5)
    x, y = (int(v) for v in rng.integers(20, 150, 2))
    image[y : y + 60, x : x + 84] = 0.88
    print_lines(rng, image, (x + 6, y + 6, 72, 48), pitch=8)
    cv2.circle(image, (int(rng.integers(40, 216)), 210), 22, 0.3, 5)
    return Texture(to_image(image))


def metal(rng: np.random.Generator) -> Texture:
    """Brushed, slightly dirty metal."""
    brushed = np.repeat(noise(rng, (128, 16), power=0.3), 8, axis=1)
    return Texture(to_image(0.42 + 0.03 * brushed + 0.04 * noise(rng, (128, 128), power=1.5)), (0.5, 0.5))


def paint(brightness: float, spread: float) -> Painter:
    """A painter of plain varnish: brightness 0 to 1, mottled by spread."""

    def painter(rng: np.random.Generator) -> Texture:
        return Texture(to_image(brightness + spread * noise(rng, (128, 128), power=1.0, finest_px=2)), (0.6, 0.6))

    return painter


def leaf(rng: np.random.Generator) -> Texture:
    """Foliage."""
    return Texture(to_image(0.33 + 0.09 * noise(rng, (128, 128), power=0.9, finest_px=3)), (0.25, 0.25))


def lamp(rng: np.random.Generator) -> Texture:
    """A prismatic lamp cover, lit."""
    image = 0.97 + 0.02 * noise(rng, (64, 64), power=0.5)
    image[:3] = image[-3:] = image[:, :3] = image[:, -3:] = 0.7
    return Texture(to_image(image), glows=True)


def poster(rng: np.random.Generator) -> Texture:
    """A printed poster: a picture, a headline, columns of text."""
    h, w = 512, 256
    ground = rng.uniform(0.75, 0.95) if rng.random() < 0.75 else rng.uniform(0.2, 0.35)
    ink = 0.12 if ground > 0.5 else 0.92
    image = np.full((h, w), ground, np.float32) + 0.01 * noise(rng, (h, w), power=0.5)
    top = int(rng.integers(60, 110))
    picture = noise(rng, (256, 256), power=1.3, finest_px=4)[: 180 + top // 2, 16 : w - 16]
    image[top : top + len(picture), 16 : w - 16] = 0.48 + 0.2 * picture
    for _ in range(4):
        x, y = int(rng.integers(30, w - 30)), int(rng.integers(top + 20, top + 170))
        cv2.circle(image, (x, y), int(rng.integers(10, 36)), float(rng.uniform(0.1, 0.95)), -1, cv2.LINE_AA)
    print_lines(rng, image, (16, 18, w - 32, top - 30), pitch=22, ink=ink)
    print_lines(rng, image, (16, top + len(picture) + 14, w - 32, h), pitch=12, ink=ink)
    return Texture(to_image(image))


def notice_board(rng: np.random.Generator) -> Texture:
    """Cork in a frame, with sheets pinned on it."""
    h, w = 512, 1024
    image = 0.50 + 0.06 * noise(rng, (h, w), power=0.4, finest_px=3)
    for _ in range(26):
        sheet_w, sheet_h = int(rng.integers(70, 150)), int(rng.integers(80, 190))
        x, y = int(rng.integers(20, w - sheet_w - 20)), int(rng.integers(20, h - sheet_h - 20))
        image[y + 4 : y + sheet_h + 4, x + 4 : x + sheet_w + 4] *= 0.75
        image[y : y + sheet_h, x : x + sheet_w] = rng.uniform(0.7, 0.96)
        print_lines(rng, image, (x + 8, y + 12, sheet_w - 16, sheet_h - 20), pitch=int(rng.integers(8, 14)))
    image[:14] = image[-14:] = image[:, :14] = image[:, -14:] = 0.3
    return Texture(to_image(image))


def sign(rng: np.random.Generator) -> Texture:
    """A door sign with a room number."""
    image = np.full((128, 256), 235, np.uint8)
    image[:26] = 70
    cv2.putText(image, f"{rng.integers(100, 399)}", (30, 104), cv2.FONT_HERSHEY_SIMPLEX, 2.6, 30.0, 8, cv2.LINE_AA)
    return Texture(image)


def scuff(rng: np.random.Generator, image: FloatImage, *, rows: tuple[int, int], count: int) -> None:
    """Draw marks of trolleys and shoes between two rows."""
    width = image.shape[1]
    for _ in range(count):
        x, y = int(rng.integers(0, width)), int(rng.integers(*rows))
        end = (min(x + int(rng.integers(8, 140)), width - 1), int(np.clip(y + rng.integers(-8, 8), *rows)))
        shade = float(np.clip(image[min(y, len(image) - 1), x] + rng.normal(0, 0.09), 0.1, 0.95))
        cv2.line(image, (x, y), end, shade, int(rng.integers(1, 4)), cv2.LINE_AA)


def print_lines(
    rng: np.random.Generator, image: FloatImage, area: tuple[int, int, int, int], *, pitch: int, ink: float = 0.2
) -> None:
    """Fill an area (x, y, width, height) with lines of words, as print looks from a distance."""
    x0, y0, width, height = area
    for y in range(y0, min(y0 + height, len(image)) - pitch // 2, pitch):
        x = x0
        while (word := int(rng.integers(pitch // 2, 4 * pitch))) + x < x0 + width:
            image[y : y + pitch // 2, x : x + word] = ink + rng.uniform(0, 0.15)
            x += word + pitch // 2
