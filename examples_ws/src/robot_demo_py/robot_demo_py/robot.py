"""The robot of robot_motion, in Python."""

from example_ros2_interfaces.msg import RobotStatus
from example_ros2_interfaces.srv import MoveRobot as MoveService
from robot_control_interfaces.action import MoveRobot as MoveAction

STRIDE = 0.5
TOLERANCE = 0.01


class Robot:
    """A robot on a line: each step takes it half of the way that is left."""

    def __init__(self):
        self.current = 0.0
        self.target = 0.0

    @property
    def arrived(self):
        """Tell whether the goal is reached."""
        return abs(self.target - self.current) < TOLERANCE

    def move(self, request):
        """Serve a request: go all the way, then answer where that is."""
        self.accept(MoveAction.Goal(distance=request.distance))
        while not self.arrived:
            self.step()
        return MoveService.Response(pose=self.current)

    def accept(self, goal):
        """Take on a goal; tell whether there is anything to do."""
        self.target += goal.distance
        return not self.arrived

    def step(self):
        """Go one step towards the goal and tell how far that led."""
        self.current += STRIDE * (self.target - self.current)
        kind = MoveAction.Feedback
        status = kind.STATUS_STOPPED if self.arrived else kind.STATUS_MOVING
        return kind(pose=self.current, status=status)

    def result(self):
        """Tell where the robot stands, as the result of an action."""
        return MoveAction.Result(pose=self.current)

    def status(self):
        """Tell where the robot stands, on its line."""
        status = RobotStatus.STATUS_STOPPED if self.arrived else RobotStatus.STATUS_MOVING
        return RobotStatus(status=status, pose=self.current)
