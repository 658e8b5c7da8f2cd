"""Reads Cargo.toml: name, version and dependencies of a Rust package, without running cargo."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from forge.workspace.model import Dependency, DependencyKind

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

_KINDS = {
    "dependencies": frozenset({DependencyKind.BUILD, DependencyKind.EXEC}),
    "build-dependencies": frozenset({DependencyKind.BUILD}),
    "dev-dependencies": frozenset({DependencyKind.TEST}),
}
"""Libraries are linked statically, but may need files or libraries of other languages at run time."""


def package_of(content: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return the table of the package, empty for the manifest of a workspace."""
    return _table(content, "package")


def version_of(content: Mapping[str, Any]) -> str:
    """Return the version; '' if it is inherited from a workspace."""
    version = package_of(content).get("version", "")
    return version if isinstance(version, str) else ""


def cargo_dependencies(content: Mapping[str, Any], own: str) -> tuple[Dependency, ...]:
    """Return the crates that a package depends on, also those of single platforms, except itself."""
    found: dict[str, frozenset[DependencyKind]] = {}
    targets = _table(content, "target")
    for table in (content, *(_table(targets, name) for name in targets)):
        for key, kinds in _KINDS.items():
            for name in _names(_table(table, key)):
                found[name] = found.get(name, frozenset()) | kinds
    return tuple(Dependency(name, kinds) for name, kinds in sorted(found.items()) if name != own)


def _names(dependencies: Mapping[str, Any]) -> Iterator[str]:
    """Yield the names of crates, which may be renamed."""
    for name, source in dependencies.items():
        yield str(source.get("package", name)) if isinstance(source, dict) else name


def _table(content: Mapping[str, Any], key: str) -> Mapping[str, Any]:
    found = content.get(key)
    return found if isinstance(found, dict) else {}
