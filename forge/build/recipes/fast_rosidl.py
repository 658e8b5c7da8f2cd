"""Steps and files by which a distribution's own rosidl builds interface packages faster; pure."""

from __future__ import annotations

import shlex
from typing import TYPE_CHECKING

from forge.base.cmake_syntax import quoted
from forge.base.layout import UNITS_FAILED_FILE
from forge.toolchain.precompiled_headers import CXX_HEADERS, PYTHON_HEADERS
from forge.workspace.resolve import INTERFACE_GROUP

if TYPE_CHECKING:
    from pathlib import Path

    from forge.build.recipes.context import BuildContext
    from forge.workspace.model import Package

_C_MESSAGES = 64
_CXX_MESSAGES = 32
"""Messages per compiled unit. One more message costs a unit about 1 MB, the headers in C++ 30 MB: without -O.

So a unit needs about 60 MB, as one source does without precompiled headers, and compilers together no more
than without units. A package has eight targets or so, so even a small one has enough units for eight
processors.
"""

_BUILD = r"""[ -e "$0" ] && exec "$@"
"$@" && exit
code=$?
[ -e "$0" ] || exit "$code"
echo "forge: the generated sources do not compile together; compiling them one by one" >&2
"$1" "$3" && exec "$@"
"""
"""Builds, and builds again without units if one could not be compiled. $0 is the marker of that."""


def is_accelerated(package: Package, context: BuildContext) -> bool:
    """Tell whether a package generates interfaces with rosidl, and the user did not opt out."""
    return bool(context.generator_launcher) and INTERFACE_GROUP in package.manifest.groups


def files(folder: Path, context: BuildContext) -> tuple[tuple[Path, str], ...]:
    """Return the files that CMake and its rules use, to be written into forge's folder of a build folder."""
    from forge.base.templating import render

    marker, script = _marker(folder), folder / "compile_generated.sh"
    include = render(
        "cmake/fast_rosidl.cmake.j2",
        marker=quoted(str(marker)),
        c_messages=_C_MESSAGES,
        cxx_messages=_CXX_MESSAGES,
        cxx_headers=CXX_HEADERS,
        python_headers=PYTHON_HEADERS,
        compile_launcher=quoted(shlex.join(("sh", str(script), str(marker)))),
        launcher_program=quoted(context.generator_launcher[0]),
        generator_launcher=quoted(shlex.join(context.generator_launcher)),
    )
    return (folder / "fast_rosidl.cmake", include), (script, render("cmake/compile_generated.sh.j2"))


def build_argv(folder: Path, argv: tuple[str, ...]) -> tuple[str, ...]:
    """Return the command line of the build step for `argv`, which is `cmake --build FOLDER ...`."""
    return ("sh", "-c", _BUILD, str(_marker(folder)), *argv)


def _marker(folder: Path) -> Path:
    return folder.parent / UNITS_FAILED_FILE
