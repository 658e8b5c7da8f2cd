"""Recipes for Python packages: build a wheel with the package's backend and install it; pure."""

from __future__ import annotations

from typing import TYPE_CHECKING

from forge.build.recipes.context import BuildContext, Recipe
from forge.build.tasks import Step, StepKind

if TYPE_CHECKING:
    from forge.build.tests.recipes import TestContext
    from forge.workspace.model import Package


def recipe(package: Package, context: BuildContext, *more: str) -> Recipe:
    """Return the step that runs `python -m forge.cli.install_wheel`.

    Without a setup.py, scripts go to lib/<package>, where `ros2 run` finds them.
    """
    layout, build = context.layout, context.layout.build_dir(package.name)
    argv = (
        *context.wheels,
        str(context.source(package)),
        *("--package", package.name, "--build", str(build), "--prefix", str(layout.prefix(package.name))),
        *("--python", str(context.python), "--site-packages", context.site_packages),
        *more,
        *(("--target", layout.target) if layout.target else ()),
        *(("--link",) if context.links(package) else ()),
    )
    return Recipe((Step(StepKind.INSTALL, argv, build, prefix=layout.prefix(package.name)),))


def tests(package: Package, context: TestContext) -> Recipe:
    from forge.build.tests.recipes import python_recipe, requirements_of_tests

    return python_recipe(package, context, requirements_of_tests(context.source(package)))
