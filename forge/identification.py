"""What a folder is: no package, one with a package.xml, or one that only CMake or Python knows.

The first step that yields both a type and a name decides, in colcon's order: what the user says in
colcon.pkg and *.meta files, package.xml, CMakeLists.txt, setup.py, and, ours, pyproject.toml.
"""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from forge.errors import Place, Problem, WorkspaceError
from forge.files import read_file
from forge.identity import HIDDEN, NOTHING, Folder, Identity
from forge.manifest import parse_manifest
from forge.model import Package
from forge.names import is_word
from forge.overrides import COLCON_PKG, read_colcon_pkg, with_overrides

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping

    from forge.overrides import Overrides

IGNORE_MARK = "COLCON_IGNORE"
ROS_MARKS = ("AMENT_IGNORE", "CATKIN_IGNORE")
FOREIGN_INSTALLS = ("_order_isolated_packages.py", "_setup_util.py")
PLAIN = frozenset({"CMakeLists.txt", "setup.py", "pyproject.toml"})
TELLING = (
    frozenset({IGNORE_MARK, *ROS_MARKS, *FOREIGN_INSTALLS, COLCON_PKG, "package.xml", "manifest.xml"}) | PLAIN
)
"""A folder with none of these names is no package, unless a *.meta file says so."""


def identify(
    root: Path, path: Path, entries: Collection[str], variables: Mapping[str, str], overrides: Overrides
) -> Identity:
    """Return what the folder `path` is, which lies below `root` and has `entries`.

    Conditions of a package.xml see `variables`. What is wrong is told, never raised.
    """
    if IGNORE_MARK in entries or not set(FOREIGN_INSTALLS).isdisjoint(entries):
        return HIDDEN
    folder = Folder(path, root / path, entries)
    try:
        own = _colcon_pkg(folder)
        said = overrides.placed(folder.place)
        conflicts = _claim(folder, own, said, overrides)
        identity = _identify(folder, variables)
        package = identity.package
        if package is not None:
            _check_name(package)
            sources = (own, overrides.named(package.name), said)
            identity = replace(identity, package=with_overrides(package, sources))
    except WorkspaceError as error:
        return Identity(problems=_relative(error.problems, folder))
    except OSError as error:
        file = os.path.relpath(error.filename, folder.place) if error.filename else "package.xml"
        what = "the manifest" if file == "package.xml" else "the file"
        return Identity(problems=(Problem(f"cannot read {what}: {error.strerror}", Place(path / file)),))
    return replace(identity, notes=(*conflicts, *identity.notes))


def read_package(root: Path, folder: Path, variables: Mapping[str, str]) -> Package:
    """Return the package whose package.xml is in `folder`; raises WorkspaceError."""
    path = folder / "package.xml"
    try:
        content = read_file(root / path)
    except OSError as error:
        raise WorkspaceError(Problem(f"cannot read the manifest: {error.strerror}", Place(path))) from None
    manifest = parse_manifest(content, path, variables)
    actions = root / folder / "action"
    has_actions = actions.is_dir() and next(actions.glob("*.action"), None) is not None
    return Package(folder, manifest, has_actions=has_actions)


def _colcon_pkg(folder: Folder) -> dict[str, Any]:
    there = COLCON_PKG in folder.entries and (folder.place / COLCON_PKG).exists()
    return read_colcon_pkg(folder.place) if there else {}


def _check_name(package: Package) -> None:
    """Raise WorkspaceError for a name that folders, scripts or CMake would take for something else."""
    if not is_word(package.name):
        message = f"'{package.name}' cannot be the name of a package"
        hint = (
            f"write 'name: NAME' into '{package.path / COLCON_PKG}', with letters, digits, '_', '-' and '.'"
        )
        raise WorkspaceError(Problem(message, Place(package.manifest.path), hint))


def _claim(
    folder: Folder, own: Mapping[str, Any], placed: Mapping[str, Any], overrides: Overrides
) -> tuple[Problem, ...]:
    """Note the type and the name that users give a folder; the first to say so counts, others are told."""
    conflicts = []
    for said in (own, placed):
        for key in ("type", "name"):
            value, known = said.get(key), getattr(folder, key)
            if value and known is None:
                setattr(folder, key, str(value))
            elif value and known != value:
                message = f"the {key} '{known}' in {COLCON_PKG} wins over '{value}' in a *.meta file"
                conflicts.append(Problem(message, Place(folder.path)))
    if folder.name and folder.type is None:
        said_type = overrides.named(folder.name).get("type")
        folder.type = str(said_type) if said_type else None
    return tuple(conflicts)


def _identify(folder: Folder, variables: Mapping[str, str]) -> Identity:
    claimed = folder.type or folder.name
    identity = _as_ros(folder, variables)
    if identity is None and not PLAIN.isdisjoint(folder.entries):
        # Most workspaces have no such folder, and spare reading how Python is read.
        from forge.plain_packages import identify_plain  # noqa: PLC0415

        identity = identify_plain(folder)
    if identity is not None:
        return identity
    return _incomplete(folder, "nothing else in it tells the rest") if claimed else NOTHING


def _as_ros(folder: Folder, variables: Mapping[str, str]) -> Identity | None:
    """Return what package.xml and the marks of ROS tools say, or None when they say nothing.

    They do not matter for a folder that the user gave a type without them.
    """
    if folder.type not in {None, "ros"} and not str(folder.type).startswith("ros."):
        return None
    whole = folder.type in {None, "ros"}
    hidden = whole and any((folder.place / mark).exists() for mark in ROS_MARKS if mark in folder.entries)
    if not hidden and "package.xml" in folder.entries:
        return Identity(_ros_package(folder, variables))
    if hidden or "manifest.xml" in folder.entries:
        # The latter is a package of rosbuild, whose CMakeLists.txt means something else.
        return HIDDEN
    return None if whole else _incomplete(folder, "there is no package.xml")


def _ros_package(folder: Folder, variables: Mapping[str, str]) -> Package:
    """Return the package that package.xml describes, under the name and type that the user prefers."""
    package = read_package(folder.place, Path(), variables)
    manifest = replace(package.manifest, path=folder.path / "package.xml")
    if folder.name:
        manifest = replace(manifest, name=folder.name)
    if folder.type and folder.type != "ros":
        manifest = replace(manifest, build_type=folder.type.removeprefix("ros."))
    return replace(package, path=folder.path, manifest=manifest)


def _incomplete(folder: Folder, why: str) -> Identity:
    said = f"type '{folder.type}'" if folder.type else f"name '{folder.name}'"
    note = Problem(f"the folder has the {said} but is no package: {why}", Place(folder.path))
    return Identity(descend=True, notes=(note,))


def _relative(problems: tuple[Problem, ...], folder: Folder) -> tuple[Problem, ...]:
    """Return the problems with their files spelled as the folder is."""
    return tuple(
        replace(problem, place=replace(problem.place, path=folder.path / Path(problem.place.path).name))
        if problem.place
        else problem
        for problem in problems
    )
