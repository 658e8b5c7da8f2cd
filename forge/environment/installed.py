"""Queries packages in the sourced prefixes."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from forge.base import ament_index
from forge.base.errors import EnvironmentFault, ForgeError, Problem
from forge.base.layout import LAYOUT_MARKER
from forge.base.names import did_you_mean, is_package_name

if TYPE_CHECKING:
    from collections.abc import Mapping


def sourced_packages(variables: Mapping[str, str]) -> dict[str, Path]:
    """Return every installed package with its prefix, by name; the first prefix wins.

    Raises EnvironmentFault if no prefix is sourced.
    """
    _require_prefixes(variables)
    return dict(sorted(ament_index.resources("packages", ament_index.prefixes(variables)).items()))


def find_package(name: str, variables: Mapping[str, str]) -> Path:
    """Return the prefix of an installed package.

    Raises EnvironmentFault if no prefix is sourced, ForgeError if none contains the package.
    """
    if not variables.get("AMENT_PREFIX_PATH"):
        _refuse_unbuilt(name, variables)
    _require_prefixes(variables)
    where = ament_index.prefixes(variables)
    prefix = ament_index.prefix_of(name, where) if is_package_name(name) else None
    if prefix is None:
        hint = _unsourced(name, variables) or did_you_mean(name, ament_index.resources("packages", where))
        raise ForgeError(Problem(f"package '{name}' not found", hint=hint))
    return prefix


def workspace_of(name: str, variables: Mapping[str, str]) -> Path | None:
    """Return the install folder of the enclosing workspace if only that contains package `name`."""
    if not is_package_name(name) or ament_index.prefix_of(name, ament_index.prefixes(variables)):
        return None
    setup = _setup_near(Path.cwd(), variables)
    if setup is None:
        return None
    install = setup.parent.absolute()
    built = (install / LAYOUT_MARKER).is_file()
    return install if built and ament_index.prefix_of(name, (install, install / name)) else None


def executables(package: str, prefix: Path) -> tuple[Path, ...]:
    """Return the executables of a package, sorted by path, like `ros2 pkg executables`.

    That is every executable file below lib/PACKAGE; hidden and linked folders are not entered.
    """
    found: list[Path] = []
    for folder, folders, files in os.walk(prefix / "lib" / package):
        folders[:] = (name for name in folders if not name.startswith("."))
        found += (Path(folder, name) for name in files if os.access(Path(folder, name), os.X_OK))
    return tuple(sorted(path for path in found if path.is_file()))


def _require_prefixes(variables: Mapping[str, str]) -> None:
    if not variables.get("AMENT_PREFIX_PATH"):
        setup = _setup_near(Path.cwd(), variables)
        hint = f"source {setup or 'the setup.bash of an install folder'} first"
        raise EnvironmentFault(Problem("no package can be found: 'AMENT_PREFIX_PATH' is not set", hint=hint))


def _refuse_unbuilt(name: str, variables: Mapping[str, str]) -> None:
    """Raise ForgeError if the enclosing workspace was built without the package."""
    setup = _setup_near(Path.cwd(), variables)
    if setup is None or not is_package_name(name):
        return
    install = setup.parent
    prefixes = (install, *(path for path in sorted(install.iterdir()) if path.is_dir()))
    if ament_index.prefix_of(name, prefixes) is not None:
        return
    hint = did_you_mean(name, ament_index.resources("packages", prefixes))
    if (install / name / "lib").is_dir():
        hint = "call ament_package() at the end of its CMakeLists.txt, which registers the package"
    hint = hint or f"build it: forge build --packages-select {name}"
    raise ForgeError(Problem(f"package '{name}' is not installed in '{install}'", hint=hint))


def _unsourced(name: str, variables: Mapping[str, str]) -> str | None:
    """Return a hint if the enclosing workspace contains the package but is not sourced."""
    setup = _setup_near(Path.cwd(), variables)
    if setup is None or not is_package_name(name):
        return None
    install = setup.parent
    if ament_index.prefix_of(name, (install, install / name)) is None:
        return None
    return f"it is in '{install}': source {setup}"


def _setup_near(folder: Path, variables: Mapping[str, str]) -> Path | None:
    """Return the setup script of the enclosing workspace, with the shortest path."""
    login_shell = variables.get("SHELL", "").rpartition("/")[2]
    shell = login_shell if login_shell in {"zsh", "fish"} else "bash"
    for root in (folder, *folder.parents):
        setup = root / "install" / f"setup.{shell}"
        if setup.is_file():
            return setup.relative_to(folder) if root == folder else setup
    return None
