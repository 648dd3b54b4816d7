"""The convex function whose minimum is the robot's velocity after a step (see tyres), and Newton's way to it."""

from typing import NamedTuple

import numpy as np

from stereogrid.geometry import Array

from ..kernel import kernel

MOST_ITERATIONS = 50
ENOUGH_MPS = 1e-9


@kernel
def huber(x: float, small: float) -> float:
    """|x| rounded off below small: its gradient grows from 0 to 1 there."""
    x = abs(x)
    return x - small / 2 if x > small else x * x / (2 * small)


class Step(NamedTuple):
    """A time step, as energy reads it. The velocities (8,): of the centre of mass, angular, spins of the two sides.

    before (8,): the velocity a step ago. push (8,): impulses that do not depend on the velocity. M (8, 8): masses and
    moments. rows (K, 3, 8): slip along and across, and speed away from the ground, of each contact, from the velocity.
    load (K, 3): impulse of friction at most [Ns], of the spring and damper at rest, and their growth per m/s, 0 where
    PyBullet bears the load. spin (2, 5): target, what is missing of it at full torque, and impulses of motor and of
    rolling; the smallest spin. still: slip below which a tyre gives less than all its force [m/s].
    """

    before: Array
    push: Array
    M: Array
    rows: Array
    load: Array
    spin: Array
    still: float


@kernel
def energy(v: Array, step: Step) -> float:
    """What the velocity v (8,) minimises."""
    rows, load, spin = step.rows, step.load, step.spin
    d = v - step.before
    total: float = 0.5 * (d @ (step.M @ d)) - step.push @ v
    for k in range(len(load)):
        s, t = rows[k, 0] @ v, rows[k, 1] @ v
        total += load[k, 0] * huber(np.sqrt(s * s + t * t), step.still)
        if load[k, 2] > 0:
            total += 0.5 * max(load[k, 1] - load[k, 2] * (rows[k, 2] @ v), 0.0) ** 2 / load[k, 2]
    for j in range(2):
        total += spin[j, 2] * huber(v[6 + j] - spin[j, 0], spin[j, 1]) + spin[j, 3] * huber(v[6 + j], spin[j, 4])
    return total


@kernel
def slope(v: Array, step: Step, g: Array, H: Array) -> None:
    """The gradient g (8,) and the second derivative H (8, 8) of energy at v."""
    rows, load, spin, still = step.rows, step.load, step.spin, step.still
    g[:] = step.M @ (v - step.before) - step.push
    H[:] = step.M
    for k in range(len(load)):
        s, t = rows[k, 0] @ v, rows[k, 1] @ v
        size = np.sqrt(s * s + t * t)
        w = load[k, 0] / max(size, still)
        borne = max(load[k, 1] - load[k, 2] * (rows[k, 2] @ v), 0.0)
        g += w * (s * rows[k, 0] + t * rows[k, 1]) - borne * rows[k, 2]
        # Beyond `still` the force no longer grows along the slip, and only turns with it.
        a, b, c = (w, 0.0, w) if size <= still else (w * t * t / size**2, -w * s * t / size**2, w * s * s / size**2)
        e = load[k, 2] if borne > 0 else 0.0
        for i in range(8):
            along, across, up = rows[k, 0, i], rows[k, 1, i], e * rows[k, 2, i]
            along, across = a * along + b * across, b * along + c * across
            for j in range(8):
                H[i, j] += along * rows[k, 0, j] + across * rows[k, 1, j] + up * rows[k, 2, j]
    for j in range(2):
        for x, most, small in (
            (v[6 + j] - spin[j, 0], spin[j, 2], spin[j, 1]),
            (v[6 + j], spin[j, 3], spin[j, 4]),
        ):
            g[6 + j] += most * min(max(x / small, -1.0), 1.0)
            H[6 + j, 6 + j] += most / small if abs(x) <= small else 0.0


@kernel
def solve(H: Array, g: Array) -> Array:
    """H^-1 g of a positive definite H (N, N), by Cholesky."""
    n = len(g)
    L = np.zeros((n, n))
    x = g.copy()
    for i in range(n):
        for j in range(i + 1):
            total = H[i, j]
            for k in range(j):
                total -= L[i, k] * L[j, k]
            L[i, j] = np.sqrt(total) if i == j else total / L[j, j]
    for i in range(n):
        for k in range(i):
            x[i] -= L[i, k] * x[k]
        x[i] /= L[i, i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            x[i] -= L[k, i] * x[k]
        x[i] /= L[i, i]
    return x


@kernel
def settle(v: Array, step: Step) -> int:
    """Move v (8,) to the minimum of energy by Newton's method, each step halved until it gains; returns the steps."""
    g, H = np.empty(8), np.empty((8, 8))
    now = energy(v, step)
    for k in range(MOST_ITERATIONS):
        slope(v, step, g, H)
        d = solve(H, g)
        gain = g @ d
        share = 1.0
        while share > 1e-6:
            then = energy(v - share * d, step)
            if then <= now - 1e-4 * share * gain:
                break
            share *= 0.5
        if share <= 1e-6:
            return k
        v -= share * d
        now = then
        if np.abs(d).max() < ENOUGH_MPS:
            return k
    return MOST_ITERATIONS
