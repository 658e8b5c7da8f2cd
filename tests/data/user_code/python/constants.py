"""Constants are read from classes and from messages, and nobody changes them."""

from __future__ import annotations

import pytest
from action_msgs.msg import GoalStatus
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rover.msg import Route
from sensor_msgs.msg import BatteryState, NavSatStatus
from visualization_msgs.msg import Marker

NAMES = {
    value: name.removeprefix("STATUS_").lower()
    for name, value in vars(GoalStatus).items()
    if name.startswith("STATUS_")
}
assert NAMES[GoalStatus.STATUS_EXECUTING] == "executing"

marker = Marker(type=Marker.SPHERE, action=Marker.ADD)
assert (marker.type, marker.action) == (2, 0)
assert marker.CUBE == Marker.CUBE == 1
assert NavSatStatus.STATUS_NO_FIX == -1
assert BatteryState().POWER_SUPPLY_STATUS_FULL == 4
assert Route.FRAME == "map"

report = DiagnosticArray()
report.status.append(DiagnosticStatus(level=DiagnosticStatus.WARN, name="motor", message="hot"))
report.status[0].values = [KeyValue(key="temperature", value="81")]
assert report.status[0].level == b"\x01"
assert max(status.level for status in report.status) < DiagnosticStatus.ERROR


def describe(route: Route) -> str:
    if route.kind == Route.OPEN:
        return "there"
    return "there and back" if route.kind == route.CLOSED else "somewhere"


assert describe(Route(kind=Route.CLOSED)) == "there and back"

for owner in (Route, Route()):
    with pytest.raises(AttributeError):
        setattr(owner, "OPEN", 5)  # noqa: B010  (the type checker knows that it is wrong)
