"""Interface definitions to code: parse, resolve, render, write; independent of building.

`forge.interfaces.load` creates message classes at run time, for use in programs.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from forge.interfaces.loading import Types as Types
    from forge.interfaces.loading import load as load

__all__ = [
    "Types",
    "cpp",
    "enumerations",
    "hashing",
    "idl",
    "load",
    "model",
    "notation",
    "python",
    "read",
    "resolve",
    "schema",
    "show",
    "wire",
    "writing",
]


def __getattr__(name: str) -> object:
    """Import `load` and `Types` lazily, so that the compiler does not load them."""
    if name in {"load", "Types"}:
        from forge.interfaces import loading

        return getattr(loading, name)
    raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
