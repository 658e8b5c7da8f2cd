"""Find message classes by their names in SLOT_TYPES."""

from __future__ import annotations

from importlib import import_module
from typing import Any, Final, cast
from warnings import warn

from rosidl_parser.definition import AbstractNestedType, NamespacedType

_PARTS: Final = {
    "SendGoal": "Impl.SendGoalService",
    "GetResult": "Impl.GetResultService",
    "FeedbackMessage": "Impl.FeedbackMessage",
}


def import_message_from_namespaced_type(message_type: NamespacedType | AbstractNestedType) -> Any:
    """Return the class of a message, including parts of services and actions.

    For a collection, returns the class of its elements, which is deprecated. Raises ModuleNotFoundError if
    the package does not exist, and AttributeError if it has no such message.
    """
    if isinstance(message_type, AbstractNestedType):
        warn("pass the value_type of a collection", DeprecationWarning, stacklevel=2)
        return import_message_from_namespaced_type(cast("NamespacedType", message_type.value_type))
    namespace: Any = import_module(".".join(message_type.namespaces))
    if hasattr(namespace, message_type.name):
        return getattr(namespace, message_type.name)
    main, *parts = message_type.name.split("_")
    found = getattr(namespace, main)
    for part in parts:
        for name in _PARTS.get(part, part).split("."):
            found = getattr(found, name)
    return found
