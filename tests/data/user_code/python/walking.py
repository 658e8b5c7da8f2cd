"""Programs that know no message walk over its fields: plotters, bridges, diffs."""

from __future__ import annotations

from array import array
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np
from geometry_msgs.msg import TransformStamped
from nav_msgs.msg import Path
from rosidl_parser.definition import (
    AbstractNestedType,
    AbstractSequence,
    AbstractString,
    Array,
    BasicType,
    BoundedSequence,
    BoundedString,
    NamespacedType,
    UnboundedSequence,
    UnboundedString,
)
from rover.msg import Route, Waypoint
from sensor_msgs.msg import Imu

if TYPE_CHECKING:
    from collections.abc import Iterator


def leaves(class_: Any, path: str = "") -> Iterator[str]:
    """Yield the path of every plain number in a type, fixed arrays unrolled."""
    for name, type_ in zip(class_.get_fields_and_field_types(), class_.SLOT_TYPES, strict=True):
        here = f"{path}/{name}"
        if isinstance(type_, NamespacedType):
            module = import_module(".".join(type_.namespaces))
            yield from leaves(getattr(module, type_.name), here)
        elif isinstance(type_, Array):
            yield from (f"{here}[{index}]" for index in range(type_.size))
        elif not isinstance(type_, AbstractSequence | AbstractString):
            yield here


def plain(value: Any) -> Any:
    """Return a message the way a bridge to a browser does, by its slots."""
    if hasattr(value, "__slots__"):
        return {slot.lstrip("_"): plain(getattr(value, slot)) for slot in value.__slots__}
    if isinstance(value, np.ndarray | array):
        return value.tolist()
    return [plain(item) for item in value] if isinstance(value, list | tuple) else value


found = list(leaves(TransformStamped))
assert found[:2] == ["/header/stamp/sec", "/header/stamp/nanosec"]
assert found[-1] == "/transform/rotation/w"
assert "/orientation_covariance[8]" in set(leaves(Imu))

types = dict(zip(Route.get_fields_and_field_types(), Route.SLOT_TYPES, strict=True))
assert types["waypoints"] == UnboundedSequence(NamespacedType(["rover", "msg"], "Waypoint"))
assert isinstance(types["detours"], BoundedSequence)
assert types["detours"].maximum_size == 2
assert isinstance(types["covariance"], AbstractNestedType)
assert types["covariance"].value_type == BasicType("double")
assert isinstance(types["tags"], UnboundedSequence)
assert isinstance(types["tags"].value_type, UnboundedString)
assert isinstance(Waypoint.SLOT_TYPES[0], BoundedString)
assert Waypoint.SLOT_TYPES[0].maximum_size == 16
assert Path.get_fields_and_field_types() == {
    "header": "std_msgs/Header",
    "poses": "sequence<geometry_msgs/PoseStamped>",
}
assert Route.get_fields_and_field_types()["weights"] == "sequence<float, 4>"
assert Waypoint.get_fields_and_field_types()["name"] == "string<16>"

assert plain(Waypoint()) == {"name": "unnamed", "position": {"x": 0.0, "y": 0.0, "z": 0.0}, "speed": 0.5}
assert plain(Imu())["orientation_covariance"] == [0.0] * 9
