"""Find interface classes by name, such as 'std_msgs/msg/String'."""

from __future__ import annotations

from typing import Any

from rosidl_parser.definition import NamespacedType

from rosidl_runtime_py.import_message import import_message_from_namespaced_type

_FULL_NAME = 3


def get_interface(identifier: str) -> Any:
    """Return the class with a name of the form 'package/kind/Name'.

    Raises ValueError unless the name has three parts, and ModuleNotFoundError or AttributeError if the
    interface does not exist.
    """
    return import_message_from_namespaced_type(get_namespaced_type(identifier))


def get_message(identifier: str) -> Any:
    """Return the class of a message by its full name, or by package and name; raises as `get_interface`."""
    return _of_kind(identifier, "msg", is_message, "message")


def get_service(identifier: str) -> Any:
    """Return the class of a service by its full name, or by package and name; raises as `get_interface`."""
    return _of_kind(identifier, "srv", is_service, "service")


def get_action(identifier: str) -> Any:
    """Return the class of an action by its full name, or by package and name; raises as `get_interface`."""
    return _of_kind(identifier, "action", is_action, "action")


def get_namespaced_type(identifier: str) -> NamespacedType:
    """Return the type with a name of the form 'package/kind/Name'; raises ValueError for other names."""
    parts = identifier.split("/")
    if len(parts) != _FULL_NAME or not all(parts):
        raise ValueError(f"Expected the full name of an interface, got '{identifier}'")
    return NamespacedType(parts[:-1], parts[-1])


def get_message_namespaced_type(identifier: str) -> NamespacedType:
    """Return the type of a message by its full name, or by package and name."""
    return get_namespaced_type(_full_name(identifier, "msg"))


def get_service_namespaced_type(identifier: str) -> NamespacedType:
    """Return the type of a service by its full name, or by package and name."""
    return get_namespaced_type(_full_name(identifier, "srv"))


def get_action_namespaced_type(identifier: str) -> NamespacedType:
    """Return the type of an action by its full name, or by package and name."""
    return get_namespaced_type(_full_name(identifier, "action"))


def is_message(interface: Any) -> bool:
    """Return True if the class is a message, including parts of services and actions."""
    return hasattr(interface, "get_fields_and_field_types")


def is_service(interface: Any) -> bool:
    """Return True if the class is a service."""
    return hasattr(interface, "Request") and hasattr(interface, "Response")


def is_action(interface: Any) -> bool:
    """Return True if the class is an action."""
    return all(hasattr(interface, part) for part in ("Goal", "Result", "Feedback"))


def _of_kind(identifier: str, namespace: str, belongs: Any, word: str) -> Any:
    try:
        interface = get_interface(_full_name(identifier, namespace))
    except ValueError:
        interface = None
    if interface is None or not belongs(interface):
        article = "an" if word == "action" else "a"
        raise ValueError(f"Expected the full name of {article} {word}, got '{identifier}'")
    return interface


def _full_name(identifier: str, namespace: str) -> str:
    """Insert the namespace into a name of the form 'package/Name'."""
    package, _, name = identifier.partition("/")
    return identifier if "/" in name else f"{package}/{namespace}/{name}"
