"""Build type to steps: the table, and what every recipe is told.

A recipe is a pure function of a package and a Kitchen; a new build type is one more line here.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from forge.recipes import cmake, python
from forge.recipes.kitchen import BuildType, places

if TYPE_CHECKING:
    from collections.abc import Mapping

RECIPES: Mapping[str, BuildType] = {
    "ament_cmake": BuildType(cmake.ament_recipe, cmake.ament_options),
    "cmake": BuildType(cmake.plain_recipe, cmake.plain_options),
    "ament_python": BuildType(python.recipe, places),
    "python": BuildType(python.plain_recipe, places),
}
