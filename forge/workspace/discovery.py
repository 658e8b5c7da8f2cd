"""Finds packages: walks below the base paths and identifies each folder."""

from __future__ import annotations

import glob
import os
import stat
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path

from forge.base import distributions
from forge.base.distributions import EMBEDDED, OLDEST, VARIABLE
from forge.base.errors import Location, Problem, reason_of
from forge.base.files import not_regular_reason
from forge.base.names import project_name
from forge.workspace.identification import MARKER_FILES, identify, read_package
from forge.workspace.identity import NOT_A_PACKAGE
from forge.workspace.model import PYTHON_TYPES, BrokenPackage, Dependency, DependencyKind, Package, Workspace
from forge.workspace.overrides import NO_OVERRIDES, Overrides
from forge.workspace.source_names import folders_to_search, is_environment, is_source_folder

_GROUP_KINDS = frozenset({DependencyKind.BUILD, DependencyKind.BUILD_EXPORT, DependencyKind.EXEC})
_READ_BY_TOOLS = (
    *("CMakeLists.txt", "setup.cfg", "pyproject.toml", "MANIFEST.in", ".cmake", ".in", ".py"),
    *(".c", ".cc", ".cpp", ".cxx", ".h", ".hh", ".hpp", ".hxx", ".S", ".s"),
    *(".msg", ".srv", ".action", ".idl"),
)
ROS_DEFAULTS = {"ROS_VERSION": "2", "ROS_PYTHON_VERSION": "3", VARIABLE: OLDEST}
"""Defaults of variables that manifests use in conditions, for machines without ROS."""


def discover(
    root: Path,
    base_paths: Iterable[str],
    variables: Mapping[str, str],
    *,
    paths: Iterable[str] = (),
    overrides: Overrides = NO_OVERRIDES,
) -> Workspace:
    """Return the packages below the base paths and the packages in `paths`.

    Relative paths are relative to `root`; wildcards match folders. Package paths are spelled like their base
    path, those from `paths` are absolute. Conditions use `variables`, completed with ROS_DEFAULTS. A folder
    that does not exist contains no packages.
    """
    variables = {**ROS_DEFAULTS, "DISABLE_GROUPS_WORKAROUND": "1", **variables}
    has_overrides = bool(overrides.by_path or overrides.build_types)
    visited: set[tuple[int, int]] = set()  # with links, too, each folder is visited only once
    packages: dict[str, Package] = {}
    duplicates: list[Package] = []
    broken: list[BrokenPackage] = []
    notes: list[Problem] = []
    tops = [(os.path.join(root, path), False) for path in _expanded(root, paths)]
    tops += [(base, True) for base in _expanded(root, base_paths)]
    for base, below in tops:
        top, denied = os.path.join(root, base), list[PermissionError]()
        for folder, entries in folders_to_search(top, visited, denied):
            identity = NOT_A_PACKAGE
            if has_overrides or not MARKER_FILES.isdisjoint(entries):
                path = Path(base, folder[len(top) :].lstrip("/"))
                identity = identify(root, path, entries.keys(), variables, overrides)
                if identity.problems:
                    broken.append(BrokenPackage(identity.name, path, identity.problems))
                notes += identity.notes
                package = identity.package
                if package is not None and packages.setdefault(package.name, package) is not package:
                    duplicates.append(package)
            if not (below and identity.descend):
                entries.clear()
        for error in denied:
            message = f"ignoring unreadable folder: {reason_of(error)}"
            hint = "grant read permission, or ignore it with an empty file COLCON_IGNORE in its parent folder"
            place = Location(Path(base, error.filename[len(top) :].lstrip("/")))
            notes.append(Problem(message, place, hint))
    all_packages = _with_all_dependencies([*packages.values(), *duplicates])
    count = len(packages)
    for same in projects(all_packages[:count]).values():
        plain = [package for package in same if not package.ros]
        for other in plain[1:]:
            message = f"'{plain[0].name}' and '{other.name}' are the same Python project (PEP 503)"
            hint = f"rename one of them; the other is in '{plain[0].path}'"
            notes.append(Problem(message, Location(other.path), hint))
    notes += (warning for package in all_packages for warning in package.manifest.warnings)
    for number, each in enumerate(broken):
        resolved = (root / each.path).resolve().name
        guessed_name = str(each.path) if resolved in packages else resolved
        broken[number] = replace(each, name=each.name or guessed_name)
    return Workspace(
        root,
        {package.name: package for package in all_packages[:count]},
        tuple(broken),
        tuple(all_packages[count:]),
        tuple(notes),
    )


@cache
def discover_embedded(rosdistro: str = OLDEST) -> Mapping[str, Package]:
    """Return the packages that forge embeds for a ROS distribution; an invalid one is a bug in forge."""
    by_name = {}
    for folder in sorted(path.parent for path in EMBEDDED.glob("*/package.xml")):
        since = folder / distributions.SINCE
        if since.is_dir() and not distributions.embedded_definitions(folder, rosdistro):
            continue
        package = read_package(folder, folder, {**ROS_DEFAULTS, VARIABLE: rosdistro})
        # A package may have services only in newer distributions.
        definitions = distributions.definition_folders(folder, rosdistro)
        has_services = package.has_services or any((path / "srv").is_dir() for path in definitions)
        by_name[package.name] = replace(package, embedded=True, has_services=has_services)
    return by_name


def special_files(root: Path, folder: Path) -> Iterator[Problem]:
    """Yield the named pipes and devices among a package's sources, which build tools would read endlessly."""
    top = os.path.join(root, folder)
    waiting = [top]
    while waiting:
        at = waiting.pop()
        try:
            with os.scandir(at) as iterator:
                entries = sorted(iterator, key=lambda entry: entry.name)
        except OSError:
            continue  # this is reported when the sources are scanned
        names = {entry.name for entry in entries}
        if at != top and is_environment(names.__contains__):
            continue
        for entry in entries:
            if entry.is_dir(follow_symlinks=False):
                hidden = entry.name.startswith(".") or not is_source_folder(entry.name, names.__contains__)
                waiting += [] if hidden else [entry.path]
            elif entry.name.endswith(_READ_BY_TOOLS) and not entry.is_file(follow_symlinks=False):
                try:
                    status = entry.stat()
                except OSError:
                    continue
                if not stat.S_ISDIR(status.st_mode) and (reason := not_regular_reason(entry.path, status)):
                    place = folder / os.path.relpath(entry.path, root / folder)
                    yield Problem(f"cannot read the file: {reason}", Location(place))


def _expanded(root: Path, paths: Iterable[str]) -> Iterator[str]:
    for path in paths:
        if "*" in path:
            matches = sorted(glob.glob(path, root_dir=root))
            yield from (match for match in matches if os.path.isdir(os.path.join(root, match)))
        else:
            yield path


def projects(packages: Iterable[Package]) -> dict[str, list[Package]]:
    """Return the Python packages by the names that PEP 503 compares."""
    by_name: dict[str, list[Package]] = {}
    for package in packages:
        if package.build_type in PYTHON_TYPES:
            by_name.setdefault(project_name(package.name), []).append(package)
    return by_name


def _with_all_dependencies(packages: Sequence[Package]) -> list[Package]:
    """Return the packages with groups expanded (REP 149) and Python projects spelled as in the workspace."""
    python_projects, names = projects(packages), {package.name for package in packages}
    members: dict[str, list[str]] = {}
    for package in packages:
        for group in package.manifest.groups:
            members.setdefault(group, []).append(package.name)
    expanded = []
    for package in packages:
        manifest = package.manifest
        needs: list[Dependency] = []
        for need in manifest.dependencies:
            same = () if need.name in names else python_projects.get(project_name(need.name), ())
            spelled = dict.fromkeys(other.name for other in same if not (package.ros and other.ros))
            needs += (replace(need, name=name) for name in spelled) if spelled else (need,)
        wanted = {member for group in manifest.group_dependencies for member in members.get(group, ())}
        needs += (Dependency(member, _GROUP_KINDS) for member in sorted(wanted - {package.name}))
        if tuple(needs) != manifest.dependencies:
            package = replace(package, manifest=replace(manifest, dependencies=tuple(needs)))
        expanded.append(package)
    return expanded
