"""A file by which packages that register component nodes compile the generated programs faster; pure.

rclcpp_components generates a main program for each node. All of them include the headers of rclcpp and little
else: three seconds each, one with a precompiled header.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path

    from forge.build.recipes.context import BuildContext
    from forge.workspace.model import Package


def is_accelerated(package: Package, context: BuildContext) -> bool:
    """Tell whether a package may register nodes, and the user did not opt out."""
    return bool(context.generator_launcher) and any(
        dependency.name == "rclcpp_components" for dependency in package.manifest.dependencies
    )


def files(folder: Path) -> tuple[tuple[Path, str], ...]:
    """Return the file, to be written into forge's folder of a build folder."""
    from forge.base.templating import render

    return ((folder / "component_nodes.cmake", render("cmake/component_nodes.cmake.j2")),)
