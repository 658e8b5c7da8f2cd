"""Find installed interfaces and their definitions in the ament index."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Iterable

_INDEX = "rosidl_interfaces"
_FULL_NAME = 3


def get_interface_packages() -> dict[str, str]:
    """Return the prefix of each installed package that has interfaces."""
    found: dict[str, str] = _index().get_resources(_INDEX)
    return found


def get_interfaces(package_names: Iterable[str] = ()) -> dict[str, list[str]]:
    """Return the interfaces, such as 'msg/String', of the packages, or of all packages.

    Requests and responses of services, and packages without interfaces, are omitted. Raises LookupError for a
    package that is not installed.
    """
    index = _index()
    found = {}
    for package in tuple(package_names) or sorted(get_interface_packages()):
        if not index.has_resource("packages", package):
            raise LookupError(f"Unknown package '{package}'")
        if index.has_resource(_INDEX, package):
            entries = index.get_resource(_INDEX, package)[0].splitlines()
            found[package] = sorted({entry.rpartition(".")[0] for entry in entries if "_" not in entry})
    return found


def get_message_interfaces(package_names: Iterable[str] = ()) -> dict[str, list[str]]:
    """Return the messages of `get_interfaces`."""
    return _of_kind("msg", package_names)


def get_service_interfaces(package_names: Iterable[str] = ()) -> dict[str, list[str]]:
    """Return the services of `get_interfaces`."""
    return _of_kind("srv", package_names)


def get_action_interfaces(package_names: Iterable[str] = ()) -> dict[str, list[str]]:
    """Return the actions of `get_interfaces`."""
    return _of_kind("action", package_names)


def get_interface_path(interface_name: str) -> str:
    """Return the path of a definition; without a suffix, .msg, .srv or .action files come first.

    Raises ValueError if the name is not 'package/kind/Name', and LookupError if it is not installed.
    """
    parts = _parts(interface_name)
    prefix = _index().has_resource("packages", parts[0])
    if not prefix:
        raise LookupError(f"Unknown package '{parts[0]}'")
    path = Path(prefix, "share", *parts)
    candidates = [path] if path.suffix else [path.with_suffix(f".{parts[1]}"), path.with_suffix(".idl")]
    for candidate in candidates:
        if candidate.is_file():
            return str(candidate)
    raise LookupError(f"Could not find the interface '{candidates[-1]}'")


def _index() -> Any:
    """Import ament_index_python lazily, because conversions work without it."""
    return import_module("ament_index_python")


def _of_kind(kind: str, package_names: Iterable[str]) -> dict[str, list[str]]:
    filtered = {
        package: [name for name in names if name.startswith(f"{kind}/")]
        for package, names in get_interfaces(package_names).items()
    }
    return {package: names for package, names in filtered.items() if names}


def _parts(interface_name: str) -> list[str]:
    """Return package, kind and name; raises ValueError for anything else, and for a way out of the prefix."""
    parts = interface_name.split("/")
    fault = None
    if len(parts) != _FULL_NAME:
        fault = "Expected three parts separated by '/'"
    elif not all(parts):
        fault = "Must not contain empty parts"
    elif ".." in parts:
        fault = "Must not contain '..'"
    if fault:
        raise ValueError(f"Invalid name '{interface_name}'. {fault}")
    return parts
