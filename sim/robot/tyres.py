"""The tyres of a skid-steered robot: the forces of one time step, as the minimum of one convex function.

Each tyre resists its slip s over the ground by a force against the direction of s, at most mu N. For such a law the
direction of slip alone decides what a turn costs: wheels b beside and a before and behind the middle must run
1 + (a / b)^2 times as fast as their places move, at every speed and on every ground.
With the loads N known from the step before, the velocities v at the end of a step minimise

    (v - v_free)' M (v - v_free) / 2 + step (sum mu N phi(|s|) + springs + rolling + motors)(v),

where phi(s) is |s|, rounded off below a small speed. Solving for the end of the step keeps it stable however light
the wheels are and however stiffly the tyres hold, and a parked robot stays where it is.

Were the law a pure |s|, the wheels that carry more would drag the middle of the turn towards them, and on a slope of
10 degrees the wheels would run only 1.2 times as fast. A tyre that is turned on its patch gives way at once, though:
while the robot turns, phi is rounded off up to `scrub_m` times its turn rate, and a turn costs the same on a slope.
"""

from dataclasses import astuple, dataclass

import numpy as np

from stereogrid.geometry import Array

from ..kernel import inner, kernel
from .newton import settle

CONTACT_NUMBERS = 7
"""A contact with a thing: its point (3,), its normal towards the robot (3,) and the load."""


@dataclass(frozen=True)
class TyreLaw:
    """The numbers of the model. The field order is that in which the kernels read them.

    friction, rolling, creep: see ground.Surface. sideways: how much better tyres hold sideways than along; its square
    root scales force and slip. still_mps: slip below which a standing tyre gives less than all its force; scrub_m: by
    how much that grows with the rate of turn. radius_m, half_width_m, spring_npm, damper_nspm: of a tyre.
    inertia_kgm2, torque_nm, gain_nms, drag_nm: of one side's wheels, the most its motor gives, what it gives per rad/s
    of missing speed, and its gears' friction. step_s: the time step. body_friction: of the body on what it touches, as
    a share of the tyres'.
    """

    friction: float
    rolling: float
    creep: float
    sideways: float
    still_mps: float
    radius_m: float
    half_width_m: float
    inertia_kgm2: float
    torque_nm: float
    gain_nms: float
    drag_nm: float
    step_s: float
    spring_npm: float
    damper_nspm: float
    scrub_m: float
    body_friction: float

    def numbers(self) -> Array:
        """(16,) as the kernels read them."""
        return np.array(astuple(self))


@inner
def cross(a: Array, b: Array) -> Array:
    """a x b of two (3,)."""
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


@kernel
def wheel_at(p: Array, wheels: Array, law: Array) -> int:
    """The number of the wheel (of wheels (W, 3)) that a point (3,) of the body's frame lies on, or -1."""
    for k in range(len(wheels)):
        beside = abs(p[1] - wheels[k, 1]) - law[6]
        out = np.hypot(p[0] - wheels[k, 0], p[2] - wheels[k, 2]) - law[5]
        if beside < 0.003 and out < 0.004:
            return k
    return -1


@inner
def rolling_arm(arm: Array, n: Array, axle: Array, law: Array) -> Array:
    """From the axle's middle to where the tyre holds, for a contact at arm (3,) with the normal n.

    A tyre touches with its whole width, wherever on it the contact was found, so it holds under its middle; but not
    where something rubs on its side.
    """
    flat = n - (n @ axle) * axle
    size = np.sqrt(flat @ flat)
    return -law[5] * flat / size if size > 0.5 else arm


@kernel
def slip_rows(point: Array, n: Array, arm: Array, axle: Array, side: int, law: Array, rows: Array) -> None:
    """Fill rows (3, 8): slip along and across the wheel and speed along n [m/s] from the velocity v (8,).

    v: of the centre of mass (3,), angular (3,), spins of the left and right wheels. point: of contact, seen from the
    centre of mass; arm: seen from the axle's middle; side: -1 where no wheel touches. The row across is scaled by the
    root of `sideways`.
    """
    along = cross(axle, n)
    size = np.sqrt(along @ along)
    # On the flat side of a wheel every direction is along it.
    along = along / size if size > 1e-3 else cross(n, np.array([n[2], n[0], n[1]]))
    along /= np.sqrt(along @ along)
    across = cross(n, along)
    for row, direction, scale in ((0, along, 1.0), (1, across, np.sqrt(law[3])), (2, n, 1.0)):
        rows[row, :] = 0.0
        rows[row, :3] = scale * direction
        rows[row, 3:6] = scale * cross(point, direction)
        if side >= 0 and row < 2:
            rows[row, 6 + side] = scale * (direction @ cross(axle, arm))


@kernel
def pose(
    frames: Array,
    spins: Array,
    loads: Array,
    feet: Array,
    contacts: Array,
    motors: Array,
    turn_radps: float,
    mass: Array,
    wheels: Array,
    law: Array,
) -> tuple[Array, Array, Array, Array, Array, Array, float]:
    """The step as newton.settle takes it: push, M, rows, load, spin, still; with the number of each row's foot or -1.

    See Tyres.step. turn_radps: how fast the body turns about its own z axis.
    """
    p_before, p_now = frames[0, :3], frames[1, :3]
    R_before, R = frames[0, 3:].copy().reshape(3, 3), frames[1, 3:].copy().reshape(3, 3)
    axle = R[:, 1].copy()
    M, push = np.zeros((8, 8)), np.zeros(8)
    push[2] = -9.81 * mass[0] * law[11]
    for i in range(3):
        M[i, i] = mass[0]
        M[6 + i % 2, 6 + i % 2] = law[7]
        for j in range(3):
            for k in range(3):
                M[3 + i, 3 + j] += R[i, k] * mass[1 + k] * R[j, k]
    most = len(feet) + len(contacts)
    rows, load, foot = np.zeros((most, 3, 8)), np.zeros((most, 3)), np.full(most, -1)
    rolling, count = np.zeros(2), 0
    for k in range(most):
        if k < len(feet):
            if np.isnan(feet[k, 6]):
                continue
            point, n, borne = feet[k, :3] - p_now, feet[k, 3:6].copy(), loads[k]
            wheel = k if k < len(wheels) else -1
            load[count, 1] = law[12] * feet[k, 6] * law[11]
            load[count, 2] = (law[12] * law[11] + law[13]) * law[11]
            foot[count] = k
        else:
            c = contacts[k - len(feet)]
            # Seen from where the body was: at 1 m/s the difference of 4 mm would tilt the robot by its own weight.
            inside = R_before.T @ (c[:3] - p_before)
            point, n, borne = R @ inside, c[3:6].copy(), c[6]
            wheel = wheel_at(inside, wheels, law)
            push[:3] += law[11] * borne * n
            push[3:6] += law[11] * borne * cross(point, n)
        side, arm = -1, np.zeros(3)
        if wheel >= 0:
            side = 0 if wheel < len(wheels) // 2 else 1
            middle = R @ wheels[wheel]
            arm = rolling_arm(point - middle, n, axle, law)
            point = middle + arm
            rolling[side] += borne
        slip_rows(point, n, arm, axle, side, law, rows[count])
        load[count, 0] = law[0] * borne * law[11] * (1.0 if wheel >= 0 else law[15])
        count += 1
    spin = np.zeros((2, 5))
    for j in range(2):
        spin[j, 0], spin[j, 1] = motors[j, 0], law[8] / law[9]
        spin[j, 2] = law[11] * law[8] * motors[j, 1]
        spin[j, 3], spin[j, 4] = law[11] * (law[1] * law[5] * rolling[j] + law[10]), law[4] / law[5]
    # One for all wheels: what differs from side to side would bend the direction of the forces.
    still = law[4] + law[2] * law[5] * 0.5 * (abs(spins[0]) + abs(spins[1])) + law[14] * abs(turn_radps)
    return push, M, rows[:count], load[:count], foot[:count], spin, still


@kernel
def outcome(v: Array, rows: Array, load: Array, foot: Array, spin: Array, still: float, loads: Array) -> Array:
    """(8,): impulses of the ground's force and torque on the body and of the motors, at the velocities v (8,).

    loads: of the feet, are set, as impulses.
    """
    out = np.zeros(8)
    loads[:] = 0.0
    for k in range(len(load)):
        s, t = rows[k, 0] @ v, rows[k, 1] @ v
        w = load[k, 0] / max(np.sqrt(s * s + t * t), still)
        out[:6] -= w * (s * rows[k, 0, :6] + t * rows[k, 1, :6])
        if foot[k] >= 0:
            borne = max(load[k, 1] - load[k, 2] * (rows[k, 2] @ v), 0.0)
            out[:6] += borne * rows[k, 2, :6]
            loads[foot[k]] = borne
    for j in range(2):
        out[6 + j] = spin[j, 2] * min(max((spin[j, 0] - v[6 + j]) / spin[j, 1], -1.0), 1.0)
    return out


class Tyres:
    """The tyres and motors of a body. spins_radps (2,): of the left and right wheels; loads_n (F,): on its feet."""

    def __init__(self, law: TyreLaw, mass: Array, wheels: Array, feet: int) -> None:
        """mass (4,): [kg], moments of inertia [kg m^2]. wheels (W, 3): in the body's frame, the left ones first.

        feet: how many places there are where the ground may bear the body: the wheels, then others.
        """
        self.spins_radps, self.loads_n, self.torques_nm = np.zeros(2), np.zeros(feet), np.zeros(2)
        self._step_s, self._law, self._mass, self._wheels = law.step_s, law.numbers(), mass, wheels

    def step(self, frames: Array, twist: Array, feet: Array, contacts: Array, motors: Array) -> Array:
        """One time step. Returns the force [N] and the torque [N m] (6,) of the ground on the body, in the world.

        frames (2, 12): centre of mass [m] and rotation, row by row, of the body before the last step and now.
        twist (6,): its velocity and angular velocity. feet (F, FOOTING_NUMBERS): its footings now. contacts
        (K, CONTACT_NUMBERS): with things, at the last step, where the body was before it. motors (2, 2): target spin
        [rad/s] and 1, or 0 when off, a side. spins_radps, loads_n and torques_nm of the motors are brought up to date.
        """
        spins, turn_radps = self.spins_radps, float(twist[3:] @ frames[1, 5::3])
        push, M, rows, load, foot, spin, still = pose(
            frames,
            self.spins_radps,
            self.loads_n,
            feet,
            contacts,
            motors,
            turn_radps,
            self._mass,
            self._wheels,
            self._law,
        )
        before = np.concatenate([twist, spins])
        v = before.copy()
        settle(v, before, push, M, rows, load, spin, still)
        impulses = outcome(v, rows, load, foot, spin, still, self.loads_n)
        self.loads_n /= self._step_s
        self.spins_radps, self.torques_nm = v[6:], impulses[6:] / self._step_s
        force: Array = impulses[:6] / self._step_s
        return force
