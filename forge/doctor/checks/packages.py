"""Checks the packages of a workspace: undeclared dependencies, and names that hide others."""

from __future__ import annotations

import sys
from collections import defaultdict
from functools import partial
from pathlib import PurePath
from typing import TYPE_CHECKING

from forge.base.errors import GroupedProblems, Location, Problem
from forge.doctor.checks.declarations import (
    Findings,
    KnownPackages,
    undeclared_in_cmake,
    undeclared_in_python,
    unused,
)
from forge.doctor.checks.model import CheckResult
from forge.environment.prefixes import installed_packages
from forge.environment.underlays import overridden
from forge.workspace.cmake_text import calls
from forge.workspace.discovery import discover_embedded
from forge.workspace.resolve import ALL_KINDS, INTERFACE_GROUP, provided_names

if TYPE_CHECKING:
    import re
    from collections.abc import Iterator

    from forge.doctor.checks.model import CheckContext
    from forge.workspace.model import Package

_CODE = (".c", ".cc", ".cpp", ".cu", ".cxx", ".h", ".hh", ".hpp", ".ipp", ".tpp", ".py", ".pyi", ".sh")
_BUILDING = (".txt", ".cmake", ".in", ".cfg", ".toml")
_DATA = (".xml", ".launch", ".yaml", ".yml", ".json", ".urdf", ".xacro", ".sdf", ".rviz", ".md", ".rst")
_SEARCHED = (*_CODE, *_BUILDING, *_DATA, ".msg", ".srv", ".action", ".idl")
"""Files in which a dependency may be mentioned."""

_TEST_FOLDERS = frozenset({"test", "tests"})


def declarations(subject: CheckContext) -> CheckResult:
    """Compare used packages with declared dependencies."""
    assert subject.resolution is not None
    resolution = subject.resolution
    near = frozenset(name for name, package in resolution.packages.items() if not package.embedded)
    installed = {
        package.name: package.needs
        for root in subject.underlays.chain
        for package in installed_packages(root)
    }
    brought = frozenset(resolution.packages) | frozenset(installed) | provided_names(discover_embedded())
    modules = {name: name for name in brought}
    for name in near:
        modules.update(dict.fromkeys(modules_of(subject, resolution.packages[name]), name))
    needs = {**installed, **resolution.needs}
    for name in near:
        outside = frozenset(resolution.packages[name].manifest.names(ALL_KINDS)) & installed.keys()
        needs[name] |= outside
    around = KnownPackages(brought, near, modules, needs)
    found: list[Findings] = []
    notes: list[Problem] = []
    for package in subject.packages.values():
        if not package.ros:
            continue  # its dependencies are derived from these files
        text = subject.text(package, "CMakeLists.txt")
        if package.build_type in {"ament_cmake", "cmake"} and text:
            found.append(undeclared_in_cmake(package, text, package.path / "CMakeLists.txt", around))
        if package.build_type == "ament_python":
            files = ((package.path / name, text) for name, text in subject.texts(package, ".py"))
            found.append(undeclared_in_python(package, files, around))
        notes += unused(package, around.known, partial(_mentions, subject, package))
    errors = tuple(problem for grades in found for problem in grades.errors)
    warnings = tuple(problem for grades in found for problem in grades.warnings)
    implied = tuple(problem for grades in found for problem in grades.notes)
    forgotten = len(errors) + len(warnings)
    parts = (
        f"{forgotten} used but not declared" if forgotten else "",
        f"{len(implied)} used that only other dependencies declare (--all)" if implied else "",
    )
    summary = ", ".join(filter(None, parts)) or "packages declare what they use"
    return CheckResult("declared", summary, errors, warnings, (*implied, *notes))


def shadows(subject: CheckContext) -> CheckResult:
    """Find packages and Python modules that hide others with the same name."""
    warnings = [*overridden(subject.packages, subject.layout.install, subject.variables)]
    warnings += _clashing_modules(subject)
    notes = _hidden_packages(subject)
    summary = f"{len(warnings)} hide others" if warnings else "no package hides another"
    return CheckResult("shadows", summary, warnings=tuple(warnings), notes=tuple(notes))


def modules_of(subject: CheckContext, package: Package) -> frozenset[str]:
    """Return the top-level Python modules that a package installs."""
    found = {package.name} if INTERFACE_GROUP in package.manifest.groups else set()
    if package.build_type in {"ament_python", "python"}:
        for name, _ in subject.files.get(package.name, ()):
            parts = PurePath(name).parts
            parts = parts[1:] if parts[0] == "src" else parts
            if len(parts) == 2 and parts[1] == "__init__.py" and parts[0] not in _TEST_FOLDERS:
                found.add(parts[0])
    elif package.build_type == "ament_cmake":
        for call in calls(subject.text(package, "CMakeLists.txt")):
            if call.command == "ament_python_install_package" and call.words:
                found.add(call.words[0].replace("${PROJECT_NAME}", package.name))
    return frozenset(found)


def _mentions(subject: CheckContext, package: Package, pattern: re.Pattern[str]) -> Iterator[str]:
    for name, text in subject.texts(package, *_SEARCHED):
        if name != "package.xml":
            yield from pattern.findall(text)


def _clashing_modules(subject: CheckContext) -> Iterator[Problem]:
    owners: dict[str, list[Package]] = defaultdict(list)
    for package in subject.packages.values():
        for module in modules_of(subject, package):
            owners[module].append(package)
    for module, packages in sorted(owners.items()):
        first, *others = sorted(packages, key=lambda package: package.name)
        if others:
            names = " and ".join(f"'{package.name}'" for package in (first, *others))
            hint = "rename all but one of them: imports use the one that was sourced last"
            yield Problem(f"the Python module '{module}' is in {names}", Location(others[0].path), hint)
        if module in sys.stdlib_module_names:
            hint = "rename its folder, also in setup.py"
            yield Problem(
                f"the module '{module}' of '{first.name}' hides a module of Python's standard library",
                Location(first.path),
                hint,
            )


def _hidden_packages(subject: CheckContext) -> Iterator[Problem]:
    places: dict[str, list[str]] = defaultdict(list)
    for root in reversed(subject.underlays.chain):
        for package in installed_packages(root):
            places[package.name].append(str(root))
    for name, roots in sorted(places.items()):
        if name in subject.packages:
            kind = GroupedProblems(f"{{}} of the workspace override those in '{roots[0]}'", name)
            yield Problem(f"'{name}' of the workspace overrides the one in '{roots[0]}'", group=kind)
        elif len(roots) > 1:
            kind = GroupedProblems(f"{{}} in '{roots[0]}' override those in '{roots[1]}'", name)
            yield Problem(f"'{name}' in '{roots[0]}' overrides the one in '{roots[1]}'", group=kind)
