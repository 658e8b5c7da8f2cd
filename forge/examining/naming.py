"""Names that must agree: of a package in its manifest and in its build files, and of where programs go."""

from __future__ import annotations

import configparser
from typing import TYPE_CHECKING

from forge.cmake_reading import project_name
from forge.errors import Place, Problem
from forge.examining.checkup import Checkup
from forge.python_reading import read_setup_py

if TYPE_CHECKING:
    from collections.abc import Iterator

    from forge.examining.subject import Subject
    from forge.model import Package


def names(subject: Subject) -> Checkup:
    """Compare what manifests, CMakeLists.txt, setup.py and setup.cfg say."""
    packages = [package for package in subject.packages.values() if package.ros]
    errors = tuple(problem for package in packages for problem in _project(subject, package))
    warnings = tuple(problem for package in packages for problem in _setup(subject, package))
    count = len(errors) + len(warnings)
    said = f"{count} that do not agree" if count else "manifests and build files agree"
    return Checkup("names", said, errors, warnings)


def _project(subject: Subject, package: Package) -> Iterator[Problem]:
    """Yield that project() has another name, which ament refuses."""
    if package.build_type != "ament_cmake":
        return
    name = project_name(subject.text(package, "CMakeLists.txt"))
    if name and name != package.name:
        message = f"package.xml names the package '{package.name}', and project() '{name}'"
        yield Problem(message, Place(package.path / "CMakeLists.txt"), "write the same name in both")


def _setup(subject: Subject, package: Package) -> Iterator[Problem]:
    if package.build_type != "ament_python":
        return
    text = subject.text(package, "setup.py")
    try:
        facts = read_setup_py(text)
    except (SyntaxError, ValueError, RecursionError):
        return  # a build says so, with the place
    if facts and facts.name and facts.name.replace("-", "_") != package.name.replace("-", "_"):
        message = f"package.xml names the package '{package.name}', and setup.py '{facts.name}'"
        yield Problem(message, Place(package.path / "setup.py"), "write the same name in both")
    if "console_scripts" in text and not _says_where(subject.text(package, "setup.cfg"), package.name):
        yield Problem(
            f"programs of '{package.name}' go to 'bin', where 'forge run' does not find them",
            Place(package.path / "setup.cfg"),
            f"write install_scripts=$base/lib/{package.name} below [install]",
        )


def _says_where(text: str, name: str) -> bool:
    """Tell if a setup.cfg sends programs to where `run` looks for them."""
    parser = configparser.RawConfigParser()
    try:
        parser.read_string(text)
    except configparser.Error:
        return True  # malformed: setuptools tells
    section = dict(parser["install"]) if parser.has_section("install") else {}
    folder = section.get("install_scripts") or section.get("install-scripts") or ""
    return folder.rstrip("/").endswith(f"lib/{name}")
