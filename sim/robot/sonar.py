"""The sixteen sonars: each a cone of rays, of which the nearest that comes back counts."""

from dataclasses import dataclass

import numpy as np

from stereogrid.errors import InvalidInputError
from stereogrid.geometry import FloatArray, transform

from ..bullet import pybullet

# x, y [mm] and heading [degrees]: the front ring from left to right, the rear one on round from right to left.
_RING = (
    *((147, 136, 90), (193, 119, 50), (227, 79, 30), (245, 27, 10)),
    *((245, -27, -10), (227, -79, -30), (193, -119, -50), (147, -136, -90)),
    *((-144, -136, -90), (-189, -119, -130), (-223, -79, -150), (-241, -27, -170)),
    *((-241, 27, 170), (-223, 79, 150), (-189, 119, 130), (-144, 136, 90)),
)
FRONT_Z_M, REAR_Z_M = 0.25, 0.247
SONARS = len(_RING)
NEAREST_M, FARTHEST_M = 0.15, 5.0
BEHIND_M = 0.1
HALF_CONE_RAD = np.radians(15.0)
HEARD_RAD = np.radians(40.0)
"""A smooth wall that is hit at a larger angle from its normal reflects the sound away."""
PLACES_M: FloatArray = np.array([(x / 1e3, y / 1e3, FRONT_Z_M if x > 0 else REAR_Z_M) for x, y, _ in _RING])
"""(16, 3) in base [m]."""
HEADINGS_RAD: FloatArray = np.radians([heading for *_, heading in _RING])
"""(16,) about z, from straight ahead to the left."""


@dataclass(frozen=True)
class SonarNoise:
    """spread: standard deviation of a range as a share of it. missed: share of the echoes that are not heard."""

    spread: float = 0.0
    missed: float = 0.0

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not 0 <= value < 1:
                raise InvalidInputError(f"{name} of the sonars must be in [0, 1), not {value}")

    def applied(self, ranges_m: FloatArray, rng: np.random.Generator) -> FloatArray:
        """The ranges (16,) as these sonars would give them."""
        spread = ranges_m * (1 + self.spread * rng.standard_normal(ranges_m.shape))
        heard = (ranges_m < FARTHEST_M) & (rng.random(ranges_m.shape) >= self.missed)
        return np.where(heard, np.clip(spread, NEAREST_M, FARTHEST_M), FARTHEST_M)


def ping(T_world_base: FloatArray, client: int, group: int) -> FloatArray:
    """Ranges (16,) [m] of all sonars from a pose (4, 4), FARTHEST_M where nothing is heard.

    Only bodies in the collision group are heard, the robot being in none of it.
    """
    direction = (_RAYS @ T_world_base[:3, :3].T).reshape(-1, 3)
    # From a little behind, so that what presses on the robot is hit from outside.
    start = np.repeat(transform(T_world_base, PLACES_M), len(_FAN), axis=0) - BEHIND_M * direction
    end = start + (BEHIND_M + FARTHEST_M) * direction
    hits = []
    for chunk in np.array_split(np.arange(len(start)), -(-len(start) // pybullet.MAX_RAY_INTERSECTION_BATCH_SIZE)):
        hits += pybullet.rayTestBatch(
            start[chunk].tolist(),
            end[chunk].tolist(),
            numThreads=1,
            collisionFilterMask=group,
            physicsClientId=client,
        )
    body = np.array([hit[0] for hit in hits])
    distance = np.array([hit[2] for hit in hits]) * (BEHIND_M + FARTHEST_M) - BEHIND_M
    normal = np.array([hit[4] for hit in hits])
    heard = (body >= 0) & (-np.einsum("ij,ij->i", normal, direction) >= np.cos(HEARD_RAD))
    nearest: FloatArray = np.where(heard, distance, FARTHEST_M).reshape(SONARS, -1).min(axis=1)
    return np.maximum(nearest, NEAREST_M)


def _fan() -> FloatArray:
    """Directions (N, 3) of the rays in a cone about x: dense sideways, so that a lamp post is not missed at 3 m."""
    rays = []
    for up, step in ((0.0, 1.0), (-5.0, 2.5), (5.0, 2.5), (-10.0, 5.0), (10.0, 5.0), (-15.0, 15.0), (15.0, 15.0)):
        half = np.sqrt(max(np.degrees(HALF_CONE_RAD) ** 2 - up**2, 0.0))
        count = int(half // step)
        rays += [(up, side) for side in step * np.arange(-count, count + 1)]
    elevation, azimuth = np.radians(rays).T
    return np.stack(
        [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)], axis=1
    )


_FAN: FloatArray = _fan()
_RAYS: FloatArray = np.stack(
    [
        np.stack([c * _FAN[:, 0] - s * _FAN[:, 1], s * _FAN[:, 0] + c * _FAN[:, 1], _FAN[:, 2]], axis=1)
        for c, s in zip(np.cos(HEADINGS_RAD), np.sin(HEADINGS_RAD), strict=True)
    ]
)
"""(16, N, 3) in base."""
