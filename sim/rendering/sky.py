"""What the renderer's kernels know of the sky."""

import numpy as np

from stereogrid.geometry import FloatArray

from ..scene.scene import Sky, World
from .atlas import Atlas


def sky_numbers(world: World, atlas: Atlas) -> FloatArray:
    """(11,) what the kernel needs: whether there is a sky, horizon and zenith (0 to 255), direction of the sun (3,),
    whether it shines, first and past-the-last level of the clouds' texture (0, 0 for none), its tiles per unit.

    The layer of clouds is one unit high: a tile of size_m 1 spans 45 degrees from the zenith.
    """
    sky = world.sky
    if sky is None:
        return np.zeros(11)
    span, size = (0, 0), (1.0, 1.0)
    if sky.clouds:
        span, size = atlas.spans[sky.clouds], world.textures[sky.clouds].size_m
    sun = sun_of(sky)
    shines = float(sky.sun_power > 0)
    return np.array([1.0, 255 * sky.horizon, 255 * sky.zenith, *sun, shines, *span, 1 / size[0], 1 / size[1]])


def sun_of(sky: Sky) -> FloatArray:
    """Unit vector (3,) towards the sun."""
    sun: FloatArray = np.array(sky.sun_direction, np.float64)
    sun /= np.linalg.norm(sun)
    return sun
