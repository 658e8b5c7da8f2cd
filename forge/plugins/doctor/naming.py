"""Checks that package names agree in manifests and build files, and that executables can be found."""

from __future__ import annotations

import configparser
from collections.abc import Iterator

from forge.base.errors import GroupedProblems, Location, Problem
from forge.base.text import counted
from forge.plugins.doctor.model import CheckContext, CheckResult
from forge.workspace.cmake_text import calls, project_name
from forge.workspace.model import Package
from forge.workspace.python_metadata import read_setup_py

_OPAQUE = frozenset({"include", "add_subdirectory", "macro", "function", "cmake_language"})
"""Commands that may call others."""


def names(subject: CheckContext) -> CheckResult:
    """Compare manifests, CMakeLists.txt, setup.py and setup.cfg."""
    packages = [package for package in subject.packages.values() if package.ros]
    errors = tuple(problem for package in packages for problem in _project(subject, package))
    package_problems = ((*_setup(subject, package), *_registration(subject, package)) for package in packages)
    warnings = tuple(problem for problems in package_problems for problem in problems)
    count = len(errors) + len(warnings)
    summary = counted(count, "problem") if count else "manifests and build files agree"
    return CheckResult("names", summary, errors, warnings)


def _project(subject: CheckContext, package: Package) -> Iterator[Problem]:
    if package.build_type != "ament_cmake":
        return
    name = project_name(subject.text(package, "CMakeLists.txt"))
    if name and name != package.name:
        message = f"the name is '{package.name}' in package.xml, but '{name}' in project()"
        yield Problem(message, Location(package.path / "CMakeLists.txt"), "use the same name in both")


def _registration(subject: CheckContext, package: Package) -> Iterator[Problem]:
    """Yield a problem if the package is not registered in the ament index, so that no tool finds it."""
    text = subject.text(package, "CMakeLists.txt")
    if package.build_type == "ament_cmake" and text and not _may_register_package(text):
        yield Problem(
            f"'{package.name}' does not call ament_package(): 'forge run' and other packages do not find it",
            Location(package.path / "CMakeLists.txt"),
            "add ament_package() at its end",
            GroupedProblems(
                "{} do not call ament_package(): 'forge run' and other packages do not find them",
                package.name,
                "add ament_package() at the end of each CMakeLists.txt",
            ),
        )


def _setup(subject: CheckContext, package: Package) -> Iterator[Problem]:
    if package.build_type != "ament_python":
        return
    text = subject.text(package, "setup.py")
    try:
        facts = read_setup_py(text)
    except (SyntaxError, ValueError, RecursionError):
        return  # a build reports this with its position
    if facts and facts.name and facts.name.replace("-", "_") != package.name.replace("-", "_"):
        message = f"the name is '{package.name}' in package.xml, but '{facts.name}' in setup.py"
        yield Problem(message, Location(package.path / "setup.py"), "use the same name in both")
    parser, scripts = configparser.RawConfigParser(), ""
    try:
        parser.read_string(subject.text(package, "setup.cfg"))
    except configparser.Error:
        return  # setuptools reports this
    for key in ("install_scripts", "install-scripts"):
        scripts = scripts or parser.get("install", key, fallback="")
    if "console_scripts" in text and not scripts.rstrip("/").endswith(f"lib/{package.name}"):
        what = "are installed in 'bin', where 'forge run' does not find them"
        yield Problem(
            f"executables of '{package.name}' {what}",
            Location(package.path / "setup.cfg"),
            f"add install_scripts=$base/lib/{package.name} to the section [install]",
            GroupedProblems(
                f"executables of {{}} {what}",
                package.name,
                "add install_scripts=$base/lib/NAME to the section [install] of each setup.cfg",
            ),
        )


def _may_register_package(text: str) -> bool:
    """Return whether ament_package() is called, or may be called by another file or a macro."""
    commands = {call.command for call in calls(text)} - {"find_package", "ament_python_install_package"}
    return not commands.isdisjoint(_OPAQUE) or any("package" in name for name in commands)
