"""Identifies folders: a package with package.xml, a plain CMake or Python package, or no package.

The first source of both a type and a name wins, in colcon's order: colcon.pkg and *.meta files, package.xml,
CMakeLists.txt, setup.py, and in addition pyproject.toml.
"""

from __future__ import annotations

import os
import re
from collections.abc import Collection, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from forge.base.errors import ForeignManifestError, Location, Problem, WorkspaceError
from forge.base.extensions import PACKAGE_FILES
from forge.base.files import read_file, text_or_nothing
from forge.base.formats import read_yaml
from forge.base.layout import IGNORE_MARK
from forge.base.names import did_you_mean, is_safe_name
from forge.workspace.identity import IGNORED, NOT_A_PACKAGE, Folder, Identity
from forge.workspace.manifest import parse_manifest
from forge.workspace.model import Package
from forge.workspace.overrides import COLCON_PKG, NO_OVERRIDES, Overrides, with_overrides

_NAME = re.compile(r"<name>\s*([\w.-]+)\s*</name>")
_COMMENT = re.compile(r"<!--.*?-->", re.DOTALL)
_ROS_IGNORE_FILES = ("AMENT_IGNORE", "CATKIN_IGNORE")
MARKS = (IGNORE_MARK, *_ROS_IGNORE_FILES)
"""Files that hide a folder and everything below it."""
FOREIGN_INSTALLS = ("_order_isolated_packages.py", "_setup_util.py")
OWN_TYPES = frozenset({"cmake", "ros", *PACKAGE_FILES.values()})
"""The supported types in colcon.pkg and *.meta files, besides those that begin with 'ros.'."""
PLAIN = frozenset({"CMakeLists.txt", *PACKAGE_FILES})
MARKER_FILES = frozenset({*MARKS, *FOREIGN_INSTALLS, COLCON_PKG, "package.xml", "manifest.xml"}) | PLAIN
"""A folder without any of these names is not a package, unless a *.meta file declares it."""


def identify(
    root: Path,
    path: Path,
    entries: Collection[str],
    variables: Mapping[str, str],
    overrides: Overrides = NO_OVERRIDES,
) -> Identity:
    """Return the identity of the folder `path` below `root`; problems are returned, never raised."""
    if IGNORE_MARK in entries or not set(FOREIGN_INSTALLS).isdisjoint(entries):
        return IGNORED
    folder = Folder(path, root / path, entries)
    try:
        own: dict[str, Any] = {}
        if COLCON_PKG in entries and (folder.absolute / COLCON_PKG).exists():
            own = read_yaml(folder.content(COLCON_PKG), path / COLCON_PKG)
        placed = overrides.placed(folder.absolute)
        conflicts = _assign_type_and_name(folder, own, placed, overrides)
        identity = _identify(folder, variables, overrides.build_types)
        package = identity.package
        if package is not None:
            if not is_safe_name(package.name):
                message = f"invalid package name '{package.name}'"
                signs = "letters, digits, '_', '-' and '.'"
                hint = f"write 'name: NAME' into '{package.path / COLCON_PKG}', with {signs}"
                raise WorkspaceError(Problem(message, Location(package.manifest.path), hint))
            sources = (own, overrides.named(package.name), placed)
            identity = replace(identity, package=with_overrides(package, sources))
    except (WorkspaceError, OSError) as error:
        text = text_or_nothing(folder.absolute / "package.xml") if "package.xml" in entries else ""
        named = _NAME.search(_COMMENT.sub("", text))
        name = folder.name or (named[1] if named else "")
        if isinstance(error, WorkspaceError):
            return Identity(problems=error.problems, name=name)
        file = os.path.relpath(error.filename, folder.absolute) if error.filename else "package.xml"
        what = "the manifest" if file == "package.xml" else "the file"
        problem = Problem(f"cannot read {what}: {error.strerror}", Location(path / file))
        return Identity(problems=(problem,), name=name)
    return replace(identity, notes=(*conflicts, *identity.notes))


def read_package(folder: Path, displayed: Path, variables: Mapping[str, str]) -> Package:
    """Return the package in `folder` with paths below `displayed`; raises WorkspaceError or OSError."""
    manifest = parse_manifest(read_file(folder / "package.xml"), displayed / "package.xml", variables)
    has_actions, has_services = (
        (folder / kind).is_dir()
        and any(path.suffix in {f".{kind}", ".idl"} for path in (folder / kind).iterdir())
        for kind in ("action", "srv")
    )
    return Package(displayed, manifest, has_actions=has_actions, has_services=has_services)


def _assign_type_and_name(
    folder: Folder, own: Mapping[str, Any], placed: Mapping[str, Any], overrides: Overrides
) -> tuple[Problem, ...]:
    """Record the type and name that users assign; the first one wins, conflicts are returned."""
    conflicts = []
    for options in (own, placed):
        for key in ("type", "name"):
            value, assigned = options.get(key), getattr(folder, key)
            if value and assigned is None:
                setattr(folder, key, str(value))
            elif value and assigned != value:
                message = f"the {key} '{assigned}' in {COLCON_PKG} overrides '{value}' in a *.meta file"
                conflicts.append(Problem(message, Location(folder.display_path)))
    if folder.name and folder.type is None:
        assigned_type = overrides.named(folder.name).get("type")
        folder.type = str(assigned_type) if assigned_type else None
    return tuple(conflicts)


def _identify(folder: Folder, variables: Mapping[str, str], build_types: tuple[str, ...]) -> Identity:
    foreign: tuple[Problem, ...] = ()
    try:
        identity = _as_ros(folder, variables)
    except ForeignManifestError as error:
        identity, foreign = None, error.problems
    if identity is None and not PLAIN.isdisjoint(folder.entries):
        # Imported lazily, because few workspaces have plain packages.
        from forge.workspace.plain_packages import identify_plain

        identity = identify_plain(folder)
    identity = identity or _as_other(folder, build_types)
    if identity is None and (folder.type or folder.name):
        identity = _incomplete(folder, "its files do not provide the missing name or type")
    identity = identity or NOT_A_PACKAGE
    return replace(identity, notes=(*foreign, *identity.notes)) if foreign else identity


def _as_other(folder: Folder, build_types: tuple[str, ...]) -> Identity | None:
    """Return the package that the assigned build type, or the first fitting one in forge.toml, finds."""
    if folder.type is not None:
        assigned = folder.type not in OWN_TYPES and not folder.type.startswith("ros.")
        build_types = (folder.type,) if assigned else ()
    if not build_types:
        return None
    from forge.workspace.identity import identify_with, plugin

    if folder.type is not None and plugin(folder.type) is None:
        why = "no installed distribution provides this build type"
        return _incomplete(folder, why, did_you_mean(folder.type, OWN_TYPES))
    return next(filter(None, (identify_with(name, folder) for name in build_types)), None)


def _as_ros(folder: Folder, variables: Mapping[str, str]) -> Identity | None:
    """Return the identity by package.xml and marker files of ROS, unless the user assigned another type."""
    if folder.type not in {None, "ros"} and not str(folder.type).startswith("ros."):
        return None
    any_build_type = folder.type in {None, "ros"}
    marks = _ROS_IGNORE_FILES if any_build_type else ()
    hidden = any((folder.absolute / mark).exists() for mark in marks if mark in folder.entries)
    if not hidden and "package.xml" in folder.entries:
        package = read_package(folder.absolute, folder.display_path, variables)
        if folder.name or not any_build_type:
            name = folder.name or package.name
            build_type = package.build_type if any_build_type else str(folder.type).removeprefix("ros.")
            package = replace(package, manifest=replace(package.manifest, name=name, build_type=build_type))
        return Identity(package)
    if hidden or "manifest.xml" in folder.entries:
        # The latter is a rosbuild package, whose CMakeLists.txt is incompatible.
        return IGNORED
    return None if any_build_type else _incomplete(folder, "package.xml is missing")


def _incomplete(folder: Folder, why: str, hint: str | None = None) -> Identity:
    assigned = f"type '{folder.type}'" if folder.type else f"name '{folder.name}'"
    message = f"the folder was assigned the {assigned}, but is not a package: {why}"
    return Identity(descend=True, notes=(Problem(message, Location(folder.display_path), hint),))
