"""Detects compilers once per build folder and reuses the result for new packages.

When CMake configures a new folder, it detects the compilers with about ten small compilations: 0.2 s per
package. It stores the results in CMakeFiles/VERSION/ and in its cache, and trusts them in a folder that
contains both. A reference project that only enables C and C++ is configured once for each set of options and
variables; its results are copied into new folders whose CMakeLists.txt cannot require others. They are used
until an observed input of CMake or the compilers changes, or by one run of forge if that is unknown. If no
package needs C++, the reference project enables only C: some cross compilers compile their C++ library when
they are tested. ROS's own ament also searches Python in every package, which starts the interpreter five
times: these results are copied, too.
"""

from __future__ import annotations

import json
import re
import shutil
import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from forge.base.files import has_text, read_json, remove_tree, replace_file, text_or_nothing
from forge.base.frozen import Pairs, frozen
from forge.base.layout import TOOLCHAIN_DIR
from forge.base.text import digest
from forge.build.inputs.fingerprints import FileTable, contents_of
from forge.build.recipes.cmake import common_arguments
from forge.engine.commands import Folders
from forge.engine.observer import run_observed
from forge.toolchain.cmake_variables import unused_variables
from forge.toolchain.programs import calls_make
from forge.workspace.cmake_text import any_enables_cxx, calls

if TYPE_CHECKING:
    from forge.build.state import BuildState
    from forge.build.tasks import BuildPlan
    from forge.cli.preparation import PreparedBuild
    from forge.engine.world import World

_PROJECT = """\
# forge detects the compilers here, once for all packages.
cmake_minimum_required(VERSION 3.18)
project(forge_toolchain {languages})
"""
_READ = "read.json"
_DIGEST, _UNUSED = "digest", "unused_variables"
"""The variables of CMake's arguments that the reference project does not use, one per line."""

_FIND_PYTHON = "find_package(Python3 COMPONENTS Interpreter QUIET)\n"
# Entries of the reference project itself, and those set for each package.
_OWN = re.compile(
    r"^(forge_toolchain_.*|CMAKE_PROJECT_.*|CMAKE_HOME_DIRECTORY|CMAKE_CACHEFILE_DIR|CMAKE_INSTALL_PREFIX"
    r"|CMAKE_FIND_PACKAGE_REDIRECTS_DIR|CMAKE_NUMBER_OF_MAKEFILES|CMAKE_(C|CXX)_FLAGS):"
)
_ANY = re.compile(r"(?!//|#)[^:]+:")
_OF_PYTHON = re.compile(r"_?Python3_\w+:|CMAKE_CACHE_\w+_VERSION:")
"""Entries for a project without compilers; CMake considers a cache without its version outdated."""
_OWN_VARIABLE = re.compile(r"(?!CMAKE_|ENV\b)\w+", re.IGNORECASE)


@frozen
class Surroundings:
    """The observer of the reference project, and the environment to compare with later."""

    world: World
    table: FileTable
    library: Path | None


def seed_of(
    plan: BuildPlan, build: PreparedBuild, state: BuildState, library: Path | None
) -> Callable[[Path, Path, Mapping[str, str]], frozenset[str]] | None:
    """Return the function that copies detected compilers into new build folders of CMake packages.

    None without CMake, and if ament packages get extra arguments, which may select another compiler.
    """
    context = build.context
    if context.cmake is None or context.ament_cmake_args:
        return None
    # Unlike the embedded one, other versions of ament_cmake look for Python.
    ament = build.loaded.resolution.packages.get("ament_cmake")
    uses_ament = any(task.package.build_type == "ament_cmake" for task in plan.tasks.values())
    packages = (task.package for task in plan.tasks.values() if not task.package.embedded)
    toolchain = Toolchain(
        context.layout.build,
        context.cmake,
        common_arguments(context),
        build.compilers,
        context.python if uses_ament and not (ament and ament.embedded) else None,
        languages="C CXX" if any_enables_cxx(packages) else "C",
        observed=Surroundings(state.world, state.table, library),
    )
    return toolchain.seed


class Toolchain:
    """The detection results for one build; the first package that needs them runs the reference project."""

    def __init__(
        self,
        build: Path,
        cmake: Path,
        arguments: tuple[str, ...],
        identity: Pairs,
        python: Path | None = None,
        *,
        languages: str = "C CXX",
        observed: Surroundings | None = None,
    ) -> None:
        """Identify the results by CMake's arguments, the programs and the variables; run nothing.

        `python` is the interpreter that packages search, None if none does; `languages` are the CMake
        languages that packages enable. Without `observed`, only this run of forge uses the results.
        """
        self._observed = observed
        if python is not None:
            arguments = (f"-DPython3_EXECUTABLE={python}", *arguments)
        self._asks_python = python is not None
        self._project = _PROJECT.format(languages=languages) + (_FIND_PYTHON if self._asks_python else "")
        key = digest(str(cmake), languages, *arguments, *(f"{name}={value}" for name, value in identity))
        self._home = build / TOOLCHAIN_DIR / key
        self._argv = (str(cmake), "-S", str(self._home), "-B", str(self._home / "build"), *arguments)
        self._lock = threading.Lock()
        self._asked = False

    def seed(self, source: Path, build: Path, variables: Mapping[str, str]) -> frozenset[str]:
        """Copy the results into a new build folder; return their observed inputs."""
        project = None if (build / "CMakeCache.txt").exists() else usual_project(source)
        if project is None:
            return frozenset()
        compiles = "NONE" not in project
        if not (compiles or self._asks_python):
            return frozenset()
        with self._lock:
            if not self._asked:
                self._configure(variables)
                self._asked = True
        answers = self._results()
        if answers is None:
            return frozenset()
        inputs = frozenset(read_json(self._home / _READ))
        if not compiles:
            replace_file(build / "CMakeCache.txt", self._cache(_OF_PYTHON))
            return inputs
        (build / "CMakeFiles").mkdir(parents=True, exist_ok=True)
        target = build / "CMakeFiles" / answers.name
        remove_tree(str(target))
        shutil.copytree(answers, target, ignore=shutil.ignore_patterns("CompilerId*"))
        replace_file(build / "CMakeCache.txt", self._cache())
        return inputs

    def _configure(self, variables: Mapping[str, str]) -> None:
        """Configure the reference project, unless an earlier build did."""
        if self._results() is not None and has_text(self._home / _DIGEST, self._digest()):
            recorded = read_json(self._home / _READ)
            if recorded and self._observed and contents_of(recorded, self._observed.table) == recorded:
                return
        remove_tree(str(self._home))
        replace_file(self._home / "CMakeLists.txt", self._project.encode())
        library, world = (self._observed.library, self._observed.world) if self._observed else (None, None)
        folders = Folders(self._home, (), (), world)
        # Steps cannot remove files from the folder of their log.
        result, accesses = run_observed(
            self._argv, self._home, variables, library, self._home / "observed" / "log", folders
        )
        if self._observed and not accesses.blind:
            # The folder that forge puts first in PATH contains programs of the whole build.
            own = f"{self._home.parent.parent}/"
            inputs = sorted(each for each in accesses.external | accesses.asked if own not in each)
            read = contents_of(inputs, self._observed.table)
            replace_file(self._home / _READ, json.dumps(read).encode())
        replace_file(self._home / _UNUSED, "\n".join(sorted(unused_variables(result.stderr))).encode())
        replace_file(self._home / _DIGEST, self._digest().encode())

    def _digest(self) -> str:
        """Return a digest of the results, to detect damaged ones."""
        build = self._home / "build"
        own = (self._home / name for name in (_UNUSED, _READ))
        files = (*own, build / "CMakeCache.txt", *sorted(build.glob("CMakeFiles/[0-9]*/*")))
        return digest(*(path.read_bytes().hex() for path in files if path.is_file()))

    def _results(self) -> Path | None:
        """Return the folder of results; None if packages must detect compilers themselves."""
        build = self._home / "build"
        # CMake writes the former last, and only if both compilers work.
        built = any((build / name).is_file() for name in ("build.ninja", "Makefile"))
        if not (built and (self._home / _UNUSED).is_file()):
            return None
        return next(build.glob("CMakeFiles/[0-9]*"), None)

    def _cache(self, wanted: re.Pattern[str] = _ANY) -> bytes:
        """Return the matching entries of the reference project's cache, except its own and unused ones.

        CMake does not warn about an unused variable on its command line that is in the cache.
        """
        text = text_or_nothing(self._home / "build" / "CMakeCache.txt")
        unused = frozenset(text_or_nothing(self._home / _UNUSED).splitlines())
        lines = [
            line
            for line in text.splitlines()
            if wanted.match(line) and not _OWN.match(line) and line.partition(":")[0] not in unused
        ]
        return ("\n".join(lines) + "\n").encode()


def usual_project(source: Path) -> tuple[str, ...] | None:
    """Return the arguments of a package's project() if no prior command may affect its compilers, else None.

    CMake finds the compilers of packages that set a toolchain or compiler or include a file before project(),
    and of packages that call make, because they use another build tool.
    """
    text = text_or_nothing(source / "CMakeLists.txt")
    for call in calls(text) if not calls_make(text) else ():
        words = "".join(call.words)
        is_literal = not any(character in words for character in "()$")
        if call.command == "project" and is_literal:
            return call.words
        if call.command != "cmake_minimum_required" and not (
            call.command == "set" and is_literal and _OWN_VARIABLE.match(words)
        ):
            return None
    return None
