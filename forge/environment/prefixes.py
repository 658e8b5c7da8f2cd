"""Finds underlays, the sourced workspaces and prefixes, and their packages."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path

from forge.base.ament_index import INDEX
from forge.base.files import text_if_exists
from forge.base.frozen import frozen
from forge.base.layout import LAYOUT_MARKER
from forge.base.names import is_safe_name
from forge.environment.install_state import is_built_on

PACKAGES = Path("share/colcon-core/packages")
SYSTEM = (Path("/usr/local"), Path("/usr"))


@frozen
class Underlays:
    """The sourced underlays: `chain` contains roots, lowest first; `prefixes` of packages, highest first.

    `overlays` are the sourced workspaces that were built on this one, which are not underlays.
    """

    chain: tuple[Path, ...] = ()
    prefixes: tuple[Path, ...] = ()
    overlays: tuple[Path, ...] = ()


_VARIABLES = ("COLCON_PREFIX_PATH", "AMENT_PREFIX_PATH", "CMAKE_PREFIX_PATH")


@frozen
class InstalledPackage:
    name: str
    prefix: Path
    needs: frozenset[str]


def find_underlays(variables: Mapping[str, str], install: Path) -> Underlays:
    """Return the sourced workspaces except this one and those that were built on it.

    The prefix of a package in an isolated layout represents its root. A root with several paths counts once.
    """
    roots = _folders(variables, "COLCON_PREFIX_PATH")
    for prefix in _folders(variables, "AMENT_PREFIX_PATH"):
        if any(prefix.glob("local_setup.*")):
            roots.append(prefix)
        elif _layout(prefix.parent) == "isolated":
            roots.append(prefix.parent)
    # The setup scripts of ros_workspace, which every ROS 2 in /opt/ros contains.
    roots += [
        prefix
        for prefix in _folders(variables, "CMAKE_PREFIX_PATH")
        if os.path.isfile(f"{prefix}/_local_setup_util.py")
    ]
    own = install.resolve()
    by_path: dict[Path, Path] = {}
    for root in roots:
        by_path.setdefault(root.resolve(), root)
    others = {path: root for path, root in by_path.items() if not path.is_relative_to(own)}
    overlays = {path: root for path, root in others.items() if is_built_on(path, own)}
    chain = [root for path, root in others.items() if path not in overlays]
    excluded = (own, *overlays)
    prefixes = [
        path
        for path in _folders(variables, "AMENT_PREFIX_PATH", "CMAKE_PREFIX_PATH")
        if not any(path.resolve().is_relative_to(root) for root in excluded)
    ]
    prefixes += (prefix for root in chain for prefix in _populated_prefixes(root))
    return Underlays(tuple(reversed(chain)), tuple(dict.fromkeys(prefixes)), tuple(overlays.values()))


def tidy_prefixes(variables: Mapping[str, str]) -> dict[str, str]:
    """Return the variables with each prefix once and normal: a changed variable rebuilds every package."""
    tidied = {
        name: os.pathsep.join(
            dict.fromkeys(str(Path(entry)) for entry in variables[name].split(os.pathsep) if entry)
        )
        for name in _VARIABLES
        if variables.get(name)
    }
    return {**variables, **tidied}


def spellings(root: Path, variables: Mapping[str, str]) -> frozenset[str]:
    """Return the paths by which `variables` name an install tree: through links, '..' or repeated slashes."""
    real = os.path.realpath(root)
    root_paths = {str(root)}
    for name in _VARIABLES:
        for entry in variables.get(name, "").split(os.pathsep):
            path = os.path.realpath(entry)
            below, stripped = path[len(real) :], entry.rstrip("/")
            if entry and f"{path}/".startswith(f"{real}/") and stripped.endswith(below):
                root_paths.add(stripped.removesuffix(below))
    return frozenset(root_paths)


def provider(name: str, underlays: Underlays, system: Sequence[Path] = SYSTEM) -> Path | None:
    """Return the prefix of a package; system prefixes, which are not sourced, need a config or manifest."""
    for prefix in underlays.prefixes:
        if (prefix / INDEX / "packages" / name).is_file() or _provides(name, prefix):
            return prefix
    return next((prefix for prefix in system if _provides(name, prefix)), None)


def system_prefixes(variables: Mapping[str, str]) -> tuple[Path, ...]:
    """Return the prefixes that CMake searches in addition: derived from PATH, and system-wide ones."""
    beside = (path.parent for path in _folders(variables, "PATH") if path.name in {"bin", "sbin"})
    return tuple(dict.fromkeys([*beside, *SYSTEM]))


def installed_packages(root: Path) -> tuple[InstalledPackage, ...]:
    """Return the packages in colcon's index of an install tree, else in ament's, as in distributions."""
    candidates = _candidates(root)
    if not candidates:
        index = root / INDEX
        return tuple(
            InstalledPackage(name, root, frozenset(filter(None, needs.strip().split(";"))))
            for name in _names(index / "packages")
            for needs in (text_if_exists(index / "package_run_dependencies" / name) or "",)
        )
    return tuple(
        InstalledPackage(name, prefix, frozenset(filter(None, needs.split(os.pathsep))))
        for name, prefix in candidates
        if (needs := text_if_exists(prefix / PACKAGES / name)) is not None
    )


def package_prefixes(root: Path) -> tuple[Path, ...]:
    """Return the folders with packages of an install tree: one for each package, or the root itself."""
    if _layout(root) != "isolated":
        return (root,) if root.is_dir() else ()
    return tuple(sorted(path for path in root.iterdir() if is_safe_name(path.name) and path.is_dir()))


def _populated_prefixes(root: Path) -> list[Path]:
    """Return the prefixes of `installed_packages`; cheaper, since no file is read."""
    if _layout(root) != "isolated":
        return [root] if any(map(_names, (root / PACKAGES, root / INDEX / "packages"))) else []
    return [prefix for name, prefix in _candidates(root) if (prefix / PACKAGES / name).is_file()]


def has_packages(root: Path) -> bool:
    """Return whether forge or colcon installed a package in an install tree; cheaper than all packages."""
    built = _layout(root) is not None
    return built and any((prefix / PACKAGES / name).is_file() for name, prefix in _candidates(root))


def _candidates(root: Path) -> list[tuple[str, Path]]:
    if _layout(root) == "isolated":
        names = sorted(entry.name for entry in root.iterdir() if is_safe_name(entry.name))
        return [(name, root / name) for name in names]
    return [(name, root) for name in _names(root / PACKAGES)]


def _folders(variables: Mapping[str, str], *names: str) -> list[Path]:
    entries = [entry for name in names for entry in variables.get(name, "").split(os.pathsep)]
    # Unlike Path.is_dir, os.path.isdir returns False for inaccessible folders.
    return [Path(entry) for entry in dict.fromkeys(entries) if os.path.isdir(entry)]


def _layout(root: Path) -> str | None:
    text = text_if_exists(root / LAYOUT_MARKER)
    return text.strip() if text is not None else None


def _provides(name: str, prefix: Path) -> bool:
    # Called for many names and prefixes in every build: avoid creating Path objects.
    return os.path.isfile(f"{prefix}/share/{name}/package.xml") or any(
        os.path.isfile(f"{prefix}/{folder}/{config}")
        for folder in (f"share/{name}/cmake", f"lib/cmake/{name}")
        for config in (f"{name}Config.cmake", f"{name.lower()}-config.cmake")
    )


def _names(folder: Path) -> list[str]:
    """Return the visible files of an index folder, sorted; empty if there is no folder."""
    with suppress(FileNotFoundError, NotADirectoryError), os.scandir(folder) as entries:
        return sorted(entry.name for entry in entries if is_safe_name(entry.name) and entry.is_file())
    return []
