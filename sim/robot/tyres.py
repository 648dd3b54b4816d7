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

from typing import NamedTuple

import numpy as np

from stereogrid.geometry import Array

from ..kernel import inner, kernel
from .newton import Step, settle

CONTACT_NUMBERS = 7
"""A contact with a thing: its point (3,), its normal towards the robot (3,) and the load."""


class TyreLaw(NamedTuple):
    """The numbers of the model.

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


class Moment(NamedTuple):
    """The robot before a step: see Tyres.step. spins_radps (2,), loads_n (F,): of the wheels and on the feet."""

    frames: Array
    twist: Array
    spins_radps: Array
    loads_n: Array
    feet: Array
    contacts: Array
    motors: Array


class Holds(NamedTuple):
    """Where K places hold the robot, as far as they are found: rows and load of a Step, and the number of each place's
    foot or -1; rolling (2,): what the wheels of each side bear [N]."""

    rows: Array
    load: Array
    foot: Array
    rolling: Array


@inner
def cross(a: Array, b: Array) -> Array:
    """a x b of two (3,)."""
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


@kernel
def wheel_at(p: Array, wheels: Array, law: TyreLaw) -> int:
    """The number of the wheel (of wheels (W, 3)) that a point (3,) of the body's frame lies on, or -1."""
    for k in range(len(wheels)):
        beside = abs(p[1] - wheels[k, 1]) - law.half_width_m
        out = np.hypot(p[0] - wheels[k, 0], p[2] - wheels[k, 2]) - law.radius_m
        if beside < 0.003 and out < 0.004:
            return k
    return -1


@inner
def rolling_arm(arm: Array, n: Array, axle: Array, law: TyreLaw) -> Array:
    """From the axle's middle to where the tyre holds, for a contact at arm (3,) with the normal n.

    A tyre touches with its whole width, wherever on it the contact was found, so it holds under its middle; but not
    where something rubs on its side.
    """
    flat = n - (n @ axle) * axle
    size = np.sqrt(flat @ flat)
    return -law.radius_m * flat / size if size > 0.5 else arm


@kernel
def slip_rows(point: Array, n: Array, arm: Array, axle: Array, side: int, law: TyreLaw, rows: Array) -> None:
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
    for row, direction, scale in ((0, along, 1.0), (1, across, np.sqrt(law.sideways)), (2, n, 1.0)):
        rows[row, :] = 0.0
        rows[row, :3] = scale * direction
        rows[row, 3:6] = scale * cross(point, direction)
        if side >= 0 and row < 2:
            rows[row, 6 + side] = scale * (direction @ cross(axle, arm))


@inner
def masses(R: Array, mass: Array, law: TyreLaw) -> Array:
    """M of a Step, of a body turned by R (3, 3)."""
    M = np.zeros((8, 8))
    for i in range(3):
        M[i, i] = mass[0]
        M[6 + i % 2, 6 + i % 2] = law.inertia_kgm2
        for j in range(3):
            for k in range(3):
                M[3 + i, 3 + j] += R[i, k] * mass[1 + k] * R[j, k]
    return M


@inner
def spin_laws(motors: Array, rolling: Array, law: TyreLaw) -> Array:
    """spin of a Step; rolling (2,): what the wheels of each side bear [N]."""
    spin = np.zeros((2, 5))
    for j in range(2):
        spin[j, 0], spin[j, 1] = motors[j, 0], law.torque_nm / law.gain_nms
        spin[j, 2] = law.step_s * law.torque_nm * motors[j, 1]
        spin[j, 3] = law.step_s * (law.rolling * law.radius_m * rolling[j] + law.drag_nm)
        spin[j, 4] = law.still_mps / law.radius_m
    return spin


@kernel
def hold(
    count: int, place: tuple[Array, Array, float, int], R: Array, wheels: Array, law: TyreLaw, holds: Holds
) -> None:
    """Fill row `count` of holds with a place that bears the robot: point, seen from the centre of mass, normal, load
    [N] and the number of the wheel that it bears or -1."""
    point, n, borne, wheel = place
    axle = R[:, 1].copy()
    side, arm = -1, np.zeros(3)
    if wheel >= 0:
        side = 0 if wheel < len(wheels) // 2 else 1
        middle = R @ wheels[wheel]
        arm = rolling_arm(point - middle, n, axle, law)
        point = middle + arm
        holds.rolling[side] += borne
    slip_rows(point, n, arm, axle, side, law, holds.rows[count])
    holds.load[count, 0] = law.friction * borne * law.step_s * (1.0 if wheel >= 0 else law.body_friction)


@kernel
def step_of(moment: Moment, mass: Array, wheels: Array, law: TyreLaw) -> tuple[Step, Array]:
    """The step as newton.settle takes it, and the number of each row's foot or -1."""
    feet, contacts, spins = moment.feet, moment.contacts, moment.spins_radps
    p_before, p_now = moment.frames[0, :3], moment.frames[1, :3]
    R_before, R = moment.frames[0, 3:].copy().reshape(3, 3), moment.frames[1, 3:].copy().reshape(3, 3)
    push = np.zeros(8)
    push[2] = -9.81 * mass[0] * law.step_s
    most = len(feet) + len(contacts)
    holds, count = Holds(np.zeros((most, 3, 8)), np.zeros((most, 3)), np.full(most, -1), np.zeros(2)), 0
    for k in range(len(feet)):
        if np.isnan(feet[k, 6]):
            continue
        holds.load[count, 1] = law.spring_npm * feet[k, 6] * law.step_s
        holds.load[count, 2] = (law.spring_npm * law.step_s + law.damper_nspm) * law.step_s
        holds.foot[count] = k
        place = (feet[k, :3] - p_now, feet[k, 3:6].copy(), moment.loads_n[k], k if k < len(wheels) else -1)
        hold(count, place, R, wheels, law, holds)
        count += 1
    for k in range(len(contacts)):
        n, borne = contacts[k, 3:6].copy(), contacts[k, 6]
        # Seen from where the body was: at 1 m/s the difference of 4 mm would tilt the robot by its own weight.
        inside = R_before.T @ (contacts[k, :3] - p_before)
        point = R @ inside
        push[:3] += law.step_s * borne * n
        push[3:6] += law.step_s * borne * cross(point, n)
        hold(count, (point, n, borne, wheel_at(inside, wheels, law)), R, wheels, law, holds)
        count += 1
    # How fast the body turns about its own z axis.
    turn_radps = moment.twist[3:] @ R[:, 2].copy()
    # One for all wheels: what differs from side to side would bend the direction of the forces.
    still = (
        law.still_mps + law.creep * law.radius_m * 0.5 * (abs(spins[0]) + abs(spins[1])) + law.scrub_m * abs(turn_radps)
    )
    before = np.concatenate((moment.twist, spins))
    spin = spin_laws(moment.motors, holds.rolling, law)
    step = Step(before, push, masses(R, mass, law), holds.rows[:count], holds.load[:count], spin, still)
    return step, holds.foot[:count]


@kernel
def outcome(v: Array, step: Step, foot: Array, loads: Array) -> Array:
    """(8,): impulses of the ground's force and torque on the body and of the motors, at the velocities v (8,).

    loads: of the feet, are set, as impulses.
    """
    rows, load, spin = step.rows, step.load, step.spin
    out = np.zeros(8)
    loads[:] = 0.0
    for k in range(len(load)):
        s, t = rows[k, 0] @ v, rows[k, 1] @ v
        w = load[k, 0] / max(np.sqrt(s * s + t * t), step.still)
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
        self._law, self._mass, self._wheels = law, mass, wheels

    def step(self, frames: Array, twist: Array, feet: Array, contacts: Array, motors: Array) -> Array:
        """One time step. Returns the force [N] and the torque [N m] (6,) of the ground on the body, in the world.

        frames (2, 12): centre of mass [m] and rotation, row by row, of the body before the last step and now.
        twist (6,): its velocity and angular velocity. feet (F, FOOTING_NUMBERS): its footings now. contacts
        (K, CONTACT_NUMBERS): with things, at the last step, where the body was before it. motors (2, 2): target spin
        [rad/s] and 1, or 0 when off, a side. spins_radps, loads_n and torques_nm of the motors are brought up to date.
        """
        moment = Moment(frames, twist, self.spins_radps, self.loads_n, feet, contacts, motors)
        step, foot = step_of(moment, self._mass, self._wheels, self._law)
        v = step.before.copy()
        settle(v, step)
        impulses = outcome(v, step, foot, self.loads_n)
        self.loads_n /= self._law.step_s
        self.spins_radps, self.torques_nm = v[6:], impulses[6:] / self._law.step_s
        force: Array = impulses[:6] / self._law.step_s
        return force
