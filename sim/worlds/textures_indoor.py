"""Textures of furniture, floors and clothes; `textures` has the tools and what the corridor needs."""

from dataclasses import replace

import cv2
import numpy as np

from stereogrid.observation import FloatImage

from ..scene.textures import Painter, Texture, noise, print_lines, to_image

VARNISH, POLISHED, GLASS, SCREEN = 0.04, 0.05, 0.08, 0.05
"""Shares of light mirrored head-on. What is powder-coated or rough has none: mirrors of the renderer are sharp."""


def glossy(painter: Painter, gloss: float) -> Painter:
    """The painter's texture with a shine."""

    def shining(rng: np.random.Generator) -> Texture:
        return replace(painter(rng), gloss=gloss)

    return shining


def plaster(rng: np.random.Generator) -> Texture:
    """Painted plaster of a tall room, without a dado: rolled, patched in places, elsewhere nearly bare."""
    n = 1024
    worn = np.clip(0.5 + 0.4 * noise(rng, (n, n), power=2.0, finest_px=120), 0.15, 1.0)
    image = 0.74 + worn * (0.022 * noise(rng, (n, n), power=0.5, finest_px=4) + 0.018 * noise(rng, (n, n), power=1.6))
    return Texture(to_image(image), (4.0, 4.0))


def glass(rng: np.random.Generator) -> Texture:
    """A pane, wiped but not for some weeks: what it shows of itself is dust and finger marks."""
    image = 0.04 + 0.03 * noise(rng, (256, 256), power=1.2, finest_px=3)
    for _ in range(14):
        x, y = (int(v) for v in rng.integers(10, 246, 2))
        cv2.ellipse(image, (x, y), (int(rng.integers(2, 5)), 3), float(rng.uniform(0, 180)), 0, 360, 0.16, -1)
    return Texture(to_image(image), (2.0, 2.0), gloss=GLASS, clear=True)


def carpet(rng: np.random.Generator) -> Texture:
    """Carpet tiles of 0.5 m, laid by turns along and across."""
    n, tile = 1024, 256
    pile = noise(rng, (n, n), power=0.3, finest_px=2)
    ribs = np.sin(2 * np.pi * np.arange(tile) / 8).astype(np.float32)[None, :] * np.ones((tile, 1), np.float32)
    pair = np.block([[ribs, ribs.T], [ribs.T, ribs]])
    image = 0.40 + 0.045 * pile + 0.02 * np.tile(pair, (2, 2)) + 0.02 * noise(rng, (n, n), power=1.6, finest_px=30)
    image += np.kron(rng.uniform(-0.035, 0.035, (4, 4)), np.ones((tile, tile))).astype(np.float32)
    return Texture(to_image(image), (2.0, 2.0))


def terrazzo(rng: np.random.Generator) -> Texture:
    """A polished floor of stone chips."""
    chips = noise(rng, (512, 512), power=0.0, finest_px=4)
    fine = noise(rng, (512, 512), power=0.2, finest_px=2)
    image = 0.62 + 0.10 * (chips > 1.3) - 0.14 * (chips < -1.35) + 0.03 * fine
    return Texture(to_image(image), (1.28, 1.28), gloss=POLISHED)


def stone_tiles(rng: np.random.Generator) -> Texture:
    """Polished tiles of 0.6 m with veins and joints."""
    n, tile = 1024, 256
    image = (
        0.60 + 0.035 * noise(rng, (n, n), power=0.8, finest_px=4) + 0.02 * noise(rng, (n, n), power=0.1, finest_px=3)
    )
    veins = np.abs(noise(rng, (n, n), power=1.9, finest_px=5))
    image -= 0.10 * np.exp(-((veins / 0.035) ** 2))
    image += np.kron(rng.uniform(-0.04, 0.04, (4, 4)), np.ones((tile, tile))).astype(np.float32)
    for edge in range(0, n, tile):
        image[edge : edge + 3, :] = 0.38
        image[:, edge : edge + 3] = 0.38
    return Texture(to_image(image), (2.4, 2.4), gloss=POLISHED)


def books(rng: np.random.Generator) -> Texture:
    """A shelf's row of book spines with titles, 0.8 m wide."""
    h, w = 256, 1024
    image = np.full((h, w), 0.1, np.float32)
    x = 0
    while x < w:
        thick, tall = int(rng.integers(18, 58)), int(rng.integers(176, 244))
        end, shade = min(x + thick, w), float(rng.choice([rng.uniform(0.15, 0.4), rng.uniform(0.45, 0.85)]))
        across = np.linspace(-1, 1, end - x, dtype=np.float32)
        image[h - tall :, x:end] = shade * (1 - 0.25 * across**2) + 0.02
        _spine(rng, image[h - tall :, x:end], ink=0.85 if shade < 0.45 else 0.15)
        x = end
    return Texture(to_image(image + 0.012 * noise(rng, (h, w), power=0.4)), (0.8, 0.3))


def _spine(rng: np.random.Generator, spine: FloatImage, *, ink: float) -> None:
    """A title, bands and a mark on one spine, in place."""
    tall, thick = spine.shape
    middle, size = slice(thick // 3, max(2 * thick // 3, thick // 3 + 2)), int(rng.integers(60, 120))
    for y in range(20, 20 + size, 7):
        if rng.random() < 0.8:
            spine[y : y + 5, middle] = ink
    for y in (int(rng.integers(6, 14)), tall - int(rng.integers(24, 50))):
        spine[y : y + 4, 2:-2] = ink


def binders(rng: np.random.Generator) -> Texture:
    """Twelve ring binders that differ in their labels alone: a repeated texture."""
    h, w, thick = 256, 1024, 85
    image = np.full((h, w), 0.1, np.float32)
    one = np.full((h - 14, thick), float(rng.uniform(0.2, 0.35)), np.float32)
    one[:, :2] = one[:, -3:] = 0.08
    one[30:120, 14:-16] = 0.86
    cv2.circle(one, (thick // 2, 190), 17, 0.7, 4, cv2.LINE_AA)
    cv2.circle(one, (thick // 2, 190), 13, 0.04, -1, cv2.LINE_AA)
    for x in range(0, w - thick + 1, thick):
        image[14:, x : x + thick] = one
        print_lines(rng, image, (x + 18, 56, thick - 36, 66), pitch=14)
    image[:, -4:] = 0.1
    return Texture(to_image(image), (0.8, 0.3))


def screen(rng: np.random.Generator) -> Texture:
    """A monitor that is on: windows with text and a picture."""
    h, w = 256, 512
    image = 0.34 + 0.08 * noise(rng, (h, w), power=2.0, finest_px=20)
    for _ in range(3):
        ww, wh = int(rng.integers(150, 300)), int(rng.integers(100, 190))
        x, y = int(rng.integers(8, w - ww)), int(rng.integers(8, h - wh))
        image[y : y + wh, x : x + ww] = ground = float(rng.choice([0.14, 0.82, 0.9]))
        image[y : y + 10, x : x + ww] = 0.5
        print_lines(rng, image, (x + 8, y + 18, ww - 16, wh - 22), pitch=8, ink=0.12 if ground > 0.5 else 0.6)
    image[-10:] = 0.2
    return Texture(to_image(np.clip(image, 0, 0.82)), glows=True, gloss=SCREEN)


def keyboard(rng: np.random.Generator) -> Texture:
    """Rows of keys."""
    image = np.full((64, 256), 0.12, np.float32)
    for row in range(5):
        for key in range(19):
            x, y = 6 + 13 * key, 3 + 12 * row
            image[y : y + 9, x : x + 10] = 0.25 + 0.02 * float(rng.standard_normal())
            image[y + 3 : y + 5, x + 4 : x + 6] = 0.7
    return Texture(to_image(image))


def whiteboard(rng: np.random.Generator) -> Texture:
    """White enamel, wiped: traces of a drawing in one corner, and hardly anything else."""
    h, w = 512, 1024
    image = 0.90 + 0.006 * noise(rng, (h, w), power=1.8, finest_px=40)
    x, y = int(rng.integers(60, w - 360)), int(rng.integers(60, h - 240))
    for k in range(6):
        end = (x + int(rng.integers(40, 300)), y + int(rng.integers(10, 200)))
        cv2.line(image, (x + int(rng.integers(0, 200)), y + 30 * k), end, 0.45, 2, cv2.LINE_AA)
    cv2.rectangle(image, (x, y), (x + 120, y + 80), 0.4, 2, cv2.LINE_AA)
    image[:8] = image[-8:] = image[:, :8] = image[:, -8:] = 0.55
    return Texture(to_image(image), gloss=GLASS)


def cloth(brightness: float, pattern: str = "plain") -> Painter:
    """A painter of woven cloth with folds; pattern: plain, stripes or checks."""

    def painter(rng: np.random.Generator) -> Texture:
        n = 256
        weave = noise(rng, (n, n), power=0.2, finest_px=2)
        folds = noise(rng, (n, n), power=1.8, finest_px=10)
        image = brightness + 0.035 * weave + 0.015 * folds
        wave = (np.sin(2 * np.pi * np.arange(n) / 16) > 0.2).astype(np.float32) * (0.25 if brightness < 0.5 else -0.25)
        if pattern in ("stripes", "checks"):
            image += 0.7 * wave[:, None]
        if pattern == "checks":
            image += 0.7 * wave[None, :]
        return Texture(to_image(image), (0.4, 0.4))

    return painter


def ribbed(rng: np.random.Generator) -> Texture:
    """The ribs of a radiator or a shutter: upright, 50 mm apart, all alike."""
    x = np.arange(256) / 256 * 2 * np.pi * 8
    image = 0.74 + 0.10 * np.sin(x)[None, :] - 0.16 * (np.cos(x)[None, :] > 0.92) + np.zeros((128, 1))
    return Texture(to_image((image + 0.01 * noise(rng, (128, 256), power=1.0)).astype(np.float32)), (0.4, 0.6))


def drawer(rng: np.random.Generator) -> Texture:
    """The front of a drawer: a recessed grip, a lock, dark joints round it."""
    image = 0.80 + 0.008 * noise(rng, (64, 128), power=1.2, finest_px=4)
    image[:1] = image[-1:] = image[:, :1] = image[:, -1:] = 0.3
    image[8:16, 44:84] = 0.22
    image[15:17, 44:84] = 0.9
    cv2.circle(image, (110, 14), 3, 0.4, -1, cv2.LINE_AA)
    return Texture(to_image(image), gloss=VARNISH)


def stuff(rng: np.random.Generator) -> Texture:
    """The top of a used desk: sheets and notes on laminate."""
    h, w = 256, 512
    image = 0.66 + 0.02 * noise(rng, (h, w), power=0.6, finest_px=2)
    for _ in range(int(rng.integers(4, 8))):
        sheet = np.full((84, 60), float(rng.uniform(0.8, 0.95)), np.float32)
        print_lines(rng, sheet, (5, 6, 50, 72), pitch=8)
        turn = cv2.getRotationMatrix2D((30, 42), float(rng.uniform(-40, 40)), 1.0)
        turn[:, 2] += rng.uniform((30, 20), (w - 100, h - 110))
        mask = cv2.warpAffine(np.ones_like(sheet), turn, (w, h)) > 0.5
        image[mask] = cv2.warpAffine(sheet, turn, (w, h))[mask]
    return Texture(to_image(image))
