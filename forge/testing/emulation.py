"""Whether this machine can run the tests of programs for another platform."""

from __future__ import annotations

from typing import TYPE_CHECKING

from forge.base.errors import HostError, Problem
from forge.toolchain.cross.toolchain import has_emulator
from forge.toolchain.programs import compiled_packages

if TYPE_CHECKING:
    from collections.abc import Sequence

    from forge.base.layout import Layout
    from forge.workspace.model import Package


def require_emulator(packages: Sequence[Package], layout: Layout) -> None:
    """Raise HostError if one of the packages has programs that this machine cannot run."""
    if compiled_packages(packages) and not has_emulator(layout):
        message = f"this machine cannot run the tests of programs for '{layout.target}'"
        hint = "install qemu-user, for example with `apt install qemu-user`, then build again"
        raise HostError(Problem(message, hint=hint))
