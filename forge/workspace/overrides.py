"""Package options in colcon.pkg, *.meta files and forge.toml; later ones extend lists and mappings."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from dataclasses import field, replace
from pathlib import Path
from typing import Any

from forge.base.errors import Location, Problem, WorkspaceError
from forge.base.files import read_file
from forge.base.formats import read_yaml
from forge.base.frozen import frozen
from forge.base.names import is_safe_name, is_safe_relative_path
from forge.workspace.forge_toml import FORGE_TOML, read_forge_toml, table_of
from forge.workspace.identity import plugin
from forge.workspace.model import Dependency, DependencyKind, Package

COLCON_PKG = "colcon.pkg"
_CATEGORIES = {
    "dependencies": frozenset({DependencyKind.BUILD, DependencyKind.EXEC, DependencyKind.TEST}),
    "build-dependencies": frozenset({DependencyKind.BUILD}),
    "run-dependencies": frozenset({DependencyKind.EXEC}),
    "test-dependencies": frozenset({DependencyKind.TEST}),
}
NO_SETTINGS = frozenset({"name", "type", "hooks", *_CATEGORIES})
"""Keys that are not options of a command."""


@frozen
class Overrides:
    """Options of packages by name, and of folders by real path."""

    by_name: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    by_path: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    build_types: tuple[str, ...] = ()
    """Build types of other distributions that find packages without package.xml."""

    def named(self, name: str) -> Mapping[str, Any]:
        return self.by_name.get(name, {})

    def placed(self, folder: Path) -> Mapping[str, Any]:
        return self.by_path.get(os.path.realpath(folder), {}) if self.by_path else {}


NO_OVERRIDES = Overrides()


def read_overrides(root: Path, metas: Iterable[str], home: Path | None) -> Overrides:
    """Read the files below `home`/metadata, each of `metas`, and forge.toml.

    A folder in `metas` means the colcon.meta in it; missing files are ignored. Raises WorkspaceError for
    malformed files.
    """
    by_name: dict[str, dict[str, Any]] = {}
    by_path: dict[str, dict[str, Any]] = {}
    files: list[Path] = []
    for place, folders, names in os.walk(home / "metadata", followlinks=True) if home else ():
        folders[:] = sorted(name for name in folders if not name.startswith("."))
        files += (Path(place, name) for name in sorted(names) if name.endswith(".meta"))
    for meta in metas:
        path = root / meta
        path = path / "colcon.meta" if path.is_dir() else path
        files += [path] if path.exists() else []
    for path in files:
        options = read_yaml(read_file(path), path)
        for key, target in (("names", by_name), ("paths", by_path)):
            for name, values in _section(options, key, path).items():
                folder = path.parent / str(name).replace("\0", "")
                merged = target.setdefault(str(name) if key == "names" else os.path.realpath(folder), {})
                merge(merged, values)
    content, path = read_forge_toml(root), root / FORGE_TOML
    packages = table_of(content, "packages", path)
    for name in packages:
        merge(by_name.setdefault(name, {}), table_of(packages, name, path))
    build_types = content.get("build-types", [])
    if not isinstance(build_types, list) or not all(isinstance(name, str) for name in build_types):
        hint = "for example: build-types = ['make']"
        raise WorkspaceError(Problem("'build-types' is not a list of names", Location(path), hint))
    for name in build_types:
        if plugin(name) is None:
            message = f"no installed distribution provides the build type '{name}'"
            hint = f"install it beside forge, source its workspace, or remove '{name}' from 'build-types'"
            raise WorkspaceError(Problem(message, Location(path), hint))
    return Overrides(by_name, by_path, tuple(build_types))


def merge(target: dict[str, Any], values: Mapping[str, Any]) -> None:
    """Extend lists and mappings of the same key, replace other values."""
    for key, value in values.items():
        old = target.get(key)
        if isinstance(old, list) and isinstance(value, list):
            target[key] = [*old, *value]
        elif isinstance(old, dict) and isinstance(value, dict):
            target[key] = {**old, **value}
        else:
            target[key] = value


def with_overrides(package: Package, sources: Iterable[Mapping[str, Any]]) -> Package:
    """Return the package with dependencies, hooks and settings; raises WorkspaceError for invalid ones."""
    dependencies: list[Dependency] = []
    settings: dict[str, Any] = {}
    hooks: list[str] = []
    place = Location(package.path / COLCON_PKG)
    for options in sources:
        for key, kinds in _CATEGORIES.items():
            names = options.get(key) or []
            if not isinstance(names, list) or not all(
                isinstance(name, str) and is_safe_name(name) for name in names
            ):
                raise WorkspaceError(Problem(f"'{key}' of '{package.name}' is not a list of names", place))
            dependencies += (Dependency(name, kinds) for name in names if name != package.name)
        given = options.get("hooks") or []
        listed: list[Any] = given if isinstance(given, list) else [None]
        # colcon allows a path, or a list of a path and arguments.
        paths: list[Any] = [hook[0] if isinstance(hook, list) and hook else hook for hook in listed]
        if not all(isinstance(path, str) and is_safe_relative_path(path) for path in paths):
            message = f"'hooks' of '{package.name}' is not a list of paths relative to its prefix"
            raise WorkspaceError(Problem(message, place, "for example 'share/NAME/hook.sh'"))
        hooks += paths
        merge(settings, {key: value for key, value in options.items() if key not in NO_SETTINGS})
    if not (dependencies or settings or hooks):
        return package
    manifest = replace(
        package.manifest, dependencies=(*package.manifest.dependencies, *dict.fromkeys(dependencies))
    )
    return replace(package, manifest=manifest, settings=settings, hooks=tuple(hooks))


def _section(options: Mapping[str, Any], key: str, path: Path) -> Mapping[str, Mapping[str, Any]]:
    section = options.get(key) or {}
    if not isinstance(section, dict) or not all(isinstance(value, dict) for value in section.values()):
        hint = f"the format is '{key}:', below it 'NAME_OR_PATH:', below that 'option: value'"
        raise WorkspaceError(Problem(f"'{key}' is not a mapping of names to options", Location(path), hint))
    return section
