"""Queries packages in the sourced prefixes and in the enclosing workspace, which need not be sourced."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

from forge.base import ament_index
from forge.base.env_vars import setting
from forge.base.errors import ForgeError, HostError, Problem
from forge.base.layout import forge_command
from forge.base.names import did_you_mean, is_package_name
from forge.environment.install_state import recorded_state, recorded_underlays
from forge.environment.prefixes import PACKAGES, package_prefixes

_AMENT = "ament_"
"""The prefix of the build types whose packages are in ament's index."""


def known_prefixes(variables: Mapping[str, str], install: Path | None) -> tuple[Path, ...]:
    """Return the sourced prefixes, then those of the workspace of `install`, if any, and of its underlays."""
    workspace_prefixes = (*package_prefixes(install), *underlay_prefixes(install)) if install else ()
    return tuple(dict.fromkeys([*ament_index.prefixes(variables), *workspace_prefixes]))


def underlay_prefixes(install: Path) -> Iterator[Path]:
    """Yield the prefixes of the underlays that the last build of a workspace recorded, highest first."""
    for root in reversed(recorded_underlays(install)):
        yield from package_prefixes(root)


def known_packages(variables: Mapping[str, str], install: Path | None) -> dict[str, Path]:
    """Return the first prefix of each installed package by name; raises HostError without prefixes."""
    _require_prefixes(variables, install)
    return dict(sorted(ament_index.resources("packages", known_prefixes(variables, install)).items()))


def find_package(
    name: str,
    variables: Mapping[str, str],
    install: Path | None,
    sources: Callable[[], Mapping[str, str]] = dict,
) -> Path:
    """Return the prefix of an installed package; `sources` returns the build types of those to build.

    Raises HostError if there are no prefixes, ForgeError if none contains the package.
    """
    _require_prefixes(variables, install)
    where = known_prefixes(variables, install)
    prefix = ament_index.prefix_of(name, where) if is_package_name(name) else None
    if prefix is not None:
        return prefix
    built = sources()
    if (plain := plain_prefix(name, install, built)) is not None:
        message = f"'{name}' is a package without ament, which ament's index does not contain"
        hint = f"it is installed in '{plain}', and 'forge run {name}' runs its programs"
        raise ForgeError(Problem(message, hint=hint))
    remedy: str | None
    if install and is_package_name(name) and (install / name / "lib").is_dir():
        remedy = "call ament_package() at the end of its CMakeLists.txt, which registers the package"
    elif name in built:
        profile = recorded_state(install).profile if install else setting("PROFILE", variables)
        remedy = f"build it: {forge_command(f'build --packages-select {name}', profile)}"
    else:
        remedy = did_you_mean(name, {*ament_index.resources("packages", where), *built})
    if install is None or variables.get("AMENT_PREFIX_PATH") or not is_package_name(name):
        raise ForgeError(Problem(f"package '{name}' not found", hint=remedy))
    shown = install.relative_to(Path.cwd()) if install.parent == Path.cwd() else install
    raise ForgeError(Problem(f"package '{name}' is not installed in '{shown}'", hint=remedy))


def is_registered(name: str, variables: Mapping[str, str], install: Path | None) -> bool:
    """Return whether ament's index contains a package, sourced or in the enclosing workspace."""
    return is_package_name(name) and bool(ament_index.prefix_of(name, known_prefixes(variables, install)))


def plain_prefix(name: str, install: Path | None, built: Mapping[str, str]) -> Path | None:
    """Return the prefix of a package built without ament, or None; `built` has the build types by name."""
    without_ament = not built.get(name, _AMENT).startswith(_AMENT)
    return unregistered_prefix(name, install) if without_ament else None


def unregistered_prefix(name: str, install: Path | None) -> Path | None:
    """Return the prefix of a package that a workspace has installed, in ament's index or not, or None."""
    prefixes = (install / name, install) if install and is_package_name(name) else ()
    return next((prefix for prefix in prefixes if (prefix / PACKAGES / name).is_file()), None)


def executables(package: str, prefix: Path) -> tuple[Path, ...]:
    """Return the executable files below lib/PACKAGE, sorted by path, like `ros2 pkg executables`."""
    return _executables(prefix / "lib" / package)


def plain_executables(package: str, prefix: Path) -> tuple[Path, ...]:
    """Return executables of lib/PACKAGE and bin, without links in bin to those in lib/PACKAGE."""
    registered = executables(package, prefix)
    same = {(path.name, path.resolve()) for path in registered}
    rest = (path for path in _executables(prefix / "bin") if (path.name, path.resolve()) not in same)
    return (*registered, *rest)


def _executables(root: Path) -> tuple[Path, ...]:
    paths: list[Path] = []
    for folder, folders, files in os.walk(root):  # linked folders are not entered, either
        folders[:] = (name for name in folders if not name.startswith("."))
        paths += (Path(folder, name) for name in files if os.access(Path(folder, name), os.X_OK))
    return tuple(sorted(path for path in paths if path.is_file()))


def _require_prefixes(variables: Mapping[str, str], install: Path | None) -> None:
    if install is None and not variables.get("AMENT_PREFIX_PATH"):
        hint = "change to a workspace that was built, or source the setup script of an installation"
        raise HostError(Problem("no package can be found: 'AMENT_PREFIX_PATH' is not set", hint=hint))
