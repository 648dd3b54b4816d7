"""The method on one screen: match, model, integrate."""

from typing import Any

from .camera import StereoCamera
from .errors import InvalidInputError
from .grid import OccupancyGrid
from .matching.correlation import ErrorReach
from .motion import MotionError, PoseUncertainty
from .novelty import Novelty
from .observation import Disparity, Matcher, Observation
from .sensor_model import MOTION_RULES
from .submaps import Submaps


class Mapper:
    """Turns observations, in their order, into a map. camera: the rectified pair they come from.

    matcher: None takes the disparities that the observations themselves carry.
    reach: how far the matcher's errors go together in time; None: every observation counts in full.
    """

    def __init__(
        self,
        camera: StereoCamera,
        matcher: Matcher | None,
        grid: OccupancyGrid,
        motion_error: MotionError | None = None,
        *,
        reach: ErrorReach | None = None,
    ) -> None:
        grid.check_fits(camera)
        self.camera, self.matcher, self.grid = camera, matcher, grid
        self.motion_error = motion_error or MotionError()
        self._uncertainty = PoseUncertainty(self.motion_error)
        # Where poses are exact there is nothing to lay elsewhere, and the grid's clamp acts observation by observation.
        pieces = self.motion_error.way == "submaps" and not self.motion_error.is_zero
        self._submaps = Submaps(camera, grid, self.motion_error) if pieces else None
        self.novelty = Novelty(camera, reach)

    def step(self, observation: Observation) -> Disparity:
        """Fuse one observation into the grid and return its disparity."""
        disparity = self.disparity(observation)
        self.fuse(observation, disparity)
        return disparity

    def disparity(self, observation: Observation) -> Disparity:
        """The matcher's, or the observation's own; InvalidInputError where it has none."""
        if self.matcher is not None:
            return self.matcher.match(observation.left, observation.right)
        if observation.disparity is None:
            raise InvalidInputError(f"the observation at {observation.stamp_s} s carries no disparity: give a matcher")
        return observation.disparity

    def fuse(self, observation: Observation, disparity: Disparity) -> None:
        """Fuse an observation whose disparity is already known."""
        weight = self.novelty.weight(disparity, observation.T_world_cam)
        if self._submaps:
            self._submaps.fuse(observation, disparity, weight)
            return
        motion = self._motion(observation)
        self.grid.integrate(self.camera, disparity, observation.T_world_cam, weight=weight, **motion)

    def finish(self) -> None:
        """Call it after the last observation: what the way "submaps" still holds back goes into the grid."""
        if self._submaps:
            self._submaps.finish()

    def _motion(self, observation: Observation) -> dict[str, Any]:
        """What the grid is told of the error of the pose, as OccupancyGrid.integrate takes it."""
        way = self.motion_error.way
        if way == "pose":
            return {"pose_covariance": self._uncertainty.step(observation)}
        if way in MOTION_RULES:
            return {"motion_sigma_m": self.motion_error.sigma_m(observation.odometry), "motion_rule": way}
        return {}
