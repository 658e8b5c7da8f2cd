"""Checks the programs of a build: whether they exist, run, and are new enough."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from collections.abc import Iterator, Sequence

from forge.base.errors import GroupedProblems, HostError, Location, Problem, reason_of
from forge.base.extensions import OPTIONS, own_plugin
from forge.base.own_environment import extra_command, install_beside_forge
from forge.environment.install_state import recorded_python
from forge.environment.shells import SHELLS
from forge.plugins.doctor.model import CheckContext, CheckResult, graded
from forge.toolchain.interpreter import ask_python, find_interpreter
from forge.toolchain.programs import (
    COMPILERS,
    find_cmake,
    find_ninja,
    find_program,
    no_builder,
    no_cmake,
    no_compiler,
)
from forge.toolchain.python_modules import missing_modules_problem
from forge.workspace.cmake_text import calls, compiled_packages
from forge.workspace.model import CMAKE_TYPES, Package
from forge.workspace.resolve import INTERFACE_GROUP

_OLDEST_CMAKE = (3, 18)

_PROGRAM = "#include <optional>\nint main() { if constexpr (true) { return std::optional(0).value(); } }\n"
_TRAITS = """import importlib.metadata as m, importlib.util as u, os, sys, sysconfig
print("version=%d.%d.%d" % sys.version_info[:3])
header = sysconfig.get_path("include") + "/Python.h"
os.path.exists(header) and print("header=" + header)
for name in sys.argv[1:]:
    u.find_spec(name) and print(name + "=there")
try:
    print("setuptools=" + m.version("setuptools"))
except m.PackageNotFoundError:
    pass
"""
"""Prints an interpreter's version, the header with which C extensions are compiled, setuptools' version,
and the names of those modules that exist.
"""
_VERSION = re.compile(r"\d+(?:\.\d+)+")
_HEADERS = re.compile(r"pybind11|PythonLibs|Python3?\b[^)]*\bDevelopment|Python3_add_library|nanobind")
_SH_COMPATIBLE = frozenset({"ash", "busybox", "dash", "ksh", "mksh"})
_PROJECT_TABLE = (61, 0)
"""The first setuptools that reads project metadata from pyproject.toml."""


def compiler(subject: CheckContext) -> CheckResult:
    """Check for a C++ compiler with C++17 support."""
    compiled = compiled_packages(subject.packages.values())
    words = subject.variables.get("CXX", "").split()
    if not words:
        path = subject.variables.get("PATH", os.defpath)
        words = [program for name in COMPILERS if (program := shutil.which(name, path=path))][:1]
    if not words:
        return graded("compiler", "none", (no_compiler(compiled),), serious=bool(compiled))
    summary = " ".join(words)
    argv = (*words, "-std=c++17", "-x", "c++", "-fsyntax-only", "-")
    _, failure = _run(subject, argv, _PROGRAM)
    if not failure:
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
    numbers = _numbers(version)
    problems = [
        problem for package in cmake_packages for problem in _rejected_by_cmake(subject, package, numbers)
    ]
    if numbers < _OLDEST_CMAKE:
        hint = f"install a newer one, for example with `{extra_command('cmake')}`"
        problems.append(Problem(f"CMake {version} at '{program}' is older than 3.18", hint=hint))
    return CheckResult("cmake", f"{version} ({program})", errors=tuple(problems))


def builder(subject: CheckContext) -> CheckResult:
    """Check for Ninja or make."""
    cmake_packages = [package for package in subject.packages.values() if package.build_type in CMAKE_TYPES]
    programs = {"ninja": find_ninja(subject.variables), "make": find_program("make", subject.variables)}
    summary = ", ".join(
        f"{name} {_version(subject, [str(path)]) or 'that does not run'}"
        for name, path in programs.items()
        if path
    )
    if summary or "CMAKE_GENERATOR" in subject.variables:
        return CheckResult("ninja", summary or subject.variables["CMAKE_GENERATOR"])
    return graded("ninja", "none", (no_builder(cmake_packages),), serious=bool(cmake_packages))


def python(subject: CheckContext) -> CheckResult:
    """Check the interpreter of a build and its modules."""
    try:
        interpreter = find_interpreter(
            subject.python, subject.variables, subject.underlays.chain, root=subject.root
        )
        names = ("numpy", "em", "catkin_pkg", "lark")
        traits = dict(
            line.split("=", 1) for line in ask_python(interpreter.path, _TRAITS, *names).splitlines()
        )
    except HostError as fault:
        return CheckResult("python", "none", errors=fault.problems)
    setuptools = traits.get("setuptools", "")
    is_old = setuptools and _numbers(setuptools) < _PROJECT_TABLE
    packages, prefixes = subject.packages.values(), subject.underlays.prefixes

    def is_installed(name: str) -> bool:
        # An embedded replacement has no manifest with this name.
        return any((prefix / "share" / name / "package.xml").is_file() for prefix in prefixes)

    wanted = ["numpy"] if any(INTERFACE_GROUP in package.manifest.groups for package in packages) else []
    generators = ["em", "lark"] if wanted and is_installed("rosidl_cmake") else []
    wanted += ["catkin_pkg"] if packages and is_installed("ament_cmake_core") else []
    missing = [name for name in (*wanted, *generators) if name not in traits]
    errors = [missing_modules_problem(interpreter.path, missing)] if missing else []
    for package in packages:
        lists, text = subject.text(package, "CMakeLists.txt"), subject.text(package, "pyproject.toml")
        if "header" not in traits and package.build_type in CMAKE_TYPES and _HEADERS.search(lists):
            why = f"but '{interpreter.path}' has no Python.h"
            example = "`apt install python3-dev` or `dnf install python3-devel`"
            hint = f"install its headers, for example with {example}"
            message = f"'{package.name}' compiles a Python extension, {why}"
            group = GroupedProblems(f"{{}} compile Python extensions, {why}", package.name, hint)
            errors.append(Problem(message, Location(package.path / "CMakeLists.txt"), hint, group))
        if is_old and "[project]" in text and "setuptools" in text:
            which = f"a setuptools that supports pyproject.toml, which {setuptools} does not"
            hint = f"{interpreter.path} -m pip install -U setuptools"
            place = Location(package.path / "pyproject.toml")
            errors.append(Problem(f"'{package.name}' needs {which}", place, hint))
    summary = f"{traits['version']} ({interpreter.path}, {interpreter.origin}), "
    summary += f"setuptools {setuptools or 'bundled with forge'}"
    advice = own_plugin(OPTIONS, "advice-surroundings")
    recorded = recorded_python(subject.layout.install)
    warnings = tuple(advice.other_interpreter(recorded, interpreter)) if advice else ()
    return CheckResult("python", summary, errors=tuple(errors), warnings=warnings)


def shells(subject: CheckContext) -> CheckResult:
    """List the shells with setup scripts, and check the login shell."""
    path = subject.surroundings.get("PATH", os.defpath)
    installed_shells = [name for name in SHELLS if shutil.which(name, path=path)]
    login = subject.surroundings.get("SHELL", "").rpartition("/")[2]
    summary = " ".join(installed_shells) + (f"; yours is {login}" if login else "")
    if not login or login in SHELLS or login in _SH_COMPATIBLE:
        return CheckResult("shells", summary)
    hint = "start it with 'forge shell' in the environment of the workspace, or use 'forge env'"
    problem = Problem(f"no setup script for shell '{login}'", hint=hint)
    return CheckResult("shells", summary, warnings=(problem,))


def _rejected_by_cmake(
    subject: CheckContext, package: Package, version: tuple[int, ...]
) -> Iterator[Problem]:
    """Yield a problem if a CMake of this version rejects the package."""
    text = subject.text(package, "CMakeLists.txt")
    call = next((call for call in calls(text) if call.command == "cmake_minimum_required"), None)
    if call is None or call.words[:1] != ("VERSION",) or not call.words[1:]:
        return
    least = call.words[1].partition("...")[0]
    if not _VERSION.fullmatch(least):
        return
    place = Location(package.path / "CMakeLists.txt", call.line)
    shown = ".".join(map(str, version))
    if _numbers(least) > version:
        hint = f"install a newer one, for example with `{install_beside_forge(f'cmake>={least}')}`"
        yield Problem(f"'{package.name}' requires CMake {least}, but CMake {shown} is installed", place, hint)


def _version(subject: CheckContext, words: Sequence[str]) -> str:
    """Return the version that a program reports, '' if it does not run."""
    match = _VERSION.search(_run(subject, (*words, "--version"))[0])
    return match[0] if match else ""


def _run(subject: CheckContext, argv: Sequence[str], text: str = "") -> tuple[str, str]:
    """Return the output of a program, and the reason of its failure in one line, '' if it succeeded."""
    try:
        result = subprocess.run(
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
        return "", reason_of(error)
    except subprocess.TimeoutExpired:
        return "", "timeout after a minute"
    if not result.returncode:
        return result.stdout, ""
    lines = [line for line in result.stderr.splitlines() if "error" in line] or result.stderr.splitlines()
    return "", lines[0].strip() if lines else f"exit code {result.returncode}"


def _numbers(version: str) -> tuple[int, ...]:
    return tuple(map(int, re.findall(r"\d+", version)))
