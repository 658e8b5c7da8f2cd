"""The compilers' facts, found out once per build folder and handed to every new package.

CMake asks a compiler for its version, its search paths and its word size in some ten small compilations
whenever it configures a new folder: 0.2 s for each package. It keeps the answers in CMakeFiles/VERSION/ and
in its cache, and believes them in a folder that has both. A reference project that does nothing but
enable C and C++ is configured once for each set of options, compilers and variables; its answers are
copied into new folders whose CMakeLists.txt cannot have wanted others. ROS's own ament looks for Python
in every package, which starts the interpreter five times more: it gets these answers the same way.
"""

from __future__ import annotations

import hashlib
import re
import shutil
import subprocess
import threading
from typing import TYPE_CHECKING

from forge.files import read_text, replace_file
from forge.tools import calls_make

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from forge.model import Pairs

FOLDER = "forge_toolchain"

_PROJECT = """\
# forge asks CMake here, once for all packages, what the compilers are.
cmake_minimum_required(VERSION 3.18)
project(forge_toolchain C CXX)
"""
_ASKS_PYTHON = "find_package(Python3 COMPONENTS Interpreter QUIET)\n"
# What belongs to the reference project itself, or is said anew for each package.
_OWN = re.compile(
    r"^(forge_toolchain_.*|CMAKE_PROJECT_.*|CMAKE_HOME_DIRECTORY|CMAKE_CACHEFILE_DIR|CMAKE_INSTALL_PREFIX"
    r"|CMAKE_FIND_PACKAGE_REDIRECTS_DIR|CMAKE_NUMBER_OF_MAKEFILES|CMAKE_(C|CXX)_FLAGS):"
)
_ANY = re.compile(r"(?!//|#)[^:]+:")
_OF_PYTHON = re.compile(r"_?Python3_\w+:|CMAKE_CACHE_\w+_VERSION:")
"""What a project that compiles nothing gets: the cache's own version, without which CMake calls it old."""
_COMMENT = re.compile(r"#\[\[.*?\]\]|#[^\n]*", re.DOTALL)
_HARMLESS = re.compile(
    r"\s*(cmake_minimum_required\s*\([^()]*\)|set\s*\(\s*(?!CMAKE_|ENV\b)\w+[^()$]*\))", re.IGNORECASE
)
_NO_LANGUAGE = re.compile(r"\bNONE\b")
_BEGINS_WITH_PROJECT = re.compile(r"\s*project\s*\([^()$]*\)", re.IGNORECASE)


class Toolchain:
    """The answers for one build; the first package that wants them waits for the reference project."""

    def __init__(
        self,
        build: Path,
        cmake: Path,
        arguments: tuple[str, ...],
        circumstances: Pairs,
        python: Path | None = None,
    ) -> None:
        """Tell apart by what is asked of CMake, which programs are there and which variables; run nothing.

        `python` is the interpreter that packages look for, None where none does.
        """
        if python is not None:
            arguments = (f"-DPython3_EXECUTABLE={python}", *arguments)
        self._asks_python = python is not None
        self._project = _PROJECT + (_ASKS_PYTHON if self._asks_python else "")
        said = "\0".join((str(cmake), *arguments, *(f"{name}={value}" for name, value in circumstances)))
        self._home = build / FOLDER / hashlib.blake2b(said.encode(), digest_size=8).hexdigest()
        self._argv = (str(cmake), "-S", str(self._home), "-B", str(self._home / "build"), *arguments)
        self._lock = threading.Lock()
        self._asked = False

    def seed(self, source: Path, build: Path, variables: Mapping[str, str]) -> bool:
        """Copy the answers into a build folder that CMake does not know yet; tell if that was done."""
        project = None if (build / "CMakeCache.txt").exists() else _usual_project(source)
        if project is None:
            return False
        compiles = not _NO_LANGUAGE.search(project)
        if not (compiles or self._asks_python):
            return False
        with self._lock:
            if not self._asked:
                self._ask(variables)
                self._asked = True
        answers = self._answers()
        if answers is None:
            return False
        if not compiles:
            replace_file(build / "CMakeCache.txt", self._cache(_OF_PYTHON))
            return True
        (build / "CMakeFiles").mkdir(parents=True, exist_ok=True)
        target = build / "CMakeFiles" / answers.name
        shutil.rmtree(target, ignore_errors=True)
        shutil.copytree(answers, target, ignore=shutil.ignore_patterns("CompilerId*"))
        replace_file(build / "CMakeCache.txt", self._cache())
        return True

    def _ask(self, variables: Mapping[str, str]) -> None:
        """Configure the reference project, unless an earlier build did."""
        if self._answers() is not None:
            return
        shutil.rmtree(self._home, ignore_errors=True)
        replace_file(self._home / "CMakeLists.txt", self._project.encode())
        subprocess.run(
            self._argv, env=dict(variables), stdin=subprocess.DEVNULL, capture_output=True, check=False
        )

    def _answers(self) -> Path | None:
        """Return the folder of answers, or None when there are none: then every package asks itself."""
        build = self._home / "build"
        # Written last, and only when both compilers work.
        if not any((build / name).is_file() for name in ("build.ninja", "Makefile")):
            return None
        return next(build.glob("CMakeFiles/[0-9]*"), None)

    def _cache(self, wanted: re.Pattern[str] = _ANY) -> bytes:
        """Return what is wanted of the reference project's cache, never what is its own."""
        text = (self._home / "build" / "CMakeCache.txt").read_text(encoding="utf-8")
        lines = [line for line in text.splitlines() if wanted.match(line) and not _OWN.match(line)]
        return ("\n".join(lines) + "\n").encode()


def wants_the_usual(source: Path) -> bool:
    """Tell if a package compiles, and nothing that stands before project() can bear on the compilers.

    A package that sets a toolchain or a compiler by itself, or includes a file that might, is asked as
    CMake always does; so is one that calls make, for its build tool is another than everybody's.
    """
    project = _usual_project(source)
    return project is not None and not _NO_LANGUAGE.search(project)


def _usual_project(source: Path) -> str | None:
    """Return the call of project() that nothing before it can bear on, or None."""
    try:
        text = _COMMENT.sub("", read_text(source / "CMakeLists.txt"))
    except OSError:
        return None
    if calls_make(text):
        return None
    while match := _HARMLESS.match(text):
        text = text[match.end() :]
    project = _BEGINS_WITH_PROJECT.match(text)
    return project.group() if project else None
