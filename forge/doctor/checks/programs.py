"""Checks the programs of a build: whether they exist, run, and are new enough."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from typing import TYPE_CHECKING

from forge.base.errors import GroupedProblems, HostError, Location, Problem
from forge.base.own_environment import extra_command, install_beside_forge
from forge.doctor.checks.model import CheckResult, graded
from forge.environment.install_state import recorded_python
from forge.environment.shells import SHELLS
from forge.toolchain.interpreter import find_interpreter, other_than_recorded
from forge.toolchain.programs import (
    CMAKE_TYPES,
    compiled_packages,
    compiler_words,
    find_cmake,
    find_ninja,
    find_program,
    no_builder,
    no_cmake,
    no_compiler,
)
from forge.toolchain.python_modules import interpreter_properties, missing_modules_problem
from forge.workspace.cmake_text import calls
from forge.workspace.resolve import INTERFACE_GROUP

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence
    from pathlib import Path

    from forge.doctor.checks.model import CheckContext
    from forge.toolchain.interpreter import Interpreter
    from forge.workspace.model import Package

_OLDEST_CMAKE = (3, 18)
_POLICIES_GONE, _LEAST_POLICY = (4, 0), (3, 5)
"""From the former CMake version on, projects written for versions before the latter are rejected."""

_PROGRAM = "#include <optional>\nint main() { if constexpr (true) { return std::optional(0).value(); } }\n"
_VERSION = re.compile(r"\d+(?:\.\d+)+")
_HEADERS = re.compile(r"pybind11|PythonLibs|Python3?\b[^)]*\bDevelopment|Python3_add_library|nanobind")
_SPEAKS_SH = frozenset({"ash", "busybox", "dash", "ksh", "mksh"})
_PROJECT_TABLE = (61, 0)
"""The first setuptools that reads project metadata from pyproject.toml."""


def compiler(subject: CheckContext) -> CheckResult:
    """Check for a C++ compiler with C++17 support."""
    compiled = compiled_packages(subject.packages.values())
    words = compiler_words(subject.variables)
    if not words:
        return graded("compiler", "none", (no_compiler(compiled),), serious=bool(compiled))
    summary = " ".join(words)
    argv = (*words, "-std=c++17", "-x", "c++", "-fsyntax-only", "-")
    failure = _failure(subject, argv, _PROGRAM)
    if failure is None:
        return CheckResult("compiler", f"{summary} {_version(subject, words)}, C++17")
    hint = "install g++ 9 or clang++ 9 or newer with its standard library, or set CXX to one"
    problem = Problem(f"'{summary}' cannot compile C++17: {failure}", hint=hint)
    return graded("compiler", summary, (problem,), serious=bool(compiled))


def cmake(subject: CheckContext) -> CheckResult:
    """Check CMake and the versions that packages require."""
    cmake_packages = [package for package in subject.packages.values() if package.build_type in CMAKE_TYPES]
    program = find_cmake(subject.variables)
    if program is None:
        return graded("cmake", "none", (no_cmake(cmake_packages),), serious=bool(cmake_packages))
    version = _version(subject, [str(program)])
    if not version:
        hint = f"install another CMake, for example with `{extra_command('cmake')}`, or set CMAKE_COMMAND"
        problem = Problem(f"'{program}' does not run", hint=hint)
        return graded("cmake", str(program), (problem,), serious=bool(cmake_packages))
    found = _numbers(version)
    problems = [problem for package in cmake_packages for problem in _minimum(subject, package, found)]
    if found < _OLDEST_CMAKE:
        hint = f"install a newer one, for example with `{extra_command('cmake')}`"
        problems.append(Problem(f"CMake {version} at '{program}' is older than 3.18", hint=hint))
    return CheckResult("cmake", f"{version} ({program})", errors=tuple(problems))


def builder(subject: CheckContext) -> CheckResult:
    """Check for Ninja or make."""
    cmake_packages = [package for package in subject.packages.values() if package.build_type in CMAKE_TYPES]
    found = {"ninja": find_ninja(subject.variables), "make": find_program("make", subject.variables)}
    summary = ", ".join(
        f"{name} {_version(subject, [str(path)]) or 'that does not run'}"
        for name, path in found.items()
        if path
    )
    if summary or "CMAKE_GENERATOR" in subject.variables:
        return CheckResult("ninja", summary or subject.variables["CMAKE_GENERATOR"])
    return graded("ninja", "none", (no_builder(cmake_packages),), serious=bool(cmake_packages))


def python(subject: CheckContext) -> CheckResult:
    """Check the interpreter of a build and its modules."""
    try:
        interpreter = find_interpreter(subject.python, subject.variables, subject.underlays.chain)
        known = interpreter_properties(interpreter.path, ("numpy", "em", "catkin_pkg", "lark"))
    except HostError as fault:
        return CheckResult("python", "none", errors=fault.problems)
    has = frozenset(known)
    errors = [*_missing_modules(subject, interpreter, has), *_missing_header(subject, interpreter, has)]
    setuptools = known.get("setuptools", "")
    errors += _old_setuptools(subject, interpreter, setuptools)
    summary = f"{known['version']} ({interpreter.path}, {interpreter.origin}), "
    summary += f"setuptools {setuptools or 'bundled with forge'}"
    warnings = other_than_recorded(recorded_python(subject.layout.install), interpreter)
    return CheckResult("python", summary, errors=tuple(errors), warnings=warnings)


def shells(subject: CheckContext) -> CheckResult:
    """List the shells with setup scripts, and check the login shell."""
    path = subject.surroundings.get("PATH", os.defpath)
    found = [name for name in SHELLS if shutil.which(name, path=path)]
    login = subject.surroundings.get("SHELL", "").rpartition("/")[2]
    summary = " ".join(found) + (f"; yours is {login}" if login else "")
    if not login or login in SHELLS or login in _SPEAKS_SH:
        return CheckResult("shells", summary)
    hint = "start it with 'forge shell' in the environment of the workspace, or use 'forge env'"
    return CheckResult(
        "shells", summary, warnings=(Problem(f"no setup script for shell '{login}'", hint=hint),)
    )


def _minimum(subject: CheckContext, package: Package, version: tuple[int, ...]) -> Iterator[Problem]:
    call = next(
        (
            call
            for call in calls(subject.text(package, "CMakeLists.txt"))
            if call.command == "cmake_minimum_required" and call.words[:1] == ("VERSION",) and call.words[1:]
        ),
        None,
    )
    least, _, most = call.words[1].partition("...") if call else ("", "", "")
    if call is None or not _VERSION.fullmatch(least):
        return
    place = Location(package.path / "CMakeLists.txt", call.line)
    shown = ".".join(map(str, version))
    if _numbers(least) > version:
        hint = f"install a newer one, for example with `{install_beside_forge(f'cmake>={least}')}`"
        yield Problem(f"'{package.name}' requires CMake {least}, but CMake {shown} is installed", place, hint)
    elif version >= _POLICIES_GONE and _numbers(most or least) < _LEAST_POLICY:
        hint = f"use VERSION {least}...3.10, or build with --cmake-args -DCMAKE_POLICY_VERSION_MINIMUM=3.5"
        requested = f"requests compatibility with CMake {most or least}"
        message = f"'{package.name}' {requested}, which CMake {shown} no longer supports"
        kind = GroupedProblems(
            message.replace(f"'{package.name}' requests", "{} request", 1), package.name, hint
        )
        yield Problem(message, place, hint, kind)


def _missing_modules(
    subject: CheckContext, interpreter: Interpreter, has: frozenset[str]
) -> Iterator[Problem]:
    packages = subject.packages.values()
    wanted = ["numpy"] if any(INTERFACE_GROUP in package.manifest.groups for package in packages) else []
    prefixes = subject.underlays.prefixes
    if packages and _has_package("ament_cmake_core", prefixes):
        wanted.append("catkin_pkg")
    if wanted[:1] == ["numpy"] and _has_package("rosidl_cmake", prefixes):
        wanted += ["em", "lark"]
    missing = [name for name in wanted if name not in has]
    if missing:
        yield missing_modules_problem(interpreter.path, missing)


def _has_package(name: str, prefixes: Iterable[Path]) -> bool:
    """Tell whether a package itself is installed, and not an embedded package that stands in for it."""
    return any((prefix / "share" / name / "package.xml").is_file() for prefix in prefixes)


def _missing_header(
    subject: CheckContext, interpreter: Interpreter, has: frozenset[str]
) -> Iterator[Problem]:
    if "header" in has:
        return
    for package in subject.packages.values():
        if package.build_type in CMAKE_TYPES and _HEADERS.search(subject.text(package, "CMakeLists.txt")):
            why = f"but '{interpreter.path}' has no Python.h"
            hint = (
                "install its headers, for example with `apt install python3-dev` or `dnf install "
                "python3-devel`"
            )
            yield Problem(
                f"'{package.name}' compiles a Python extension, {why}",
                Location(package.path / "CMakeLists.txt"),
                hint,
                GroupedProblems(f"{{}} compile Python extensions, {why}", package.name, hint),
            )


def _old_setuptools(subject: CheckContext, interpreter: Interpreter, version: str) -> Iterator[Problem]:
    """Yield packages with metadata only in pyproject.toml if setuptools is too old."""
    if not version or _numbers(version) >= _PROJECT_TABLE:
        return
    for package in subject.packages.values():
        text = subject.text(package, "pyproject.toml")
        if "[project]" in text and "setuptools" in text:
            yield Problem(
                f"'{package.name}' needs a setuptools that supports pyproject.toml, which {version} does not",
                Location(package.path / "pyproject.toml"),
                f"{interpreter.path} -m pip install -U setuptools",
            )


def _version(subject: CheckContext, words: Sequence[str]) -> str:
    """Return the version that a program reports, '' if it does not run."""
    try:
        done = subprocess.run(
            [*words, "--version"],
            env=dict(subject.variables),
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            errors="replace",
            check=True,
            timeout=20,
        )
    except (OSError, subprocess.SubprocessError):
        return ""
    found = _VERSION.search(done.stdout)
    return found[0] if found else ""


def _failure(subject: CheckContext, argv: Sequence[str], text: str) -> str | None:
    """Return why a program rejects a text, in one line; None if it accepts it."""
    try:
        done = subprocess.run(
            argv,
            env=dict(subject.variables),
            input=text,
            capture_output=True,
            text=True,
            errors="replace",
            check=False,
            timeout=60,
        )
    except OSError as error:
        return (error.strerror or str(error)).lower()
    except subprocess.TimeoutExpired:
        return "timeout after a minute"
    if not done.returncode:
        return None
    lines = [line for line in done.stderr.splitlines() if "error" in line] or done.stderr.splitlines()
    return lines[0].strip() if lines else f"exit code {done.returncode}"


def _numbers(version: str) -> tuple[int, ...]:
    return tuple(map(int, re.findall(r"\d+", version)))
