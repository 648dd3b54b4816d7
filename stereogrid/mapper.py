"""The method on one screen: match, model, integrate."""

from .camera import StereoCamera
from .grid import OccupancyGrid
from .matching.correlation import ErrorReach
from .motion import MotionError
from .novelty import Novelty
from .observation import Disparity, Matcher, Observation


class Mapper:
    """Turns observations, in their order, into a map. camera: the rectified pair they come from.

    reach: how far the matcher's errors go together in time; None: every observation counts in full.
    """

    def __init__(
        self,
        camera: StereoCamera,
        matcher: Matcher,
        grid: OccupancyGrid,
        motion_error: MotionError | None = None,
        *,
        reach: ErrorReach | None = None,
    ) -> None:
        grid.check_fits(camera)
        self.camera, self.matcher, self.grid = camera, matcher, grid
        self.motion_error = motion_error or MotionError()
        self.novelty = Novelty(camera, reach)

    def step(self, observation: Observation) -> Disparity:
        """Fuse one observation into the grid and return its disparity."""
        disparity = self.matcher.match(observation.left, observation.right)
        self.fuse(observation, disparity)
        return disparity

    def fuse(self, observation: Observation, disparity: Disparity) -> None:
        """Fuse an observation whose disparity is already known."""
        motion_sigma_m = self.motion_error.sigma_m(observation.odometry)
        weight = self.novelty.weight(disparity, observation.T_world_cam)
        self.grid.integrate(self.camera, disparity, observation.T_world_cam, motion_sigma_m, weight=weight)
