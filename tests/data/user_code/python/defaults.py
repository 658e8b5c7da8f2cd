"""Defaults of a definition are in every new message, can be asked for, and are nobody's to change."""

from __future__ import annotations

import pytest
from geometry_msgs.msg import Quaternion
from rover.msg import Route, Waypoint
from rover.srv import Plan

assert (Waypoint().name, Waypoint().speed) == ("unnamed", 0.5)
assert (Waypoint.NAME__DEFAULT, Waypoint.SPEED__DEFAULT) == ("unnamed", 0.5)
assert Plan.Request.CLEARANCE__DEFAULT == 0.3
assert Quaternion.W__DEFAULT == 1.0

route = Route()
assert list(route.weights) == list(Route.WEIGHTS__DEFAULT) == [0.25, 0.75]
route.weights.append(1.0)
route.tags.append("seen")
assert list(Route().weights) == [0.25, 0.75]
assert Route().tags == ["new"]
assert Route.TAGS__DEFAULT is not Route.TAGS__DEFAULT, "everybody gets a copy"
assert Route(tags=[]).tags == []
with pytest.raises(AttributeError):
    setattr(Waypoint, "SPEED__DEFAULT", 2.0)  # noqa: B010  (the type checker knows that it is wrong)
