"""The covariance of each pose of a drive, carried along from where the pose was last certain."""

import numpy as np

from ..geometry import FloatArray, from_yaw, inverse, yaw_rad
from ..observation import Observation
from .error import MotionError

X, Y, HEADING, SCALE, DRIFT, BEND, TURN = range(7)
"""Errors of x, y [m] and heading [rad]; and what a run keeps: scale, sideways drift [1], bend [rad/m], turn scale."""


class PoseUncertainty:
    """Follows one drive, in order, and says how well its poses are known.

    To first order, as in the prediction of an extended Kalman filter, with the run's constant errors (`Growth.b`) as
    four more states, so that they add up along the way as they do (Thrun, Burgard and Fox, Probabilistic Robotics,
    chapters 3 and 5). It begins anew where the odometry's travelled_m falls: there the pose was known again.

    Ways and turns are those between claimed poses: where these jitter (position_m, heading_rad) and errors grow as
    well, both seem longer than they are, and too much is claimed (readings each .25 m that jitter by .08 m and a
    degree: 3 times the variance of the heading after 10 m straight on).
    """

    def __init__(self, error: MotionError) -> None:
        self.error = error
        self._before: Observation | None = None
        self._P = self._certain()

    def _certain(self) -> FloatArray:
        kept = (self.error.along.b, self.error.across.b, self.error.heading.b, self.error.turn.b)
        return np.diag(np.square([0.0, 0.0, 0.0, *kept]))

    def step(self, observation: Observation) -> FloatArray:
        """The covariance (6, 6) of this observation's T_world_cam, which must be the odometry's.

        Of the camera's position [m] and then of a small turn about it [rad], both along the axes of world: the true
        camera sees p at p + position + turn x (p - camera). Only x, y and the heading err.
        """
        before, self._before = self._before, observation
        odometry = observation.odometry
        if before is None or odometry.travelled_m < before.odometry.travelled_m:
            self._P = self._certain()
        else:
            self._predict(before.odometry.T_odom_base, odometry.T_odom_base)
        return self._of_camera(observation)

    def _predict(self, T_odom_before: FloatArray, T_odom_base: FloatArray) -> None:
        step = inverse(T_odom_before) @ T_odom_base
        path_m, turn_rad = float(np.linalg.norm(step[:3, 3])), yaw_rad(step)
        # A step that turns goes, on the whole, where its middle heads for.
        forward, left = (T_odom_before @ from_yaw(0.5 * turn_rad))[:2, :2].T
        move = T_odom_base[:2, 3] - T_odom_before[:2, 3]
        aside = np.array([-move[1], move[0]])
        F = np.eye(7)
        F[:2, HEADING], F[:2, SCALE], F[:2, DRIFT] = aside, move, left * path_m
        F[HEADING, BEND], F[HEADING, TURN] = path_m, turn_rad
        # What a heading errs by more and more during a step, the step's end is displaced by half of.
        F[:2, BEND], F[:2, TURN] = 0.5 * path_m * aside, 0.5 * turn_rad * aside
        e = self.error
        Q = np.zeros((7, 7))
        Q[:2, :2] = path_m * (e.along.a * np.outer(forward, forward) + e.across.a * np.outer(left, left))
        # The mean of a random walk has a third of the variance of its end, and half of it in common with it.
        wander = e.heading.a * path_m + e.turn.a * abs(turn_rad)
        Q[:2, :2] += wander / 3 * np.outer(aside, aside)
        Q[:2, HEADING] = Q[HEADING, :2] = wander / 2 * aside
        Q[HEADING, HEADING] = wander
        self._P = F @ self._P @ F.T + Q

    def _of_camera(self, observation: Observation) -> FloatArray:
        e = self.error
        planar = self._P[:3, :3] + np.diag(np.square([e.position_m, e.position_m, e.heading_rad]))
        lever = observation.T_world_cam[:2, 3] - observation.odometry.T_odom_base[:2, 3]
        J = np.zeros((6, 3))
        J[0, X] = J[1, Y] = J[5, HEADING] = 1
        J[:2, HEADING] = -lever[1], lever[0]
        covariance: FloatArray = e.kappa**2 * (J @ planar @ J.T)
        return covariance
