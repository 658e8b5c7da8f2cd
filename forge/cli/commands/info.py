"""`forge info`: show details of packages."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import TYPE_CHECKING

from forge.base.distributions import OLDEST
from forge.base.errors import HostError, Problem, SelectionError, print_warnings
from forge.base.frozen import frozen
from forge.base.layout import LAYOUT_MARKER
from forge.base.names import did_you_mean
from forge.base.options import option, options_of
from forge.cli import options as shared
from forge.cli.options import FolderOptions, ListingOptions
from forge.cli.preparation import build_variables, known_rosdistro, workspace_interpreter
from forge.environment.prefixes import find_underlays
from forge.workspace.model import BUILD_KINDS, RUN_KINDS, TEST_KINDS

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from forge.toolchain.interpreter import Interpreter
    from forge.workspace.load import LoadedWorkspace
    from forge.workspace.model import Package

_CATEGORIES = (("build", BUILD_KINDS), ("run", RUN_KINDS), ("test", TEST_KINDS))


@frozen
class Options:
    listing: ListingOptions = options_of(ListingOptions)
    names: tuple[str, ...] = option(
        "packages to show (default: all)", default=(), positional=True, metavar="PKG"
    )
    install_base: str = option(
        "install folder of the workspace (default: install)", default="install", metavar="DIR"
    )
    origin: str = os.curdir


def run(options: Options) -> int:
    """Print the workspace unless packages are given, and the details of each package, sorted by name."""
    loaded = options.listing.load()
    packages = _requested(loaded, tuple(name.lstrip() for name in options.names))
    packages.sort(key=lambda package: (package.name, str(package.path)))
    if options.listing.json:
        found = [
            {
                "path": shared.displayed(package.path, options.origin),
                "type": package.type,
                "name": package.name,
                "dependencies": _dependencies(package),
                "hooks": list(package.hooks),
                "metadata": _metadata(package),
            }
            for package in packages
        ]
        python, chain = _surroundings(options)
        fields = python and {"path": str(python.path), "version": python.release, "origin": python.origin}
        answer = {
            "workspace": str(Path.cwd()),
            "python": fields,
            "rosdistro": _rosdistro(options),
            "underlays": list(map(str, chain)),
            "targets": _targets(options),
            "packages": found,
        }
        print(json.dumps(answer, indent=2, default=str))
        return 0
    if not options.names:
        print(*_workspace(options), sep="\n")
    for package in packages:
        print(*_paragraph(package, options), sep="\n")
    return 0


def _workspace(options: Options) -> Iterator[str]:
    """Yield the interpreter of the workspace with what chose it, the ROS distribution and the underlays."""
    python, chain = _surroundings(options)
    yield f"workspace: {Path.cwd()}"
    if python:
        yield f"  python: {python.path} ({python.release}, {python.origin})"
    yield f"  ROS distribution: {_rosdistro(options)}"
    if chain:
        yield f"  underlays: {' '.join(map(str, chain))}"
    if targets := _targets(options):
        yield f"  built for other platforms: {' '.join(targets)}"


def _targets(options: Options) -> list[str]:
    """Return the platforms for which packages are installed, besides this machine."""
    install = Path.cwd() / options.install_base
    return sorted(marker.parent.name for marker in install.glob(f"*/{LAYOUT_MARKER}"))


def _rosdistro(options: Options) -> str:
    root = Path.cwd()
    return known_rosdistro(None, root, root / options.install_base) or OLDEST


def _surroundings(options: Options) -> tuple[Interpreter | None, Sequence[Path]]:
    """Return the interpreter, None after a warning if there is none, and the underlays."""
    root = Path.cwd()
    layout = FolderOptions(install_base=options.install_base).layout(root)
    chain = find_underlays(build_variables(layout, os.environ), layout.install).chain
    try:
        return workspace_interpreter(None, layout, root), chain
    except HostError as fault:
        print_warnings(fault.problems)
        return None, chain


def _requested(loaded: LoadedWorkspace, names: tuple[str, ...]) -> list[Package]:
    """Return the selected packages with these names, or all selected ones without names.

    Unknown names are a warning if others are known. Raises SelectionError if no package is left.
    """
    known = {package.name for package in loaded.packages.values()}
    unknown = [
        Problem(f"package '{name}' is not in the workspace", hint=did_you_mean(name, known))
        for name in names
        if name not in known
    ]
    if not known:
        hint = "change to the root of the workspace, the folder that contains 'src'"
        raise SelectionError(Problem(f"no packages found below '{loaded.workspace.root}'", hint=hint))
    if names and len(unknown) == len(names):
        raise SelectionError(*unknown)
    print_warnings(unknown)
    selected = (loaded.packages[node] for node in loaded.selection.names)
    return [package for package in selected if not names or package.name in names]


def _paragraph(package: Package, options: Options) -> Iterator[str]:
    yield f"path: {shared.displayed(package.path, options.origin)}"
    yield f"  type: {package.type}"
    yield f"  name: {package.name}"
    dependencies = _dependencies(package)
    if dependencies:
        yield "  dependencies:"
        yield from (f"    {word}: {' '.join(names)}" for word, names in dependencies.items())
    if package.hooks:
        yield f"  hooks: {' '.join(package.hooks)}"
    metadata = _metadata(package)
    if metadata:
        yield "  metadata:"
        yield from (f"    {key}: {metadata[key]}" for key in sorted(metadata))


def _dependencies(package: Package) -> dict[str, list[str]]:
    """Return the dependencies by category; the ones read from CMake files have no test category."""
    found = {word: sorted(set(package.manifest.names(kinds))) for word, kinds in _CATEGORIES}
    if package.type == "cmake" and not found["test"]:
        del found["test"]
    return found


def _metadata(package: Package) -> dict[str, object]:
    manifest = package.manifest
    found: dict[str, object] = {}
    people = [f"{person.name} <{person.email}>" for person in manifest.maintainers if person.email]
    if people:
        found["maintainers"] = people
    if manifest.version:
        found["version"] = manifest.version
    return {**found, **package.settings}
