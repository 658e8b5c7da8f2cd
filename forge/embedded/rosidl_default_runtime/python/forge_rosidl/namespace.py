"""The modules pkg.msg, pkg.srv and pkg.action, which import their classes on first access.

A program uses few messages of a package; importing all of them with their dependencies takes longer than
starting Python.
"""

from __future__ import annotations

import sys
from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping


def lazy(
    namespace: str, modules: Mapping[str, str]
) -> tuple[Callable[[str], object], Callable[[], list[str]]]:
    """Return `__getattr__` and `__dir__` (PEP 562) for a module; `modules` maps classes to their modules."""
    attributes = sys.modules[namespace].__dict__

    def load(name: str) -> object:
        if name not in modules:
            raise AttributeError(f"module '{namespace}' has no attribute '{name}'")
        value: object = getattr(import_module(f"{namespace}.{modules[name]}"), name)
        attributes[name] = value
        return value

    def names() -> list[str]:
        return sorted({*attributes, *modules})

    return load, names
