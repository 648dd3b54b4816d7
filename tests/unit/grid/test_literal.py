"""The literal sum of rays agrees with its NumPy twin, whatever the pose, the holes and the form of the model."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stereogrid.camera import StereoCamera
from stereogrid.grid import literal
from stereogrid.grid.blocks import BLOCK
from stereogrid.grid.view import blocks_in_view
from stereogrid.sensor_model import FORMS, SensorModel, kernel_parameters

from . import twins
from .scenes import random_disparity, random_pose

CAMERA = StereoCamera(focal_px=25, cx_px=17.3, cy_px=11.1, baseline_m=0.12, width_px=32, height_px=24)
CELL_M = 0.13

models = st.builds(
    SensorModel,
    p_free=st.floats(0.05, 0.19),
    p_occupied=st.floats(0.81, 0.98),
    prior=st.floats(0.2, 0.8),
    max_range_m=st.floats(0.5, 3.0),
    form=st.sampled_from(FORMS),
)
seeds = st.integers(0, 2**32 - 1)


def scene(seed, model):
    rng = np.random.default_rng(seed)
    disparity = random_disparity(rng, CAMERA)
    image = np.stack([disparity.disparity_px, disparity.disparity_px / disparity.sigma_px], axis=-1)
    pose = random_pose(rng, spread_m=20.0)
    blocks = blocks_in_view(CAMERA, pose, CELL_M, max_range_m=model.max_range_m)
    optics = (CAMERA.focal_px, CAMERA.cx_px, CAMERA.cy_px, CAMERA.focal_baseline_px_m)
    constants = np.array([*optics, CELL_M, model.max_range_m])
    origin = blocks.min(axis=0)
    lookup = np.full(blocks.max(axis=0) - origin + 1, -1, dtype=np.int64)
    lookup[tuple((blocks - origin).T)] = np.arange(len(blocks))
    return lookup, origin, pose, constants, image, kernel_parameters(model)


@given(seed=seeds, model=models)
@settings(max_examples=6, deadline=None, derandomize=True)
def test_the_sum_of_rays_agrees_with_its_twin(seed, model):
    lookup, *arguments = scene(seed, model)
    fast, slow = (np.full((lookup.max() + 1, BLOCK, BLOCK, BLOCK), np.nan, dtype=np.float32) for _ in range(2))
    literal.sum_rays(lookup, *arguments, fast)
    twins.sum_rays(lookup, *arguments, slow)
    assert not np.isnan(fast).all()
    # Sums of hundreds of float32 numbers of both signs, added in the same order.
    np.testing.assert_allclose(fast, slow, rtol=1e-5, atol=1e-4)


@pytest.mark.parametrize("form", FORMS)
@given(u=st.floats(-6, 6), half=st.floats(0.01, 20), model=models)
@settings(derandomize=True)
def test_the_evidence_of_one_reading_is_the_sensor_models_probability_fused(form, u, half, model):
    parameters = kernel_parameters(replace(model, form=form))
    # A cell of 2 half sigmas, a sigma being one metre, ten metres away.
    expected = twins.gain(np.float64(10 + u), 10.0, 1.0, 2 * half, parameters)
    assert literal.evidence.py_func(u, half, parameters) == pytest.approx(float(expected), rel=1e-9, abs=1e-9)
