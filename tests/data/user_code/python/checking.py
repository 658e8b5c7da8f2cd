"""What does not fit is refused where it is assigned, with words that name the field."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from rover.msg import Route, Waypoint
from std_msgs.msg import Bool, Float32, Int8, String, UInt8

WRONG: list[tuple[Any, str, object, str]] = [
    (String(), "data", 5, "must be of type 'str'"),
    (Bool(), "data", 1, "must be of type 'bool'"),
    (Int8(), "data", 128, r"must be an integer in \[-128, 127\]"),
    (UInt8(), "data", -1, r"must be an unsigned integer in \[0, 255\]"),
    (Int8(), "data", np.int8(1), "must be of type 'int'"),
    (Float32(), "data", 1, "must be of type 'float'"),
    (Float32(), "data", 1e39, "must be a float in"),
    (Waypoint(), "name", "seventeen letters", "not longer than 16"),
    (Waypoint(), "position", {"x": 1.0}, "must be a sub message of type 'Point'"),
    (Route(), "detours", [Waypoint()] * 3, "length <= 2"),
    (Route(), "weights", [0.0] * 5, "length <= 4"),
    (Route(), "covariance", [1.0], "length 6"),
    (Route(), "flags", [True], "length 3"),
    (Route(), "tags", "text", "set or sequence"),
    (Route(), "tags", [1], "each value of type 'str'"),
]
for message, name, value, words in WRONG:
    before = getattr(message, name)
    with pytest.raises(AssertionError, match=f"'{name}' field {words}" if "must" in words else words):
        setattr(message, name, value)
    assert getattr(message, name) is before

assert Float32(data=float("inf")).data == float("inf")
assert Waypoint(name="sixteen letters!").name == "sixteen letters!"

call: Any = Waypoint
with pytest.raises(AssertionError, match="Invalid arguments passed to constructor: colour, title"):
    call(title="x", colour="red")
with pytest.raises(TypeError):
    call("gate")
with pytest.raises(AttributeError):
    call().title = "x"
