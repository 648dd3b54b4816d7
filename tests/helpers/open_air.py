"""A small world under a sunny sky, to test the renderer with: hills, boxes, leaves, glass, varnish, a walker."""

import numpy as np

from sim.scene.movers import Mover
from sim.scene.scene import Sky, World
from sim.scene.solids import Face, Paint, Solid, box, drum
from sim.scene.terrain import Terrain
from sim.scene.textures import Texture, noise, to_image

SUN = np.array([-0.5, 0.6, 0.9]) / np.linalg.norm([-0.5, 0.6, 0.9])
SKY = Sky(clouds="clouds", sun_direction=(float(SUN[0]), float(SUN[1]), float(SUN[2])), sun_power=1.3)


def textures(rng: np.random.Generator) -> dict[str, Texture]:
    def plain(mean: float, spread: float, size_m: float = 1.0, **more: float | bool) -> Texture:
        return Texture(
            to_image(mean + spread * noise(rng, (256, 256), power=0.7, finest_px=2)), (size_m, size_m), **more
        )

    return {
        "ground": plain(0.5, 0.08, 2.0),
        "leaf": plain(0.35, 0.06, 0.2),
        "bark": plain(0.3, 0.06),
        "plaster": plain(0.7, 0.04),
        "paint": plain(0.4, 0.01, gloss=0.06),
        "mirror": plain(0.05, 0.0, gloss=1.0),
        "pane": plain(0.03, 0.005, gloss=0.04, clear=True),
        "clouds": Texture(to_image(0.25 + 0.25 * noise(rng, (512, 512), power=1.6, finest_px=3)), (4.0, 4.0)),
    }


def hills(half_m: float, pitch_m: float = 0.5) -> Terrain:
    x = np.arange(-half_m, half_m + pitch_m / 2, pitch_m)
    heights = 0.15 * np.sin(x[None, :] / 2.5) * np.cos(x[:, None] / 3.0)
    # The robot's path, along +x, is nearly level.
    heights = heights * np.clip((np.abs(x)[:, None] - 0.5) / 2.0, 0.2, 1.0)
    return Terrain(heights, (-half_m, -half_m), pitch_m, "ground")


def leaves(rng: np.random.Generator, center_m: tuple[float, float, float], count: int, radius_m: float) -> Solid:
    """A crown of thin tetrahedra, as one solid."""
    at = rng.normal(size=(count, 3))
    at *= (radius_m * rng.uniform(0.4, 1.0, count) / np.linalg.norm(at, axis=1))[:, None]
    tips = rng.normal(size=(count, 4, 3)) * [0.05, 0.05, 0.012] + at[:, None] + center_m
    faces, vertices = [], tips.reshape(-1, 3)
    for k in range(count):
        p = tips[k]
        turn = np.linalg.det(p[1:] - p[0]) > 0
        for a, b, c in (
            ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)) if turn else ((0, 1, 2), (0, 3, 1), (0, 2, 3), (1, 3, 2))
        ):
            s = p[b] - p[a]
            s /= np.linalg.norm(s)
            normal = np.cross(p[b] - p[a], p[c] - p[a])
            t = np.cross(s, normal / np.linalg.norm(normal))
            faces.append(Face((4 * k + a, 4 * k + b, 4 * k + c), tuple(s), tuple(t), "leaf", (0.0, 0.0), None))
    return Solid("crown", vertices, tuple(faces))


def open_air(n_leaves: int = 150, n_trees: int = 4, half_m: float = 12.0) -> World:
    """Trees of so many leaves on a square of hills."""
    rng = np.random.default_rng(5)
    terrain = hills(half_m)
    solids = [terrain.solid()]
    for k in range(n_trees):
        x, y = float(rng.uniform(3, half_m - 2)), float(rng.choice([-1, 1]) * rng.uniform(1.5, half_m / 2))
        z = float(terrain.height_m([x, y]))
        solids.append(drum(f"trunk {k}", (x, y, z - 0.1), (0.12, 0.08), 1.6, paint=Paint("bark")))
        solids.append(leaves(rng, (x, y, z + 2.2), n_leaves, 0.9))
    solids += [
        box("house", (half_m - 2, -6, -0.5), (half_m - 1.5, 6, 4), Paint("plaster")),
        box("crate", (3.0, -1.2, -0.2), (3.5, -0.7, 0.4), Paint("plaster")),
        box("car", (4.5, 0.9, -0.1), (6.5, 2.0, 0.9), Paint("paint")),
        box("mirror", (5.0, -2.2, 0.0), (6.4, -2.15, 1.2), Paint("mirror")),
        box("pane", (2.4, 0.3, -0.1), (2.41, 1.1, 0.9), Paint("pane")),
    ]
    walker = Mover(
        "walker",
        (box("body", (-0.15, -0.2, 0.0), (0.15, 0.2, 1.2), Paint("bark")),),
        np.array([[4.0, -1.0], [4.0, 1.0]]),
        0.5,
    )
    path = np.array([[0.0, 0.0], [half_m - 3, 0.0]])
    return World("open air", 0, tuple(solids), textures(rng), (), path, sky=SKY, terrain=terrain, movers=(walker,))
