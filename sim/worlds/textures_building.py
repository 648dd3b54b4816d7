"""Textures of halls and of buildings from outside, with the low and the repeated ones that fool a matcher."""

import cv2
import numpy as np

from ..scene.textures import Texture, noise, print_lines, to_image
from .textures_indoor import GLASS, VARNISH


def concrete(rng: np.random.Generator) -> Texture:
    """A bare wall, cast against smooth boards: between joints and tie holes there is next to nothing to match."""
    image = 0.56 + 0.010 * noise(rng, (512, 1024), power=1.8, finest_px=30)
    image += 0.006 * noise(rng, (512, 1024), power=0.8, finest_px=5)
    for x in range(0, 1024, 512):
        image[:, x : x + 3] = 0.42
        for y in (128, 384):
            for at in (x + 96, x + 416):
                cv2.circle(image, (at, y), 6, 0.36, -1, cv2.LINE_AA)
    image[:3] = 0.44
    return Texture(to_image(image), (4.8, 2.4))


def steel_panel(rng: np.random.Generator) -> Texture:
    """Painted wall panels of 1 m: plain between their joints."""
    image = 0.70 + 0.006 * noise(rng, (256, 256), power=1.8, finest_px=16)
    image[:, :3] = 0.5
    image[:, 3:5] = 0.78
    return Texture(to_image(image), (1.0, 1.0))


def hall_floor(rng: np.random.Generator) -> Texture:
    """Sealed concrete with stains and the marks of tyres."""
    n = 1024
    image = 0.48 + 0.03 * noise(rng, (n, n), power=1.0, finest_px=4) + 0.03 * noise(rng, (n, n), power=0.2, finest_px=3)
    image -= 0.06 * np.clip(noise(rng, (n, n), power=1.8, finest_px=12) - 0.8, 0, 1)
    marks = np.zeros_like(image)
    for _ in range(36):
        (x, y), turn = (int(v) for v in rng.integers(0, n, 2)), float(rng.uniform(0, 360))
        radii = (int(rng.integers(60, 420)), int(rng.integers(200, 420)))
        cv2.ellipse(marks, (x, y), radii, turn, 0, float(rng.uniform(5, 50)), 1.0, int(rng.integers(1, 9)), cv2.LINE_AA)
    image -= 0.07 * cv2.GaussianBlur(marks, (0, 0), 1.5) * (1 + 0.5 * noise(rng, (n, n), power=0.3, finest_px=3))
    return Texture(to_image(image), (4.0, 4.0))


def marking(rng: np.random.Generator) -> Texture:
    """Yellow floor paint, worn."""
    worn = noise(rng, (256, 256), power=0.7, finest_px=2)
    image = np.where(worn > 1.2, 0.5, 0.76) + 0.02 * noise(rng, (256, 256), power=0.2)
    return Texture(to_image(image.astype(np.float32)), (1.0, 1.0))


def upright(rng: np.random.Generator) -> Texture:
    """A rack's post with its slots every 50 mm, as they are punched."""
    image = 0.30 + 0.01 * noise(rng, (512, 64), power=0.8)
    for y in range(6, 512, 32):
        image[y : y + 16, 16:26] = image[y : y + 16, 38:48] = 0.07
    return Texture(to_image(image), (0.1, 0.8), gloss=VARNISH)


def stock_carton(rng: np.random.Generator) -> Texture:
    """The one carton that a whole warehouse is full of: tape, a label, an arrow."""
    image = 0.56 + 0.02 * noise(rng, (256, 256), power=0.8, finest_px=3)
    image[:, 118:138] = 0.64
    image[150:215, 20:105] = 0.88
    print_lines(rng, image, (26, 156, 72, 54), pitch=9)
    cv2.arrowedLine(image, (205, 215), (205, 150), 0.15, 8, cv2.LINE_AA, tipLength=0.4)
    cv2.circle(image, (60, 62), 30, 0.2, 7, cv2.LINE_AA)
    image[48:76, 152:236] = 0.2
    image[:3] = image[-3:] = image[:, :3] = image[:, -3:] = 0.4
    return Texture(to_image(image))


def rough_wood(rng: np.random.Generator) -> Texture:
    """Sawn boards of pallets and fences, grain along s."""
    grain = cv2.GaussianBlur(noise(rng, (128, 512), power=0.4), (1, 0), sigmaX=12, sigmaY=0.6)
    image = 0.56 + 0.08 * grain / grain.std() + 0.03 * noise(rng, (128, 512), power=0.8, finest_px=2)
    for _ in range(5):
        x, y = int(rng.integers(10, 500)), int(rng.integers(8, 120))
        cv2.ellipse(image, (x, y), (7, 4), 0, 0, 360, 0.25, -1, cv2.LINE_AA)
    return Texture(to_image(image), (1.2, 0.3))


def slats(rng: np.random.Generator) -> Texture:
    """A roller gate: perforated slats 80 mm high, alike every 160 mm along them too."""
    y = (np.arange(256) % 64) / 64
    profile = 0.60 + 0.08 * np.sin(2 * np.pi * y) - 0.22 * (y > 0.92)
    image = (profile[:, None] + 0.008 * noise(rng, (256, 128), power=1.2)).astype(np.float32)
    for row in range(4):
        cv2.ellipse(image, (32 + 64 * (row % 2), 64 * row + 30), (18, 3), 0, 0, 360, 0.36, -1, cv2.LINE_AA)
    return Texture(to_image(image), (0.16, 0.32))


def ribbed_sheet(rng: np.random.Generator) -> Texture:
    """Trapezoidal steel sheet, a rib every 0.25 m, each the same to the last speck: nothing tells one from the next."""
    x = np.arange(128) / 128
    ramp = np.clip((0.5 - np.abs(x - 0.5)) * 10, 0, 1)
    image = 0.60 + 0.12 * ramp - 0.2 * (np.abs(x - 0.08) < 0.03) + 0.1 * (np.abs(x - 0.92) < 0.03)
    grain = 0.008 * noise(rng, (512, 128), power=0.8, finest_px=2)
    return Texture(to_image((image[None, :] + grain).astype(np.float32)), (0.25, 1.0))


def brick(rng: np.random.Generator) -> Texture:
    """Bricks of 250 x 83 mm in running bond."""
    rows, columns, high, wide = 512, 1024, 32, 128
    image = np.full((rows, columns), 0.62, np.float32)
    for row in range(rows // high):
        start = (row % 2) * wide // 2
        for column in range(columns // wide):
            x = (np.arange(wide - 5) + start + column * wide) % columns
            shade = 0.42 + 0.05 * rng.standard_normal()
            image[row * high : (row + 1) * high - 4, x] = np.clip(shade, 0.28, 0.55)
    image += 0.035 * noise(rng, (rows, columns), power=0.5, finest_px=3)
    return Texture(to_image(image), (2.0, 1.328))


def render_coat(rng: np.random.Generator) -> Texture:
    """Smooth, pale facade render."""
    image = 0.78 + 0.012 * noise(rng, (512, 512), power=1.6, finest_px=20) + 0.008 * noise(rng, (512, 512), power=0.3)
    return Texture(to_image(image), (3.0, 3.0))


def paving(rng: np.random.Generator) -> Texture:
    """Concrete slabs of 0.4 x 0.4 m, no two as dirty, with sandy joints."""
    n, slab = 1024, 128
    image = (
        0.56 + 0.03 * noise(rng, (n, n), power=1.0, finest_px=5) + 0.035 * noise(rng, (n, n), power=0.1, finest_px=3)
    )
    image += np.kron(rng.uniform(-0.05, 0.05, (8, 8)), np.ones((slab, slab))).astype(np.float32)
    for edge in range(0, n, slab):
        image[edge : edge + 4, :] -= 0.17
        image[:, edge : edge + 4] -= 0.17
    return Texture(to_image(image), (3.2, 3.2))


def asphalt(rng: np.random.Generator) -> Texture:
    """A road surface."""
    image = 0.36 + 0.06 * noise(rng, (512, 512), power=0.1, finest_px=3)
    image += 0.025 * noise(rng, (512, 512), power=1.5, finest_px=8)
    return Texture(to_image(image), (2.0, 2.0))


def hedge(rng: np.random.Generator) -> Texture:
    """Clipped foliage: small leaves, dark gaps."""
    leaves = noise(rng, (512, 512), power=0.5, finest_px=6)
    image = 0.34 + 0.10 * leaves - 0.10 * (noise(rng, (512, 512), power=0.9, finest_px=5) > 1.1)
    return Texture(to_image(image), (1.6, 1.6))


def dark_window(rng: np.random.Generator) -> Texture:
    """A window from outside, as dark as rooms are by day, with a blind half down."""
    image = np.full((128, 128), 0.17, np.float32)
    down = int(rng.integers(10, 70))
    image[:down] = 0.5 + 0.06 * (np.arange(down) % 8 < 4)[:, None]
    image[down : down + 2] = 0.3
    return Texture(to_image(image + 0.006 * noise(rng, (128, 128), power=1.5)), gloss=GLASS)


def far_house(rng: np.random.Generator) -> Texture:
    """The house across the street: rows of windows, all alike."""
    one = np.full((128, 128), 0.62, np.float32)
    one[24:100, 36:92] = 0.24
    one[24:100, 62:66] = one[58:61, 36:92] = 0.7
    one[100:106, 30:98] = 0.75
    image = np.tile(one, (4, 4))
    for row in range(4):
        for column in range(4):
            down = int(rng.integers(0, 50))
            y, x = 128 * row + 24, 128 * column + 36
            image[y : y + down, x : x + 56] = 0.72
    return Texture(to_image(image + 0.015 * noise(rng, (512, 512), power=1.0, finest_px=3)), (12.0, 12.0))


def clouds(rng: np.random.Generator) -> Texture:
    """Fair-weather clouds: black where the sky is clear."""
    field = noise(rng, (512, 512), power=1.7, finest_px=3)
    return Texture(to_image(np.clip(0.5 * field - 0.1, 0.0, 1.0)), (3.0, 3.0))
