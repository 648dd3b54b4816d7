"""Runs over marks whose odometry errs as a MotionError says."""

import numpy as np

from stereogrid.geometry import from_yaw, yaw_rad
from stereogrid.motion import MotionNoise, Run, Runs

MARKS_M = (1.0, 2.0, 3.0, 4.0, 5.0)
MARKS_RAD = tuple(np.radians([90.0, 180.0, 270.0, 360.0]))


def noisy_run(name, error, marks, rng, *, turn=False, sign=1, steps=5, **given):
    """One run, straight or on the spot: each leg in so many steps."""
    walk, T, rows = MotionNoise(error).walk(np.eye(4), rng), np.eye(4), [((0, 0, 0), (0, 0, 0))]
    heading = 0.0
    for leg in np.diff([0.0, *marks]):
        part = sign * leg / steps
        step = from_yaw(part) if turn else from_yaw(0.0, [part, 0, 0])
        for _ in range(steps):
            T, claimed, heading = T @ step, walk(step), heading + part * turn
        rows.append(((*claimed[:2, 3], yaw_rad(claimed)), (*T[:2, 3], heading)))
    odo, true = np.array(rows, dtype=float).transpose(1, 0, 2)
    return Run(name, odo, true, **given)


def noisy_runs(error, count, rng, *, turns=0, steps=5):
    """count straight runs and so many turns over the usual marks, every other one the other way."""
    straight = [noisy_run(f"s{n}", error, MARKS_M, rng, sign=(-1) ** n, steps=steps) for n in range(count)]
    spun = [noisy_run(f"t{n}", error, MARKS_RAD, rng, turn=True, sign=(-1) ** n, steps=steps) for n in range(turns)]
    return Runs((*straight, *spun))
