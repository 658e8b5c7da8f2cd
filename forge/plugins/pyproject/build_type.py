"""The build type `python`: packages with only a setup.py or pyproject.toml, whose scripts go to bin.

The functions import what they need, because `forge list` only identifies packages.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from forge.base.errors import Location, Problem
from forge.base.formats import read_toml
from forge.workspace.identity import Folder, Identity
from forge.workspace.plain_packages import computed_name, plain_package
from forge.workspace.python_metadata import PythonMetadata, read_pyproject, read_setup_cfg, read_setup_py

if TYPE_CHECKING:
    from forge.build.recipes.context import BuildContext, Recipe
    from forge.build.tests.recipes import TestContext
    from forge.build.wheels.install_wheel import WheelInstall
    from forge.workspace.model import Package

__all__ = ["identify", "install", "options", "recipe", "tests", "tests_need_build"]

tests_need_build = False


def options(package: Package, context: BuildContext) -> tuple[str, ...]:
    from forge.build.recipes.context import common_options

    return common_options(package, context)


def recipe(package: Package, context: BuildContext) -> Recipe:
    """Return the step that builds and installs the package: its scripts go to bin, which is on the PATH."""
    from forge.build.recipes.python import recipe

    return recipe(package, context, "--scripts", "bin")


def tests(package: Package, context: TestContext) -> Recipe:
    from forge.build.recipes.python import tests

    return tests(package, context)


def install(options: WheelInstall) -> tuple[tuple[Path, ...], str]:
    """Install a package with another backend than setuptools; return the files and the backend's output."""
    from forge.plugins.pyproject import wheels

    return wheels.install(options)


def identify(folder: Folder) -> Identity | None:
    """Read setup.py, completed by setup.cfg and pyproject.toml like setuptools, else pyproject.toml."""

    def setup_cfg() -> PythonMetadata:
        return read_setup_cfg(folder.text("setup.cfg")) if folder.has("setup.cfg") else PythonMetadata()

    def pyproject() -> PythonMetadata | None:
        path = folder.display_path / "pyproject.toml"
        has_file = folder.has("pyproject.toml")
        return read_pyproject(read_toml(folder.content("pyproject.toml"), path)) if has_file else None

    if folder.has("setup.py"):
        path = folder.display_path / "setup.py"
        try:
            facts = read_setup_py(folder.text("setup.py"))
        except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
            line = getattr(error, "lineno", None)
            reason = str(error.args[0]) if error.args else "not valid Python"
            if isinstance(error, RecursionError | MemoryError):
                reason = "too deeply nested"
            problem = Problem(f"cannot parse setup.py: {reason}", Location(path, line))
            return Identity(notes=(problem,), descend=True)
        if facts is not None:
            facts = facts.over(setup_cfg()).over(pyproject() or PythonMetadata())
            return _python(folder, facts, path)
    if folder.has("pyproject.toml"):
        facts, below = pyproject(), setup_cfg()
        if facts or below.name is not None:
            facts = (facts or PythonMetadata()).over(below)
            return _python(folder, facts, folder.display_path / "pyproject.toml")
    return None


def _python(folder: Folder, facts: PythonMetadata, path: Path) -> Identity:
    if folder.name and facts.name and folder.name != facts.name:
        message = f"ignored: the assigned name '{folder.name}' differs from the Python name '{facts.name}'"
        hint = "remove the name from colcon.pkg or the *.meta file"
        return Identity(problems=(Problem(message, Location(path), hint),), name=folder.name)
    notes = () if facts.name or folder.name else (computed_name(folder, path),)
    name = folder.name or facts.name or folder.absolute.resolve().name
    package = plain_package(folder, name, "python", path, facts.dependencies)
    manifest = replace(package.manifest, version=facts.version, maintainers=facts.maintainers)
    return Identity(replace(package, manifest=manifest), notes=notes)
