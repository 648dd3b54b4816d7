"""How the controller moves the robot: goals, ramps, stalls, motors on and off. SI units; time is a count of ticks."""

from dataclasses import dataclass
from math import copysign, sqrt

from .senses import Senses, Wheels

STALL_REST_S = 1.0
"""After a stall the motors rest for this long before they try again."""
SOFTNESS_PER_S = 4.0
"""Near the end of a MOVE or a turn the speed is this much times what is left, so that it ends without overshoot."""
BUMP_FRONT, BUMP_REAR = 1, 2


@dataclass
class Axis:
    """Driving or turning: a rate (m/s or rad/s) that ramps towards its goal.

    top: the highest that `rate_max` may be set to. exact: the distance from the end of a journey that is near enough.
    """

    top: float
    top_ramp: float
    rate_max: float
    acceleration: float
    deceleration: float
    exact: float
    rate: float = 0.0
    _goal: float = 0.0
    _left: float | None = None

    def go(self, rate: float) -> None:
        """Go on at this rate, as far as it is allowed."""
        self._goal, self._left = rate, None

    def travel(self, distance: float) -> None:
        """Go this far and stay there."""
        self._goal, self._left = 0.0, distance

    def freeze(self) -> None:
        """Forget every goal and be at rest at once."""
        self.go(0.0)
        self.rate = 0.0

    @property
    def wanted(self) -> float:
        """The rate that the goal asks for now, before any ramp."""
        if self._left is None:
            return max(-self.rate_max, min(self._goal, self.rate_max))
        far = abs(self._left)
        if far < self.exact:
            return 0.0
        # 0.9: room for what the ticks round off.
        return copysign(min(self.rate_max, sqrt(1.8 * self.deceleration * far), SOFTNESS_PER_S * far), self._left)

    def set_rate_max(self, rate: float) -> None:
        """SETV and SETRV."""
        self.rate_max = min(abs(rate), self.top)

    def set_ramp(self, ramp: float) -> None:
        """SETA and SETRA: negative sets the deceleration. Zero, which would never arrive, changes nothing."""
        if ramp > 0:
            self.acceleration = min(ramp, self.top_ramp)
        elif ramp < 0:
            self.deceleration = min(-ramp, self.top_ramp)

    def advance(self, tick_s: float, moved: float, *, paused: bool) -> None:
        """One tick in which the robot moved by `moved`; when paused it comes to rest and keeps its goal."""
        if self._left is not None:
            self._left -= moved
        wanted = 0.0 if paused else self.wanted
        slows = abs(wanted) < abs(self.rate) or wanted * self.rate < 0
        step = (self.deceleration if slows else self.acceleration) * tick_s
        # A reversal comes to rest first: the other way is for the next tick, with the other ramp.
        target = 0.0 if wanted * self.rate < 0 else wanted
        self.rate += max(-step, min(target - self.rate, step))


@dataclass
class Motion:
    """The motors' state: off at first, and off after an emergency stop until they are enabled again.

    driving, turning: the two axes. bump_stall: which bumpers stop the robot (BUMPSTALL). fallen: it lies, and nothing
    puts it on its wheels: an emergency stop that ENABLE does not end, and both motors stalled.
    stalled: the left and the right motor's bits, held while they rest.
    """

    driving: Axis
    turning: Axis
    tick_s: float
    bump_stall: int = BUMP_FRONT | BUMP_REAR
    motors_on: bool = False
    e_stopped: bool = False
    fallen: bool = False
    stalled: tuple[bool, bool] = (False, False)
    _rest_s: float = 0.0

    @property
    def wheels(self) -> Wheels:
        """What the wheels shall do in the next tick. An emergency stop brakes; motors that are just off roll free."""
        return Wheels(self.driving.rate, self.turning.rate, powered=self.motors_on or self.e_stopped)

    def enable(self, on: bool) -> None:
        """ENABLE: motors on ends an emergency stop too. Nothing moves by it."""
        if not self.fallen:
            self.motors_on = on
            self.e_stopped = self.e_stopped and not on
            self.freeze()

    def emergency_stop(self) -> None:
        """E_STOP: at rest at once, and deaf until the motors are enabled."""
        self.motors_on, self.e_stopped = False, True
        self.freeze()

    def fall(self) -> None:
        """The robot fell: that is for good."""
        self.fallen = True
        self.emergency_stop()

    def freeze(self) -> None:
        """Forget what was commanded."""
        self.driving.freeze()
        self.turning.freeze()
        self.stalled, self._rest_s = (self.fallen, self.fallen), 0.0

    def advance(self, senses: Senses, turned_rad: float, *, paused: bool) -> None:
        """One tick, in which the heading changed by turned_rad; paused: nobody is there to answer for the motion."""
        moved_m = 0.5 * (senses.left_mps + senses.right_mps) * self.tick_s
        if self.motors_on:
            self._feel(senses)
        resting = paused or self._rest_s > 0
        if self._rest_s > 0:
            self.driving.rate = self.turning.rate = 0.0
        self.driving.advance(self.tick_s, moved_m, paused=resting)
        self.turning.advance(self.tick_s, turned_rad, paused=resting)

    def _feel(self, senses: Senses) -> None:
        self._rest_s = max(self._rest_s - self.tick_s, 0.0)
        if self._rest_s < 1e-9:
            self._rest_s, self.stalled = 0.0, (False, False)
        stalled = (True, True) if self._bumped(senses) else senses.stalled
        if any(stalled):
            self.stalled, self._rest_s = stalled, STALL_REST_S

    def _bumped(self, senses: Senses) -> bool:
        """Whether the robot is about to drive on against what one of its bumpers touches."""
        ahead = senses.front_bumpers and self.bump_stall & BUMP_FRONT and self.driving.wanted > 0
        behind = senses.rear_bumpers and self.bump_stall & BUMP_REAR and self.driving.wanted < 0
        return bool(ahead or behind)
