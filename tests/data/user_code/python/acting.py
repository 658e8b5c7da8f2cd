"""Actions: a goal comes in, feedback goes out on the way, a result at the end."""

from __future__ import annotations

import uuid

import numpy as np
import pytest
from action_msgs.msg import GoalStatus
from example_interfaces.action import Fibonacci
from rover.action import Drive
from rover.msg import Route, Waypoint
from unique_identifier_msgs.msg import UUID


class Handle:
    """Stands for what a server gets."""

    def __init__(self, request: Fibonacci.Goal) -> None:
        self.request = request
        self.published: list[Fibonacci.Feedback] = []

    def publish_feedback(self, feedback: Fibonacci.Feedback) -> None:
        self.published.append(Fibonacci.Feedback(sequence=feedback.sequence))


def execute(handle: Handle) -> Fibonacci.Result:
    feedback = Fibonacci.Feedback()
    feedback.sequence = [0, 1]
    for i in range(1, handle.request.order):
        feedback.sequence.append(feedback.sequence[i] + feedback.sequence[i - 1])
        handle.publish_feedback(feedback)
    result = Fibonacci.Result()
    result.sequence = feedback.sequence
    return result


handle = Handle(Fibonacci.Goal(order=5))
assert list(execute(handle).sequence) == [0, 1, 1, 2, 3, 5]
assert [len(feedback.sequence) for feedback in handle.published] == [3, 4, 5, 6]

identity = uuid.UUID(int=7)
request = Fibonacci.Impl.SendGoalService.Request()
request.goal_id = UUID(uuid=list(identity.bytes))
request.goal.order = 3
assert bytes(request.goal_id.uuid) == identity.bytes
assert isinstance(request.goal_id.uuid, np.ndarray)

response = Fibonacci.Impl.GetResultService.Response(status=GoalStatus.STATUS_SUCCEEDED)
assert response.status == 4
message = Fibonacci.Impl.FeedbackMessage(goal_id=request.goal_id, feedback=handle.published[0])
assert list(message.feedback.sequence) == [0, 1, 1]
assert Fibonacci.Impl.CancelGoalService.Request().goal_info.goal_id == UUID()
assert Fibonacci.Impl.GoalStatusMessage().status_list == []

drive = Drive.Goal(route=Route(waypoints=[Waypoint(name="gate"), Waypoint(name="barn")]))
progress = Drive.Feedback(passed=1, next=drive.route.waypoints[1])
assert progress.next.name == "barn"
with pytest.raises(NotImplementedError):
    Drive()
