"""Python packages: build a wheel with the package's own backend and unpack it into the prefix; pure."""

from __future__ import annotations

from typing import TYPE_CHECKING

from forge.model import Step
from forge.recipes.kitchen import Recipe

if TYPE_CHECKING:
    from forge.model import Package
    from forge.recipes.kitchen import Kitchen


def recipe(package: Package, kitchen: Kitchen) -> Recipe:
    """Return the one step; `python -m forge.wheels` says what it does."""
    build = kitchen.layout.build_dir(package.name)
    interpreter, *words = kitchen.forge
    argv = (
        interpreter,
        *(word if word != "forge" else "forge.wheels" for word in words),
        str(kitchen.root / package.path),
        "--package",
        package.name,
        "--build",
        str(build),
        "--prefix",
        str(kitchen.layout.prefix(package.name)),
        "--python",
        str(kitchen.python),
        "--site-packages",
        kitchen.site_packages,
        *(("--link",) if kitchen.layout.symlink and not package.embedded else ()),
    )
    return Recipe((Step("install", argv, build),))
