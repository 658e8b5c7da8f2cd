"""Identifies folders without package.xml that CMake or a Python backend can build."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from forge.base.errors import Location, Problem
from forge.base.extensions import BUILD_TYPES, PACKAGE_FILES, absent
from forge.base.files import not_regular_reason, text_or_nothing
from forge.base.formats import read_toml
from forge.workspace.cmake_text import cmake_dependencies, cmake_files, project_name
from forge.workspace.identity import Folder, Identity, identify_with
from forge.workspace.model import Dependency, DependencyKind, Manifest, Package
from forge.workspace.overrides import COLCON_PKG
from forge.workspace.python_metadata import PythonMetadata, read_pyproject, read_setup_cfg, read_setup_py


def identify_plain(folder: Folder) -> Identity | None:
    """Return the identity according to CMake or Python files, or to those of forge's plugins, or None.

    Raises WorkspaceError for a malformed pyproject.toml, OSError for unreadable files.
    """
    identity = _ambiguous(folder) or cmake_package(folder) or python_package(folder)
    if identity is not None:
        return identity
    for file, build_type in PACKAGE_FILES.items():
        if folder.may_be(build_type) and folder.has(file):
            if problem := absent(BUILD_TYPES, build_type, "build type"):
                note = replace(problem, location=Location(folder.display_path / file))
                return Identity(notes=(note,), descend=True)
            return identify_with(build_type, folder)
    # Files that are not regular are reported.
    notes = []
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
    if not folder.may_be("cmake") or not folder.has("CMakeLists.txt"):
        return None
    text = folder.text("CMakeLists.txt")
    path = folder.display_path / "CMakeLists.txt"
    name = project_name(text)
    if name == "Project" and "catkin_workspace()" in text.splitlines():
        message = "ignored: this is the top-level CMakeLists.txt that catkin_make creates"
        return Identity(descend=True, notes=(Problem(message, Location(path)),))
    notes = (_no_literal(folder, path),) if name == "" and not folder.name else ()
    name = name or folder.absolute.resolve().name
    # As in colcon, dependencies are not read if the user assigned both name and type.
    assigned = folder.name and folder.type
    texts = () if assigned else map(text_or_nothing, cmake_files(folder.absolute))
    wanted = cmake_dependencies(texts) - {name}
    kinds = frozenset({DependencyKind.BUILD, DependencyKind.EXEC})
    dependencies = tuple(Dependency(need, kinds) for need in sorted(wanted))
    return Identity(plain_package(folder, folder.name or name, "cmake", path, dependencies), notes=notes)


def python_package(folder: Folder) -> Identity | None:
    """Read setup.py, completed by setup.cfg and pyproject.toml like setuptools, else pyproject.toml."""
    if not folder.may_be("python"):
        return None

    def setup_cfg() -> PythonMetadata:
        return read_setup_cfg(folder.text("setup.cfg")) if folder.has("setup.cfg") else PythonMetadata()

    def pyproject() -> PythonMetadata | None:
        path = folder.display_path / "pyproject.toml"
        has_file = folder.has("pyproject.toml")
        return read_pyproject(read_toml(folder.content("pyproject.toml"), path)) if has_file else None

    if folder.has("setup.py"):
        path = folder.display_path / "setup.py"
        try:
            facts = read_setup_py(folder.text("setup.py"))
        except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
            line = getattr(error, "lineno", None)
            reason = str(error.args[0]) if error.args else "not valid Python"
            if isinstance(error, RecursionError | MemoryError):
                reason = "too deeply nested"
            problem = Problem(f"cannot parse setup.py: {reason}", Location(path, line))
            return Identity(notes=(problem,), descend=True)
        if facts is not None:
            facts = facts.over(setup_cfg()).over(pyproject() or PythonMetadata())
            return _python(folder, facts, path)
    if folder.has("pyproject.toml"):
        facts, below = pyproject(), setup_cfg()
        if facts or below.name is not None:
            facts = (facts or PythonMetadata()).over(below)
            return _python(folder, facts, folder.display_path / "pyproject.toml")
    return None


def _python(folder: Folder, facts: PythonMetadata, path: Path) -> Identity:
    if folder.name and facts.name and folder.name != facts.name:
        message = f"ignored: the assigned name '{folder.name}' differs from the Python name '{facts.name}'"
        hint = "remove the name from colcon.pkg or the *.meta file"
        return Identity(problems=(Problem(message, Location(path), hint),), name=folder.name)
    notes = () if facts.name or folder.name else (_no_literal(folder, path),)
    name = folder.name or facts.name or folder.absolute.resolve().name
    package = plain_package(folder, name, "python", path, facts.dependencies)
    manifest = replace(package.manifest, version=facts.version, maintainers=facts.maintainers)
    return Identity(replace(package, manifest=manifest), notes=notes)


def plain_package(
    folder: Folder, name: str, build_type: str, path: Path, dependencies: tuple[Dependency, ...] = ()
) -> Package:
    """Return a package without package.xml; `path` is the file that describes it."""
    own = tuple(dependency for dependency in dependencies if dependency.name != name)
    return Package(folder.display_path, Manifest(name, "", "", build_type, own, path), ros=False)


def _no_literal(folder: Folder, path: Path) -> Problem:
    name = folder.absolute.resolve().name
    return Problem(
        f"the project name is not a literal; using the name of the folder, '{name}'",
        Location(path),
        f"to use another name, add 'name: NAME' to '{folder.display_path / COLCON_PKG}'",
    )
