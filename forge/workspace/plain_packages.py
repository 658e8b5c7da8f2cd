"""Identifies folders without package.xml that CMake or a build type of forge's plugins can build."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from forge.base.errors import Location, Problem
from forge.base.extensions import BUILD_TYPES, PACKAGE_FILES, absent
from forge.base.files import not_regular_reason, text_or_nothing
from forge.workspace.cmake_text import cmake_dependencies, cmake_files, project_name
from forge.workspace.identity import Folder, Identity, identify_with
from forge.workspace.model import Dependency, DependencyKind, Manifest, Package
from forge.workspace.overrides import COLCON_PKG
from forge.workspace.python_metadata import read_setup_cfg


def identify_plain(folder: Folder) -> Identity | None:
    """Return the identity by CMakeLists.txt or files of plugins; raises WorkspaceError or OSError."""
    if identity := _ambiguous(folder) or cmake_package(folder):
        return identity
    notes = []
    for file, build_type in PACKAGE_FILES.items():
        if folder.may_be(build_type) and folder.has(file):
            if problem := absent(BUILD_TYPES, build_type, "build type"):
                notes.append(replace(problem, location=Location(folder.display_path / file)))
            elif identity := identify_with(build_type, folder):
                return identity
    # Files that are not regular are reported.
    for name in sorted({"CMakeLists.txt", "setup.py", "pyproject.toml"}.intersection(folder.entries)):
        try:
            reason = not_regular_reason(folder.absolute / name, (folder.absolute / name).stat())
        except OSError:
            continue  # a dangling link, as created by catkin above its packages
        if reason:
            notes.append(Problem(f"ignored: {reason}", Location(folder.display_path / name)))
    return Identity(descend=True, notes=tuple(notes)) if notes else None


def _ambiguous(folder: Folder) -> Identity | None:
    if folder.type is not None or not folder.has("CMakeLists.txt", "setup.py", "setup.cfg"):
        return None
    text = folder.text("setup.py")
    # For these files, colcon reads only setup.cfg.
    reads_setup_cfg = "setup()" in text or "setup(cmdclass=cmdclass)" in text
    if not (reads_setup_cfg and read_setup_cfg(folder.text("setup.cfg")).name):
        return None
    message = "ignored: ambiguous package with a CMakeLists.txt and a setup.cfg"
    hint = f"set the type in '{folder.display_path / COLCON_PKG}': 'type: cmake' or 'type: python'"
    return Identity(notes=(Problem(message, Location(folder.display_path), hint),))


def cmake_package(folder: Folder) -> Identity | None:
    if not (folder.may_be("cmake") and folder.has("CMakeLists.txt")):
        return None
    text = folder.text("CMakeLists.txt")
    path = folder.display_path / "CMakeLists.txt"
    name = project_name(text)
    if name == "Project" and "catkin_workspace()" in text.splitlines():
        message = "ignored: this is the top-level CMakeLists.txt that catkin_make creates"
        return Identity(descend=True, notes=(Problem(message, Location(path)),))
    notes = (computed_name(folder, path),) if name == "" and not folder.name else ()
    name = name or folder.absolute.resolve().name
    # As in colcon, dependencies are not read if the user assigned both name and type.
    assigned = folder.name and folder.type
    texts = () if assigned else map(text_or_nothing, cmake_files(folder.absolute))
    wanted = cmake_dependencies(texts) - {name}
    kinds = frozenset({DependencyKind.BUILD, DependencyKind.EXEC})
    dependencies = tuple(Dependency(need, kinds) for need in sorted(wanted))
    return Identity(plain_package(folder, folder.name or name, "cmake", path, dependencies), notes=notes)


def plain_package(
    folder: Folder, name: str, build_type: str, path: Path, dependencies: tuple[Dependency, ...] = ()
) -> Package:
    """Return a package without package.xml; `path` is the file that describes it."""
    own = tuple(dependency for dependency in dependencies if dependency.name != name)
    return Package(folder.display_path, Manifest(name, "", "", build_type, own, path), ros=False)


def computed_name(folder: Folder, path: Path) -> Problem:
    name = folder.absolute.resolve().name
    return Problem(
        f"the project name is not a literal; using the name of the folder, '{name}'",
        Location(path),
        f"to use another name, add 'name: NAME' to '{folder.display_path / COLCON_PKG}'",
    )
