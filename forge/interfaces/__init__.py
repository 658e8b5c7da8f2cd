"""Interface definitions to code: parse, resolve, render, write; knows nothing of building.

`forge.interfaces.load` is for programs: it gives them classes at run time.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from forge.interfaces.loading import Types as Types
    from forge.interfaces.loading import load as load


def __getattr__(name: str) -> object:
    """Give `load` and `Types` to who asks for them; the compiler itself does not pay for that."""
    if name in {"load", "Types"}:
        from forge.interfaces import loading  # noqa: PLC0415  (that is the point)

        return getattr(loading, name)
    raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
