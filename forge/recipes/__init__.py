"""Build type to steps: the table, and what every recipe is told.

A recipe is a pure function of a package and a Kitchen; a new build type is one more line here.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from forge.recipes import cmake, python

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from forge.model import Package
    from forge.recipes.kitchen import Kitchen, Recipe

RECIPES: Mapping[str, Callable[[Package, Kitchen], Recipe]] = {
    "ament_cmake": cmake.ament_recipe,
    "cmake": cmake.plain_recipe,
    "ament_python": python.recipe,
}
