"""Underlays: the workspaces and prefixes that the environment names, and what they hold."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from forge.ament_index import INDEX
from forge.frozen import frozen
from forge.names import is_word

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

LAYOUT_MARKER = ".colcon_install_layout"
PACKAGES = Path("share/colcon-core/packages")
SYSTEM = (Path("/usr/local"), Path("/usr"))


@frozen
class Underlays:
    """What is sourced: `chain` holds roots, lowest first; `prefixes` hold packages, winners first."""

    chain: tuple[Path, ...] = ()
    prefixes: tuple[Path, ...] = ()


@frozen
class InstalledPackage:
    """A package that an install tree holds, and the packages that it needs to run."""

    name: str
    prefix: Path
    needs: frozenset[str]


def find_underlays(variables: Mapping[str, str], install: Path) -> Underlays:
    """Return the sourced workspaces, without our own, which the user may have sourced too.

    A root has setup scripts; a package's own prefix stands for the isolated tree around it.
    """
    own = install.resolve()
    prefixes = [
        path
        for path in _folders(variables, "AMENT_PREFIX_PATH", "CMAKE_PREFIX_PATH")
        if not _inside(path.resolve(), own)
    ]
    roots = _folders(variables, "COLCON_PREFIX_PATH")
    roots += filter(None, map(_root_of, _folders(variables, "AMENT_PREFIX_PATH")))
    chain = [root for root in dict.fromkeys(roots) if not _inside(root.resolve(), own)]
    held = [package.prefix for root in chain for package in installed_packages(root)]
    return Underlays(tuple(reversed(chain)), tuple(dict.fromkeys([*prefixes, *held])))


def provider(name: str, underlays: Underlays, system: Sequence[Path] = SYSTEM) -> Path | None:
    """Return the prefix that provides package `name`, or None.

    System prefixes count with a CMake config or a manifest only: nobody sources them, so what needs
    their index would not find it.
    """
    found = (prefix for prefix in underlays.prefixes if _marked(name, prefix) or _provides(name, prefix))
    return next(found, None) or next((prefix for prefix in system if _provides(name, prefix)), None)


def system_prefixes(variables: Mapping[str, str]) -> tuple[Path, ...]:
    """Return where CMake looks beyond the sourced prefixes: beside the PATH, and where systems install."""
    beside = (path.parent for path in _folders(variables, "PATH") if path.name in {"bin", "sbin"})
    return tuple(dict.fromkeys([*beside, *SYSTEM]))


def installed_packages(root: Path) -> tuple[InstalledPackage, ...]:
    """Return the packages of an install tree or prefix, by name.

    colcon's index is read, else ament's, which distributions have.
    """
    if _layout(root) == "isolated":
        names = sorted(entry.name for entry in root.iterdir() if is_word(entry.name))
        candidates = [(name, root / name) for name in names]
    else:
        candidates = [(name, root) for name in _names(root / PACKAGES)]
        if not candidates:
            return tuple(
                InstalledPackage(name, root, _run_dependencies(root, name))
                for name in _names(root / INDEX / "packages")
            )
    return tuple(
        InstalledPackage(name, prefix, frozenset(filter(None, needs.split(os.pathsep))))
        for name, prefix in candidates
        if (needs := _read(prefix / PACKAGES / name)) is not None
    )


def _folders(variables: Mapping[str, str], *names: str) -> list[Path]:
    """Return the existing folders that path variables list, each once."""
    entries = [entry for name in names for entry in variables.get(name, "").split(os.pathsep)]
    # Unlike Path.is_dir, os.path.isdir says no to a folder that others may not enter.
    return [Path(entry) for entry in dict.fromkeys(entries) if os.path.isdir(entry)]  # noqa: PTH112


def _inside(path: Path, root: Path) -> bool:
    """Tell if a path is the root or below it."""
    return path == root or root in path.parents


def _root_of(prefix: Path) -> Path | None:
    """Return the root whose scripts bring in an ament prefix, or None when nothing could."""
    if any(prefix.glob("local_setup.*")):
        return prefix
    return prefix.parent if _layout(prefix.parent) == "isolated" else None


def _layout(root: Path) -> str | None:
    """Return the word of an install tree's marker."""
    text = _read(root / LAYOUT_MARKER)
    return text.strip() if text is not None else None


def _marked(name: str, prefix: Path) -> bool:
    """Tell if a prefix's ament index has the package."""
    return (prefix / INDEX / "packages" / name).is_file()


def _provides(name: str, prefix: Path) -> bool:
    """Tell if a prefix has a manifest or a CMake config of the package."""
    # Some 30 names in each of several prefixes, before every build: no Path for each.
    return any(os.path.isfile(f"{prefix}/{path}") for path in _evidence(name))  # noqa: PTH113


def _evidence(name: str) -> Iterator[str]:
    """Yield the files of which one shows that a package is installed."""
    yield f"share/{name}/package.xml"
    for folder in (f"share/{name}/cmake", f"lib/cmake/{name}"):
        yield f"{folder}/{name}Config.cmake"
        yield f"{folder}/{name.lower()}-config.cmake"


def _names(folder: Path) -> list[str]:
    """Return the visible files of an index folder, sorted; none where there is no folder."""
    if not folder.is_dir():
        return []
    return sorted(entry.name for entry in folder.iterdir() if is_word(entry.name) and entry.is_file())


def _run_dependencies(root: Path, name: str) -> frozenset[str]:
    """Return what ament's index says about a package's needs."""
    text = _read(root / INDEX / "package_run_dependencies" / name) or ""
    return frozenset(filter(None, text.strip().split(";")))


def _read(path: Path) -> str | None:
    """Return a file's text, or None when it is not there."""
    try:
        return path.read_text(encoding="utf-8", errors="surrogateescape")
    except (FileNotFoundError, NotADirectoryError, IsADirectoryError):
        return None
