"""Textures of the outdoor world: paving, masonry, wood, cars, houses and sky; all tile that are laid without end.

As in textures.py they are square-root reflectance; near the path a texel is 2 to 3 mm.
"""

import cv2
import numpy as np

from stereogrid.observation import FloatImage

from ..scene.textures import Texture, noise, to_image


def pavers(rng: np.random.Generator) -> Texture:
    """Concrete paving stones, 25 x 12.5 cm, in running bond: repeated on purpose."""
    return _stones(rng, rows=16, columns=8, look=(0.52, 0.03), joint_px=6)


def setts(rng: np.random.Generator) -> Texture:
    """Small granite setts of 10 cm, no two alike."""
    return _stones(rng, rows=20, columns=20, look=(0.47, 0.055), joint_px=12, wander_px=7.0)


def slabs(rng: np.random.Generator) -> Texture:
    """Smooth concrete slabs of 50 cm: in the shade there is little to see on them but the joints."""
    return _stones(rng, rows=4, columns=4, look=(0.6, 0.018), joint_px=5, shift=0.0, grain=0.012)


def granite(rng: np.random.Generator) -> Texture:
    """Coarse granite: kerbs and steps."""
    return Texture(to_image(_grains(rng, 512, base=0.52, spread=0.075)), (1.0, 1.0))


def asphalt(rng: np.random.Generator) -> Texture:
    """A worn road: aggregate, oil, a few sealed cracks; 2.4 mm a texel."""
    n = 1024
    chips = noise(rng, (n, n), power=0.15, finest_px=2.6)
    image = 0.33 + 0.05 * chips + 0.13 * (chips > 1.9) + 0.025 * noise(rng, (n, n), power=1.4, finest_px=20)
    image = image.astype(np.float32)
    for start in rng.uniform(200, n - 200, (5, 2)):
        crack = start + np.clip(np.cumsum(rng.normal(0, 8, (24, 2)) + rng.normal(0, 5, 2), axis=0), -190, 190)
        cv2.polylines(image, [crack.astype(np.int32)], False, 0.2, 3, cv2.LINE_AA)
    return Texture(to_image(image), (2.5, 2.5))


def brick(rng: np.random.Generator) -> Texture:
    """Red brick, 25 x 8.3 cm with its joint, in running bond: repeated on purpose, but exactly only every 4 m, which is
    beyond the disparities that a matcher looks at."""
    shape = (1024, 2048)
    tone, edge = _bond(rng, shape, stones=(24, 16), shift=0.5)
    image = 0.44 + 0.05 * tone + 0.022 * noise(rng, shape, power=0.7, finest_px=3)
    joint = np.clip(edge / 3.0 - 1.0, 0, 1)
    mortar = 0.60 + 0.03 * noise(rng, shape, power=0.4, finest_px=3)
    return Texture(to_image((joint * image + (1 - joint) * mortar).astype(np.float32)), (4.0, 2.0))


def ashlar(rng: np.random.Generator) -> Texture:
    """Rough blocks of a low wall."""
    return _stones(rng, rows=10, columns=5, look=(0.5, 0.06), joint_px=10, wander_px=6.0, grain=0.05)


def render_coat(rng: np.random.Generator) -> Texture:
    """Plain rendered wall: almost bare on purpose, with faint streaks of rain."""
    n = 1024
    streaks = cv2.resize(noise(rng, (64, n), power=1.0, finest_px=6), (n, n))
    image = 0.74 + 0.007 * noise(rng, (n, n), power=0.5, finest_px=3) + 0.006 * streaks
    return Texture(
        to_image((image + 0.012 * noise(rng, (n, n), power=1.8, finest_px=60)).astype(np.float32)), (4.0, 4.0)
    )


def concrete(rng: np.random.Generator) -> Texture:
    """Fair-faced concrete: sills, plinths, feet."""
    pores = noise(rng, (512, 512), power=0.3, finest_px=3)
    image = 0.58 + 0.02 * noise(rng, (512, 512), power=1.0, finest_px=4) - 0.15 * (pores > 2.2)
    return Texture(to_image(image.astype(np.float32)), (1.5, 1.5))


def planks(rng: np.random.Generator) -> Texture:
    """Weathered, painted wood, grain along its length (s)."""
    grain = cv2.resize(noise(rng, (128, 32), power=0.5), (512, 128), interpolation=cv2.INTER_LINEAR)
    image = 0.46 + 0.05 * grain + 0.02 * noise(rng, (128, 512), power=0.6)
    return Texture(to_image(image.astype(np.float32)), (1.2, 0.3))


def slat(rng: np.random.Generator) -> Texture:
    """The same wood, upright."""
    along = planks(rng)
    return Texture(np.ascontiguousarray(along.image.T), along.size_m[::-1])


def number_plate(rng: np.random.Generator) -> Texture:
    """A number plate, stretched over what it is on."""
    image = np.full((64, 256), 225, np.uint8)
    letters = "".join(rng.choice(list("ABCDEHKLMNPRSTXZ"), 2))
    text = f"{letters} {rng.integers(100, 999)}"
    cv2.putText(image, text, (18, 50), cv2.FONT_HERSHEY_SIMPLEX, 1.6, 30.0, 5, cv2.LINE_AA)
    return Texture(image)


def car_paint(rng: np.random.Generator) -> Texture:
    """Polished paint with a little dust: nearly nothing to match, and what it mirrors moves with the camera."""
    base = float(rng.choice([0.2, 0.34, 0.48, 0.66, 0.84]))
    image = base + 0.006 * noise(rng, (256, 256), power=1.0, finest_px=4)
    return Texture(to_image(image.astype(np.float32)), (1.5, 1.5), gloss=0.05)


def dark_glass(rng: np.random.Generator) -> Texture:
    """The window of a car."""
    image = 0.14 + 0.012 * noise(rng, (64, 64), power=1.2)
    return Texture(to_image(image.astype(np.float32)), gloss=0.1)


def window(rng: np.random.Generator) -> Texture:
    """A pane with a dim room behind, maybe curtains or a blind; glossy."""
    n = 256
    image = 0.13 + 0.02 * noise(rng, (n, n), power=1.6, finest_px=8)
    image = image.astype(np.float32)
    kind = rng.integers(3)
    if kind == 1:
        side = int(rng.integers(36, 80))
        folds = 0.36 + 0.06 * np.sin(np.arange(side) * 0.55)
        image[:, :side] = folds
        image[:, n - side :] = folds[::-1]
    if kind == 2:
        drop = int(rng.integers(60, 190))
        image[:drop] = 0.5 + 0.05 * np.sign(np.sin(np.arange(drop) * 0.8))[:, None]
    for x, y, w, h in rng.uniform((0, 130, 16, 20), (n, 230, 60, 80), (5, 4)).astype(int):
        image[y : y + h, x : x + w] += float(rng.uniform(-0.04, 0.09))
    return Texture(to_image(image), gloss=0.09)


def house_front(rng: np.random.Generator) -> Texture:
    """A house far away: rows of painted windows in a plain front, 4 m by 4 m a tile."""
    n = 512
    wall = float(rng.uniform(0.5, 0.78))
    image = wall + 0.012 * noise(rng, (n, n), power=0.8, finest_px=4)
    image = image.astype(np.float32)
    for x in (60, 316):
        for y in (70, 326):
            image[y - 8 : y + 128, x - 8 : x + 144] = wall + 0.12
            image[y : y + 120, x : x + 136] = 0.17 + 0.05 * float(rng.uniform(0, 1))
            image[y : y + 120, x + 64 : x + 72] = wall + 0.1
    return Texture(to_image(image), (5.0, 6.0))


def roof_tiles(rng: np.random.Generator) -> Texture:
    """Rows of clay tiles, seen from far away."""
    return Texture(_stones(rng, rows=16, columns=16, look=(0.36, 0.04), joint_px=8, grain=0.02).image, (4.0, 4.0))


def clouds(rng: np.random.Generator) -> Texture:
    """Fair-weather clouds: bright heaps, thin between."""
    field = noise(rng, (512, 512), power=1.7, finest_px=3)
    image = np.clip(0.35 * (field - 0.1), 0, 1) + 0.04 * np.clip(noise(rng, (512, 512), power=1.2, finest_px=3), 0, 2)
    return Texture(to_image(np.clip(image, 0, 0.98).astype(np.float32)))


def _stones(
    rng: np.random.Generator,
    *,
    rows: int,
    columns: int,
    look: tuple[float, float],
    joint_px: float,
    shift: float = 0.5,
    wander_px: float = 0.0,
    grain: float = 0.03,
) -> Texture:
    """Stones in dark joints, 2 m a tile, each its own shade: look is (brightness, spread between stones)."""
    n = 1024
    tone, edge = _bond(rng, (n, n), stones=(rows, columns), shift=shift, wander_px=wander_px)
    image = look[0] + look[1] * tone + grain * noise(rng, (n, n), power=0.5, finest_px=2.5)
    image += 0.02 * noise(rng, (n, n), power=1.5, finest_px=30)
    joint = np.clip((edge - 0.5 * joint_px) / 3.0, 0, 1)
    sand = 0.3 + 0.05 * noise(rng, (n, n), power=0.3, finest_px=2)
    # Worn edges catch the light a little.
    image += 0.03 * np.exp(-(((edge - joint_px) / 4.0) ** 2))
    return Texture(to_image((joint * image + (1 - joint) * sand).astype(np.float32)), (2.0, 2.0))


def _bond(
    rng: np.random.Generator, shape: tuple[int, int], *, stones: tuple[int, int], shift: float, wander_px: float = 0.0
) -> tuple[FloatImage, FloatImage]:
    """Shade of the stone (H, W), about -1 to 1, and the distance to its edge [px], of rows of stones that tile."""
    rows, columns = stones
    y, x = np.meshgrid(*(np.arange(n, dtype=np.float32) for n in shape), indexing="ij")
    if wander_px > 0:
        x = x + wander_px * noise(rng, shape, power=1.0, finest_px=45)
        y = y + wander_px * noise(rng, shape, power=1.0, finest_px=45)
    v = y * (rows / shape[0])
    row = np.floor(v)
    u = x * (columns / shape[1]) + shift * (row % 2)
    column = np.floor(u)
    tones = np.clip(rng.normal(0, 1, (rows, columns)), -2, 2).astype(np.float32)
    tone = tones[row.astype(int) % rows, column.astype(int) % columns]
    across = np.minimum(u - column, column + 1 - u) * (shape[1] / columns)
    along = np.minimum(v - row, row + 1 - v) * (shape[0] / rows)
    return tone, np.minimum(across, along).astype(np.float32)


def _grains(rng: np.random.Generator, n: int, *, base: float, spread: float) -> FloatImage:
    """Crystals of three kinds."""
    a, b = (noise(rng, (n, n), power=0.3, finest_px=3) for _ in range(2))
    image: FloatImage = (base + spread * a - 0.14 * (b > 1.4) + 0.02 * noise(rng, (n, n), power=1.5)).astype(np.float32)
    return image
