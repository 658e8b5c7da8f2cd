"""The file by which CMake runs the scripts of a distribution's ament in a warm process; pure.

ament_cmake starts Python twice while it configures a package: to read package.xml, and to find the templates
of ament_package. Most of their time is spent on imports.
"""

from __future__ import annotations

from itertools import islice
from typing import TYPE_CHECKING

from forge.base.cmake_syntax import quoted

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

    from forge.build.recipes.context import BuildContext
    from forge.workspace.model import Package


def files(folder: Path, context: BuildContext) -> tuple[tuple[Path, str], ...]:
    """Return the file, to be written into forge's folder of a build folder; none if the user opted out."""
    from forge.base.templating import render

    if not context.script_launcher:
        return ()
    text = render(
        "cmake/ament_scripts.cmake.j2",
        launcher=" ".join(map(quoted, context.script_launcher)),
        launcher_program=quoted(context.script_launcher[0]),
    )
    return ((folder / "ament_scripts.cmake", text),)


def are_worth_a_worker(packages: Iterable[Package], context: BuildContext) -> bool:
    """Tell whether several packages are going to be configured: starting a worker costs as much as one."""
    if not context.script_launcher:
        return False
    new = (
        package
        for package in packages
        if package.build_type == "ament_cmake"
        and not (context.layout.build_dir(package.name) / "CMakeCache.txt").exists()
    )
    return len(list(islice(new, 2))) > 1
