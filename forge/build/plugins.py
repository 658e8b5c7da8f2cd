"""Build types of other distributions; imported only for a build type that forge does not know."""

from __future__ import annotations

import sys
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, TypeVar

from forge.base.errors import ForgeError, Problem
from forge.base.extensions import call
from forge.build.inputs.fingerprints import content_digest, digest_strings, source_files
from forge.build.recipes.context import Recipe
from forge.build.up_to_date import BUILD_TYPE
from forge.workspace.finders import plugin

if TYPE_CHECKING:
    from forge.build.build_types import BuildType
    from forge.build.recipes.context import BuildContext
    from forge.build.tests.recipes import TestContext
    from forge.workspace.model import Package

_Result = TypeVar("_Result")


def find_plugin(name: str) -> BuildType | None:
    """Return the build type `name`, None if there is none; raises ForgeError if it cannot be loaded."""
    found = plugin(name)
    return None if found is None else _Plugin(name, found)


class _Plugin:
    """A build type of another distribution, whose exceptions and wrong results become ForgeErrors."""

    def __init__(self, name: str, module: BuildType) -> None:
        self._name = name
        self._what = f"the build type '{name}'"
        self._module = module

    def options(self, package: Package, context: BuildContext) -> tuple[str, ...]:
        own = self._checked(tuple, call(self._what, self._module.options, package, context))
        return (*own, f"{BUILD_TYPE}'{self._name}' {_code_digest(self._module)}")

    def recipe(self, package: Package, context: BuildContext) -> Recipe:
        return self._checked(Recipe, call(self._what, self._module.recipe, package, context))

    def tests(self, package: Package, context: TestContext) -> Recipe:
        return self._checked(Recipe, call(self._what, self._module.tests, package, context))

    def _checked(self, wanted: type[_Result], result: object) -> _Result:
        if not isinstance(result, wanted):
            message = f"{self._what} returned {type(result).__name__} instead of a {wanted.__name__}"
            raise ForgeError(Problem(message))
        return result


def _code_digest(plugin: object) -> str:
    """Return a digest of a plugin's code: another version of it may build in another way."""
    module = plugin if isinstance(plugin, ModuleType) else sys.modules[type(plugin).__module__]
    file = Path(module.__file__ or "")
    files = source_files(str(file.parent)) if file.name == "__init__.py" else (str(file),)
    return digest_strings(*(content_digest(path) for path in files if path.endswith(".py")))
