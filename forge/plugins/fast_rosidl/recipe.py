"""Files, launchers and a worker that speed up a distribution's rosidl, ament and rclcpp_components.

- The generators of interface packages run in a worker, and generated sources are compiled in units.
- ament_cmake starts Python twice while it configures a package, to read package.xml and to find the templates
  of ament_package. Most of their time is spent on imports, so they run in the same worker.
- rclcpp_components generates a main program for each node. All of them include the headers of rclcpp and
  little else: three seconds each, one with a precompiled header.
"""

from __future__ import annotations

import hashlib
import re
import shlex
import shutil
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from itertools import islice
from pathlib import Path

from forge.base.cmake_syntax import quoted
from forge.base.files import text_or_nothing, write_if_changed
from forge.base.frozen import Pairs
from forge.base.layout import PACKAGE, TEMPLATES_DIR, TOOLCHAIN_DIR, UNITS_FAILED_FILE
from forge.build.recipes.cmake import scratch_folder
from forge.build.recipes.context import Addition, BuildContext
from forge.build.up_to_date import FAST_ROSIDL
from forge.workspace.model import Package
from forge.workspace.resolve import GENERATORS, INTERFACE_GROUP

WORKER_VARIABLE = "FORGE_ROSIDL_WORKER"

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
"""Builds, and rebuilds without units if one could not be compiled, as the marker $0 shows."""

_LAUNCHER = (
    *(sys.executable, "-S", "-E", str(PACKAGE / "execution/worker_client.py")),
    *("--in", WORKER_VARIABLE),
)


def options(package: Package, context: BuildContext) -> tuple[str, ...]:
    """Return the option of packages whose build differs without this plugin."""
    return (FAST_ROSIDL,) if _has_interfaces(package, context) or _has_nodes(package, context) else ()


def addition(package: Package, context: BuildContext) -> Addition:
    """Return the files that CMake and its rules use, and the script that rebuilds without units."""
    from forge.base.templating import render

    if package.build_type != "ament_cmake":
        return Addition()
    folder = scratch_folder(context.layout.build_dir(package.name))
    program = quoted(_LAUNCHER[0])
    files = []
    if "ament_cmake" not in context.embedded:
        launcher = " ".join(map(quoted, _LAUNCHER))
        names = {"launcher": launcher, "launcher_program": program}
        files.append(("ament_scripts.cmake", render(f"{_TEMPLATES}/ament_scripts.cmake.j2", **names)))
    if _has_nodes(package, context):
        files.append(("component_nodes.cmake", render(f"{_TEMPLATES}/component_nodes.cmake.j2")))
    marker = str(folder.parent / UNITS_FAILED_FILE)
    has_interfaces = _has_interfaces(package, context)
    if has_interfaces:
        script = "compile_generated.sh"
        text = render(
            f"{_TEMPLATES}/fast_rosidl.cmake.j2",
            marker=quoted(marker),
            c_messages=_C_MESSAGES,
            cxx_messages=_CXX_MESSAGES,
            cxx_headers=CXX_HEADERS,
            python_headers=PYTHON_HEADERS,
            compile_launcher=quoted(shlex.join(("sh", str(folder / script), marker))),
            launcher_program=program,
            generator_launcher=quoted(shlex.join(_LAUNCHER)),
        )
        files += ("fast_rosidl.cmake", text), (script, render(f"{_TEMPLATES}/{script}.j2"))
    return Addition(
        tuple((folder / name, text) for name, text in files),
        ("sh", "-c", _BUILD, marker) if has_interfaces else (),
    )


_TEMPLATES = "fast_rosidl/templates"


@contextmanager
def running(
    packages: Sequence[Package], context: BuildContext, variables: Mapping[str, str], compilers: Pairs
) -> Iterator[Mapping[str, str]]:
    """Run the worker for generators and scripts, and prepare the folder of precompiled headers."""
    has_interfaces = any(_has_interfaces(package, context) for package in packages)
    if not (has_interfaces or _configures_several(packages, context)):
        yield {}
        return
    from forge.base.env_vars import compiled_templates

    cache = compiled_templates(variables, context.layout.build / TEMPLATES_DIR)[0]
    with rosidl_worker(context.python, cache, variables) as worker_variables:
        if has_interfaces and not context.launcher:
            worker_variables |= prepare_precompiled_headers(context.layout.build, compilers)
        yield worker_variables


@contextmanager
def rosidl_worker(python: Path, cache: Path, variables: Mapping[str, str]) -> Iterator[dict[str, str]]:
    """Start a worker and yield the variable that lets clients connect; stop it at the end of the block.

    `python` is the workspace's interpreter; `cache` is the folder for compiled templates.
    """
    from forge.execution.fork_server import started_server

    program = str(Path(__file__).with_name("worker.py"))
    environment = {name: value for name, value in variables.items() if name != "PYTHONPATH"}

    def command(descriptor: int) -> tuple[str, ...]:
        return str(python), program, str(descriptor), str(cache)

    with started_server(command, environment) as address:
        yield {WORKER_VARIABLE: address}


def _uses_ros(package: Package, context: BuildContext) -> bool:
    return package.build_type == "ament_cmake" and GENERATORS not in context.embedded


def _has_interfaces(package: Package, context: BuildContext) -> bool:
    """Return whether a package generates interfaces with rosidl."""
    return _uses_ros(package, context) and INTERFACE_GROUP in package.manifest.groups


def _has_nodes(package: Package, context: BuildContext) -> bool:
    """Return whether a package may register component nodes."""
    names = (dependency.name for dependency in package.manifest.dependencies)
    return _uses_ros(package, context) and "rclcpp_components" in names


def _configures_several(packages: Sequence[Package], context: BuildContext) -> bool:
    """Return whether several packages run scripts of ament.

    Starting a worker takes as long as it saves for one.
    """
    if "ament_cmake" in context.embedded:
        return False
    new = (
        package
        for package in packages
        if package.build_type == "ament_cmake"
        and not (context.layout.build_dir(package.name) / "CMakeCache.txt").exists()
    )
    return len(list(islice(new, 2))) > 1


HEADERS_VARIABLE = "FORGE_PRECOMPILED_HEADERS"
"""The folder, in the environment of builds."""

CXX_HEADERS = "standard_headers.hpp"
PYTHON_HEADERS = "python_headers.h"
_TEXTS = {
    CXX_HEADERS: """\
// Headers of the C++ library that generated sources include; precompiled for each set of options.
#include <array>
#include <istream>
#include <limits>
#include <map>
#include <memory>
#include <string>
#include <vector>
""",
    PYTHON_HEADERS: """\
// Headers that generated Python extensions include; precompiled for each set of options.
#include <Python.h>
#include <stdbool.h>
#include <stdint.h>
""",
}
_PATH = re.compile(r"(?:\\.|[^\s\\])+")


def prepare_precompiled_headers(build: Path, tools: Pairs) -> dict[str, str]:
    """Prepare the folder in a workspace's build folder; return the variable that names it.

    `tools` are the programs and variables that compilers depend on. Removes headers that were precompiled by
    other tools, from outdated headers, or incompletely.
    """
    above = build / TOOLCHAIN_DIR / "headers"
    key = "\0".join(f"{name}={identity}" for name, identity in tools)
    folder = above / hashlib.blake2b(key.encode(errors="surrogateescape"), digest_size=8).hexdigest()
    for other in above.glob("*"):
        if other != folder:
            shutil.rmtree(other, ignore_errors=True)
    folder.mkdir(parents=True, exist_ok=True)
    for header, text in _TEXTS.items():
        write_if_changed(folder / header, text)
    for one in folder.iterdir():
        if one.is_dir() and not any(_is_current(one, header, text) for header, text in _TEXTS.items()):
            shutil.rmtree(one, ignore_errors=True)
    return {HEADERS_VARIABLE: str(folder)}


def _is_current(folder: Path, header: str, text: str) -> bool:
    """Return whether a folder has a precompiled header, none of whose included files has changed since.

    Compares change times, since an installed package keeps the modification times of its files.
    """
    _, colon, paths = text_or_nothing(folder / f"{header}.d").replace("\\\n", " ").partition(":")
    try:
        (folder / f"{header}.gch").stat()
        ready_ns = (folder / "ready").stat().st_mtime_ns
        headers = (re.sub(r"\\(.)", r"\1", path) for path in _PATH.findall(paths))
        unchanged = all((folder / path).stat().st_ctime_ns < ready_ns for path in headers)
        return bool(colon) and unchanged and text_or_nothing(folder / header) == text
    except OSError:
        return False
