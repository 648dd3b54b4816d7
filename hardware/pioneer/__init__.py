"""The driver of a Pioneer 3-AT: `with connect("tcp:127.0.0.1:8101") as robot: robot.arm(); robot.drive(0.2, 0.0)`.

Bytes to values: the package arcos. link and handshake find the robot; odometry and safety are pure; driver ties them
together in a thread, and process runs that in a process of its own, which is what `connect` gives.
"""

from .limits import Limits
from .process import PioneerProcess, connect
from .robot import RobotDriver, RobotReport, RobotStatus

__all__ = ["Limits", "PioneerProcess", "RobotDriver", "RobotReport", "RobotStatus", "connect"]
