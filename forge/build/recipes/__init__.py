"""The table of build types and their recipes.

A recipe is a pure function from a package and a BuildContext to steps. To support a new build type, add a
line here.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from forge.build.recipes import cmake, python
from forge.build.recipes.context import BuildType, common_options

if TYPE_CHECKING:
    from collections.abc import Mapping

RECIPES: Mapping[str, BuildType] = {
    "ament_cmake": BuildType(cmake.ament_recipe, cmake.ament_options),
    "cmake": BuildType(cmake.plain_recipe, cmake.plain_options),
    "ament_python": BuildType(python.recipe, common_options),
    "python": BuildType(python.plain_recipe, common_options),
}
