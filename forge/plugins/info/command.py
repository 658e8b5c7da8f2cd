"""`forge info`: show details of packages."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

from forge.base.distributions import OLDEST
from forge.base.errors import HostError, Problem, SelectionError, print_warnings
from forge.base.frozen import frozen
from forge.base.layout import LAYOUT_MARKER
from forge.base.names import did_you_mean
from forge.base.options import option, options_of
from forge.cli import options as shared
from forge.cli.commands.list import ListingOptions
from forge.cli.options import FolderOptions, install_base_option
from forge.cli.preparation import build_variables, known_rosdistro, workspace_interpreter
from forge.environment.prefixes import find_underlays
from forge.workspace.load import LoadedWorkspace
from forge.workspace.model import BUILD_KINDS, RUN_KINDS, TEST_KINDS, Package

_CATEGORIES = (("build", BUILD_KINDS), ("run", RUN_KINDS), ("test", TEST_KINDS))


@frozen
class Options:
    listing: ListingOptions = options_of(ListingOptions)
    names: tuple[str, ...] = option(
        "packages to show (default: all)", default=(), positional=True, metavar="PKG"
    )
    install_base: str = install_base_option()
    origin: str = os.curdir


def run(options: Options) -> int:
    """Print the workspace unless packages are given, and the details of each package, sorted by name."""
    loaded = options.listing.load()
    packages = _requested(loaded, tuple(name.lstrip() for name in options.names))
    packages.sort(key=lambda package: (package.name, str(package.path)))
    rows: list[dict[str, Any]] = []
    for package in packages:
        manifest = package.manifest
        dependencies = {word: sorted(set(manifest.names(kinds))) for word, kinds in _CATEGORIES}
        if package.type == "cmake" and not dependencies["test"]:
            del dependencies["test"]  # CMake files have no such category
        metadata: dict[str, object] = {}
        people = [f"{person.name} <{person.email}>" for person in manifest.maintainers if person.email]
        if people:
            metadata["maintainers"] = people
        if manifest.version:
            metadata["version"] = manifest.version
        rows.append(
            {
                "path": shared.displayed(package.path, options.origin),
                "type": package.type,
                "name": package.name,
                "dependencies": dependencies,
                "hooks": list(package.hooks),
                "metadata": {**metadata, **package.settings},
            }
        )
    if options.listing.json:
        print(json.dumps({**_surroundings(options), "packages": rows}, indent=2, default=str))
        return 0
    lines: list[str] = []
    if not options.names:
        around = _surroundings(options)
        lines.append(f"workspace: {around['workspace']}")
        if python := around["python"]:
            lines.append(f"  python: {python['path']} ({python['version']}, {python['origin']})")
        lines.append(f"  ROS distribution: {around['rosdistro']}")
        for title, key in (("underlays", "underlays"), ("built for other platforms", "targets")):
            lines += (f"  {title}: {' '.join(around[key])}",) if around[key] else ()
    for row in rows:
        lines += (f"path: {row['path']}", f"  type: {row['type']}", f"  name: {row['name']}")
        lines += ("  dependencies:",) if row["dependencies"] else ()
        lines += (f"    {word}: {' '.join(names)}" for word, names in row["dependencies"].items())
        lines += (f"  hooks: {' '.join(row['hooks'])}",) if row["hooks"] else ()
        lines += ("  metadata:",) if row["metadata"] else ()
        lines += (f"    {key}: {row['metadata'][key]}" for key in sorted(row["metadata"]))
    print(*lines, sep="\n")
    return 0


def _surroundings(options: Options) -> dict[str, Any]:
    """Return the interpreter with its origin, the ROS distribution, the underlays and built platforms.

    Without an interpreter, print a warning.
    """
    root = Path.cwd()
    profile = options.listing.sources.profile
    layout = FolderOptions(install_base=options.install_base, profile=profile).layout(root)
    chain = find_underlays(build_variables(layout, os.environ), layout.install).chain
    python = None
    try:
        interpreter = workspace_interpreter(None, layout, root)
        python = {"path": str(interpreter.path), "version": interpreter.release, "origin": interpreter.origin}
    except HostError as fault:
        print_warnings(fault.problems)
    install = root / options.install_base
    return {
        "workspace": str(root),
        "python": python,
        "rosdistro": known_rosdistro(None, root, install) or OLDEST,
        "underlays": list(map(str, chain)),
        "targets": sorted(marker.parent.name for marker in install.glob(f"*/{LAYOUT_MARKER}")),
    }


def _requested(loaded: LoadedWorkspace, names: tuple[str, ...]) -> list[Package]:
    """Return the selected packages with these names, or all selected ones without names.

    Unknown names are a warning if others are known. Raises SelectionError if no package is left.
    """
    package_names = {package.name for package in loaded.packages.values()}
    unknown = [
        Problem(f"package '{name}' is not in the workspace", hint=did_you_mean(name, package_names))
        for name in names
        if name not in package_names
    ]
    if not package_names:
        hint = "change to the root of the workspace, the folder that contains 'src'"
        raise SelectionError(Problem(f"no packages found below '{loaded.workspace.root}'", hint=hint))
    if names and len(unknown) == len(names):
        raise SelectionError(*unknown)
    print_warnings(unknown)
    selected = (loaded.packages[node] for node in loaded.selection.names)
    return [package for package in selected if not names or package.name in names]
