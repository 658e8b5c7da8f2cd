"""Python packages: build a wheel with the package's own backend and unpack it into the prefix; pure."""

from __future__ import annotations

from typing import TYPE_CHECKING

from forge.model import Step
from forge.recipes.kitchen import Recipe

if TYPE_CHECKING:
    from forge.model import Package
    from forge.recipes.kitchen import Kitchen


def recipe(package: Package, kitchen: Kitchen) -> Recipe:
    """Return the one step; without a setup.py its scripts go to lib/<package>, where `ros2 run` looks."""
    return _recipe(package, kitchen)


def plain_recipe(package: Package, kitchen: Kitchen) -> Recipe:
    """Return the one step for a package that knows nothing of ROS: its scripts go onto the PATH."""
    return _recipe(package, kitchen, "--scripts", "bin")


def _recipe(package: Package, kitchen: Kitchen, *more: str) -> Recipe:
    """Return the step that starts `python -m forge.wheels`, which says what it does."""
    build = kitchen.layout.build_dir(package.name)
    argv = (
        *kitchen.wheels,
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
        *more,
        *(("--link",) if kitchen.layout.symlink and not package.embedded else ()),
    )
    return Recipe((Step("install", argv, build),))
