"""Rays at a box whose faces are known."""

import numpy as np
import pytest

from stereogrid.geometry import from_yaw
from stereogrid.scoring import RayCaster
from stereogrid.scoring.casting import FAR_M

pytest.importorskip("embreex", reason="rays are cast by embree")


def test_rays_tell_lengths_of_their_directions_and_normals_of_what_they_meet(box):
    caster = RayCaster(box((1, -1, -1), (2, 1, 1)))
    directions = [[1, 0, 0], [0.5, 0.1, 0], [-1, 0, 0]]
    lengths = caster.lengths([0, 0, 0], directions)
    assert lengths[:2] == pytest.approx([1, 2]) and lengths[2] > FAR_M
    same, normal = caster.hits([0, 0, 0], directions)
    np.testing.assert_array_equal(same, lengths)
    np.testing.assert_allclose(np.abs(normal), [[1, 0, 0], [1, 0, 0], 3 * [np.nan]])


def test_each_ray_may_have_its_own_origin(box):
    caster = RayCaster(box((1, -1, -1), (2, 1, 1)))
    assert caster.lengths([[0, 0, 0], [0.5, 0, 0]], 2 * [[1, 0, 0]]) == pytest.approx([1, 0.5])


def test_far_from_the_origin_rays_are_as_exact(box):
    away_m = np.array([30_000.0, -20_000.0, 500.0])
    turned = box((1, -1, -1), (2, 1, 1))
    turned.apply_transform(from_yaw(0.3))
    moved = turned.copy()
    moved.apply_translation(away_m)
    toward = np.random.default_rng(0).normal([3, 1, 0], 0.3, (100, 3))
    here, there = RayCaster(turned).lengths([0, 0, 0], toward), RayCaster(moved).lengths(away_m, toward)
    np.testing.assert_allclose(there, here, rtol=1e-5)
