"""What users say about packages beside their manifests: colcon.pkg, *.meta files, forge.toml.

A later source adds to lists and mappings of an earlier one and replaces everything else.
"""

from __future__ import annotations

import os
from dataclasses import field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from forge.configuration import package_options
from forge.errors import Place, Problem, WorkspaceError
from forge.files import read_file
from forge.formats import read_yaml
from forge.frozen import frozen
from forge.model import Dependency, Kind
from forge.names import is_below, is_word

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from forge.model import Package

COLCON_PKG = "colcon.pkg"
_CATEGORIES = {
    "dependencies": frozenset({Kind.BUILD, Kind.EXEC, Kind.TEST}),
    "build-dependencies": frozenset({Kind.BUILD}),
    "run-dependencies": frozenset({Kind.EXEC}),
    "test-dependencies": frozenset({Kind.TEST}),
}
NO_SETTINGS = frozenset({"name", "type", "hooks", *_CATEGORIES})
"""What is said about packages that no option of a command has."""


@frozen
class Overrides:
    """What was said about packages by their name, and about folders by their real path."""

    by_name: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    by_path: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)

    def named(self, name: str) -> Mapping[str, Any]:
        """Return what was said about a package."""
        return self.by_name.get(name, {})

    def placed(self, folder: Path) -> Mapping[str, Any]:
        """Return what was said about a folder."""
        return self.by_path.get(os.path.realpath(folder), {}) if self.by_path else {}


def read_overrides(root: Path, metas: Iterable[str], home: Path | None) -> Overrides:
    """Return what the files say: those below `home`/metadata, each of `metas`, forge.toml.

    A folder among `metas` means the colcon.meta in it; one that is not there says nothing. Raises
    WorkspaceError for files that are malformed.
    """
    by_name: dict[str, dict[str, Any]] = {}
    by_path: dict[str, dict[str, Any]] = {}
    for path in (*_user_files(home), *_files(root, metas)):
        said = read_yaml(read_file(path), path)
        for key, target in (("names", by_name), ("paths", by_path)):
            for name, values in _section(said, key, path).items():
                merged = target.setdefault(str(name) if key == "names" else _real(path, str(name)), {})
                merge(merged, values)
    for name, values in package_options(root).items():
        merge(by_name.setdefault(name, {}), values)
    return Overrides(by_name, by_path)


def read_colcon_pkg(folder: Path) -> dict[str, Any]:
    """Return what the colcon.pkg in a folder says; raises WorkspaceError when it is malformed."""
    path = folder / COLCON_PKG
    return read_yaml(read_file(path), path)


def merge(target: dict[str, Any], values: Mapping[str, Any]) -> None:
    """Add to lists and mappings of the same key, replace everything else."""
    for key, value in values.items():
        old = target.get(key)
        if isinstance(old, list) and isinstance(value, list):
            target[key] = [*old, *value]
        elif isinstance(old, dict) and isinstance(value, dict):
            target[key] = {**old, **value}
        else:
            target[key] = value


def with_overrides(package: Package, sources: Iterable[Mapping[str, Any]]) -> Package:
    """Return the package with the dependencies, hooks and settings that the sources add, in their order.

    Raises WorkspaceError for dependencies that are no names and hooks that are no paths in the prefix.
    """
    dependencies: list[Dependency] = []
    settings: dict[str, Any] = {}
    hooks: list[str] = []
    for said in sources:
        for key, kinds in _CATEGORIES.items():
            names = _names(said, key, package)
            dependencies += (Dependency(name, kinds) for name in names if name != package.name)
        hooks += _hooks(said, package)
        merge(settings, {key: value for key, value in said.items() if key not in NO_SETTINGS})
    if not (dependencies or settings or hooks):
        return package
    manifest = replace(
        package.manifest, dependencies=(*package.manifest.dependencies, *dict.fromkeys(dependencies))
    )
    return replace(package, manifest=manifest, settings=settings, hooks=tuple(hooks))


def _names(said: Mapping[str, Any], key: str, package: Package) -> list[str]:
    names = said.get(key) or []
    if not isinstance(names, list) or not all(isinstance(name, str) and is_word(name) for name in names):
        raise WorkspaceError(
            Problem(f"'{key}' of '{package.name}' is no list of names", Place(package.path / COLCON_PKG))
        )
    return names


def _hooks(said: Mapping[str, Any], package: Package) -> list[str]:
    """Return the scripts; colcon has them alone, or with arguments behind them in a list."""
    hooks = said.get("hooks") or []
    listed = hooks if isinstance(hooks, list) else [None]
    firsts = [hook[0] if isinstance(hook, list) and hook else hook for hook in listed]
    paths = [path for path in firsts if isinstance(path, str) and is_below(path)]
    if len(paths) < len(listed):
        message = f"'hooks' of '{package.name}' is no list of paths below its prefix"
        raise WorkspaceError(Problem(message, Place(package.path / COLCON_PKG), "as 'share/NAME/hook.sh'"))
    return paths


def _user_files(home: Path | None) -> Iterator[Path]:
    """Yield the user's own files: all *.meta below the folder 'metadata', hidden folders left out."""
    if home is None:
        return
    for folder, names, files in os.walk(home / "metadata", followlinks=True):
        names[:] = sorted(name for name in names if not name.startswith("."))
        yield from (Path(folder) / file for file in sorted(files) if file.endswith(".meta"))


def _files(root: Path, metas: Iterable[str]) -> Iterator[Path]:
    for meta in metas:
        path = root / meta
        path = path / "colcon.meta" if path.is_dir() else path
        if path.exists():
            yield path


def _section(said: Mapping[str, Any], key: str, path: Path) -> Mapping[str, Mapping[str, Any]]:
    section = said.get(key) or {}
    if not isinstance(section, dict) or not all(isinstance(value, dict) for value in section.values()):
        hint = f"write '{key}:', below it a name or path, and below that 'option: value'"
        raise WorkspaceError(Problem(f"'{key}' holds no mapping of options", Place(path), hint))
    return section


def _real(path: Path, name: str) -> str:
    """Return the folder that a path in a file means, which is relative to the file."""
    return os.path.realpath(path.parent / name.replace("\0", ""))
