"""Reads Cargo.toml: name, version and dependencies of a Rust package, without running cargo."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from forge.base.formats import read_toml
from forge.workspace.identity import Folder, Identity
from forge.workspace.model import Dependency, DependencyKind
from forge.workspace.plain_packages import plain_package

_KINDS = {
    "dependencies": frozenset({DependencyKind.BUILD, DependencyKind.EXEC}),
    "build-dependencies": frozenset({DependencyKind.BUILD}),
    "dev-dependencies": frozenset({DependencyKind.TEST}),
}
"""Libraries are linked statically, but may need files or libraries of other languages at run time."""


def identify(folder: Folder) -> Identity | None:
    """Read Cargo.toml; members of a Cargo workspace are found in the folders below, like other packages."""
    if not folder.may_be("cargo") or not folder.has("Cargo.toml"):
        return None
    path = folder.display_path / "Cargo.toml"
    content = read_toml(folder.content("Cargo.toml"), path)
    own = _table(content, "package")
    name, version = own.get("name"), own.get("version", "")
    if not isinstance(name, str):
        return None
    needs = _dependencies(content, name)
    package = plain_package(folder, folder.name or name, "cargo", path, needs)
    # The version may be inherited from a Cargo workspace.
    manifest = replace(package.manifest, version=version if isinstance(version, str) else "")
    return Identity(replace(package, manifest=manifest), descend="workspace" in content)


def _dependencies(content: Mapping[str, Any], own: str) -> tuple[Dependency, ...]:
    """Return the crates that a package depends on, also those of single platforms, except itself."""
    found: dict[str, frozenset[DependencyKind]] = {}
    targets = _table(content, "target")
    for table in (content, *(_table(targets, name) for name in targets)):
        for key, kinds in _KINDS.items():
            for alias, source in _table(table, key).items():
                name = str(source.get("package", alias)) if isinstance(source, dict) else alias
                found[name] = found.get(name, frozenset()) | kinds
    return tuple(Dependency(name, kinds) for name, kinds in sorted(found.items()) if name != own)


def _table(content: Mapping[str, Any], key: str) -> Mapping[str, Any]:
    found = content.get(key)
    return found if isinstance(found, dict) else {}
