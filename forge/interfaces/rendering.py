"""A catalog to files, by the table of targets."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

from forge.errors import ForgeError, Problem
from forge.interfaces.model import File
from forge.names import did_you_mean

if TYPE_CHECKING:
    from forge.interfaces.model import Catalog

TARGETS = {
    "python": "forge.interfaces.python",
    "cpp": "forge.interfaces.cpp",
    "idl": "forge.interfaces.idl_writing",
    "json": "forge.interfaces.description",
}
"""Each target's module; it has `files(catalog) -> Iterator[File]`, paths relative to the target's folder."""


def render(catalog: Catalog, target: str) -> tuple[File, ...]:
    """Return all files of a target, below a folder of its name: 'python/std_msgs/msg/_string.py'.

    Raises ForgeError when there is no such target.
    """
    if target not in TARGETS:
        hint = did_you_mean(target, TARGETS) or f"there are {', '.join(TARGETS)}"
        raise ForgeError(Problem(f"forge generates no '{target}'", hint=hint))
    # A target is imported by name, so that one that is not asked for costs nothing.
    view = import_module(TARGETS[target])
    return tuple(File(f"{target}/{file.path}", file.text) for file in view.files(catalog))
