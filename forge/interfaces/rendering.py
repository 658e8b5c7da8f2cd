"""A catalog to files, by the table of targets."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

from forge.interfaces.model import File
from forge.interfaces.targets import find_target

if TYPE_CHECKING:
    from forge.interfaces.model import Catalog

TARGETS = {
    "python": "forge.interfaces.python_package",
    "cpp": "forge.interfaces.cpp",
    "c": "forge.interfaces.c",
    "idl": "forge.interfaces.idl_writing",
    "json": "forge.interfaces.description",
    "docs": "forge.interfaces.docs",
}
"""Each target's module; it has `files(catalog) -> Iterator[File]`, paths relative to the target's folder."""


def render(catalog: Catalog, target: str) -> tuple[File, ...]:
    """Return all files of a target, below a folder of its name: 'python/std_msgs/msg/_string.py'.

    A target that is not of the table may be another distribution's (forge.interfaces.targets).
    Raises ForgeError when there is no such target, or when it cannot be used.
    """
    # A target is imported by name, so that one that is not asked for costs nothing.
    view = import_module(TARGETS[target]) if target in TARGETS else find_target(target, TARGETS)
    return tuple(File(f"{target}/{file.path}", file.text) for file in view.files(catalog))
