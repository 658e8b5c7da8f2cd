"""Find resources: files with a type and a name below each prefix; the first prefix wins."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from ament_index_python.constants import RESOURCE_INDEX_SUBFOLDER
from ament_index_python.search_paths import get_search_paths


class InvalidResourceTypeNameError(ValueError):
    """A resource type with an invalid name, such as one with a path separator."""


class InvalidResourceNameError(ValueError):
    """A resource with an invalid name, such as one with a path separator."""


def get_resource(resource_type: str, resource_name: str) -> tuple[str, str]:
    """Return the content of a resource and its prefix.

    Raises LookupError if no prefix contains it, OSError if it cannot be read, and a ValueError for names
    that are empty or contain a path separator.
    """
    prefix = has_resource(resource_type, resource_name)
    if not prefix:
        raise LookupError(f"Could not find the resource '{resource_name}' of type '{resource_type}'")
    path = Path(prefix, RESOURCE_INDEX_SUBFOLDER, resource_type, resource_name)
    try:
        return path.read_text(encoding="utf-8"), prefix
    except OSError as error:
        message = f"Could not open the resource '{resource_name}' of type '{resource_type}': {error}"
        raise OSError(message) from error


def get_resources(resource_type: str) -> dict[str, str]:
    """Return the prefix of each resource of a type; raises a ValueError for an invalid type name."""
    _check_type(resource_type)
    found: dict[str, str] = {}
    for prefix in get_search_paths():
        folder = Path(prefix, RESOURCE_INDEX_SUBFOLDER, resource_type)
        if folder.is_dir():
            for entry in sorted(folder.iterdir()):
                if entry.is_file() and not entry.name.startswith("."):
                    found.setdefault(entry.name, prefix)
    return found


def get_resource_types() -> set[str]:
    """Return the names of all types of resources."""
    folders = [Path(prefix, RESOURCE_INDEX_SUBFOLDER) for prefix in get_search_paths()]
    return {
        entry.name
        for folder in folders
        if folder.is_dir()
        for entry in folder.iterdir()
        if entry.is_dir() and not entry.name.startswith(".")
    }


def has_resource(resource_type: str, resource_name: str) -> str | Literal[False]:
    """Return the prefix of a resource, or False; raises a ValueError for invalid names."""
    _check_type(resource_type)
    _check_name(resource_name)
    for prefix in get_search_paths():
        if Path(prefix, RESOURCE_INDEX_SUBFOLDER, resource_type, resource_name).is_file():
            return prefix
    return False


def _check_type(name: str) -> None:
    if not name:
        raise ValueError("The resource type must not be empty")
    if "/" in name or "\\" in name:
        raise InvalidResourceTypeNameError(f"Resource type '{name}' has an invalid name")


def _check_name(name: str) -> None:
    if not name:
        raise ValueError("The resource name must not be empty")
    if "/" in name or "\\" in name:
        raise InvalidResourceNameError(f"Resource name '{name}' has an invalid name")
