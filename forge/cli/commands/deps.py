"""`forge deps`: list dependencies of the workspace that are missing on this system."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from forge.base.errors import (
    EnvironmentFault,
    Problem,
    SelectionError,
    WorkspaceError,
    print_warnings,
    raise_if_any,
)
from forge.base.names import did_you_mean
from forge.cli import package_options
from forge.doctor.system_deps.outstanding import USUAL_KINDS, command_lines, needs_of
from forge.doctor.system_deps.rosdep import covers, known_databases, read_databases
from forge.doctor.system_deps.system import installed_names, os_release, system_of
from forge.environment.prefixes import find_underlays, provider, system_prefixes
from forge.toolchain.interpreter import find_interpreter
from forge.workspace.discovery import discover_embedded
from forge.workspace.load import load_workspace
from forge.workspace.model import DependencyKind
from forge.workspace.resolve import provided_names

if TYPE_CHECKING:
    import argparse
    from collections.abc import Callable, Iterator, Sequence

    from forge.cli.main import Parser
    from forge.doctor.system_deps.outstanding import DependencyStatus
    from forge.doctor.system_deps.rosdep import Database
    from forge.doctor.system_deps.system import System
    from forge.workspace.load import LoadedWorkspace


def register(parser: Parser) -> None:
    """Add the options of `forge deps`."""
    package_options.add(parser)
    parser.add_argument(
        "--json",
        action="store_true",
        help="print one JSON object: system, and needs with key, users, provider, manager, names, missing",
    )
    parser.add_argument(
        "--all", action="store_true", help="also list dependencies that are satisfied, and what provides them"
    )
    parser.add_argument(
        "-t",
        "--dependency-types",
        nargs="+",
        metavar="KIND",
        help="consider only these types: build, buildtool, build_export, buildtool_export, exec, test, "
        "doc (default: all but doc)",
    )
    parser.add_argument(
        "--rosdep-file",
        nargs="+",
        metavar="FILE",
        help="look up names in these rosdep files first",
    )
    parser.add_argument(
        "--os",
        metavar="NAME:VERSION",
        help="list packages of another system, such as ubuntu:jammy or openeuler:24.03; ignores what is "
        "installed on this machine",
    )
    parser.add_argument(
        "--build-base",
        default="build",
        metavar="DIR",
        help="build folder, for results of earlier builds (default: build)",
    )
    parser.add_argument(
        "--install-base",
        default="install",
        metavar="DIR",
        help="install folder of the workspace (default: install)",
    )
    parser.add_argument(
        "--python", metavar="PATH", help="interpreter whose installed Python packages to check"
    )


def run(options: argparse.Namespace) -> int:
    """Print a script with comments for each dependency and install commands; returns 0."""
    root = Path.cwd()
    kinds = _kinds(options.dependency_types or ())
    system = system_of(os_release(), options.os)
    databases = (*read_databases(options.rosdep_file or ()), *known_databases(system, os.environ))
    loaded = load_workspace(root, package_options.query_of(options), os.environ)
    raise_if_any(loaded.workspace.problems, WorkspaceError)
    if not loaded.packages:
        hint = "change to the root of the workspace, the folder that contains 'src'"
        raise SelectionError(Problem(f"no packages found below '{root}'", hint=hint))
    print_warnings(loaded.warnings)
    selected = [loaded.packages[node] for node in loaded.selection.names]
    needs = needs_of(selected, kinds, _provider(loaded, root / options.install_base), databases, system)
    print_warnings(_unresolved(needs, databases, system))
    python = _python(options)
    # It is unknown what is installed on another system.
    have = frozenset() if options.os else _installed(needs, python)
    if options.json:
        import json  # noqa: PLC0415  (only needed with --json)

        print(json.dumps(_plain(needs, have, system), indent=2))
        return 0
    for line in _lines(needs, have, python, everything=options.all):
        # The output may be piped to a shell: names must not contain line breaks.
        print(" ".join(line.split()))
    return 0


def _kinds(words: tuple[str, ...]) -> frozenset[DependencyKind]:
    known = {kind.value: kind for kind in DependencyKind}
    unknown = [word for word in words if word not in known]
    if unknown:
        raise SelectionError(
            *(
                Problem(
                    f"unknown dependency type '{word}'",
                    hint=did_you_mean(word, known) or f"use one of {', '.join(known)}",
                )
                for word in unknown
            )
        )
    return frozenset(known[word] for word in words) or USUAL_KINDS


def _provider(loaded: LoadedWorkspace, install: Path) -> Callable[[str], str | None]:
    """Return a function from a package name to what provides it: workspace, underlay, system or forge."""
    underlays = find_underlays(os.environ, install)
    system = tuple(path for path in system_prefixes(os.environ) if not path.is_relative_to(install))
    own = {package.name for package in loaded.packages.values()} | loaded.workspace.packages.keys()
    embedded = provided_names(discover_embedded())

    def find(name: str) -> str | None:
        if name in own:
            return "the workspace"
        found = provider(name, underlays, system)
        return str(found) if found else "forge" if name in embedded else None

    return find


def _python(options: argparse.Namespace) -> str:
    try:
        return str(find_interpreter(options.python, os.environ).path)
    except EnvironmentFault:
        return options.python or "python3"


def _unresolved(
    needs: tuple[DependencyStatus, ...], databases: Sequence[Database], system: System
) -> Iterator[Problem]:
    """Yield a warning if keys are unknown because no database contains names for the system."""
    count = sum(not (need.provider or need.manager or need.ros) for need in needs)
    name = f"{system.name}:{system.version}".rstrip(":")
    keys = f"{count} dependenc{'y' if count == 1 else 'ies'}"
    if count and not databases:
        yield Problem(
            f"cannot look up {keys} for {name}: this machine has no rosdep database",
            hint="run `pip install 'ros-forge[rosdep]'`, `sudo rosdep init` and `rosdep update`, "
            "or give a file with names to '--rosdep-file'",
        )
    elif count and not covers(databases, system):
        yield Problem(
            f"cannot look up {keys}: rosdep's data has no names for {name}",
            hint="list the names of a similar system, for example with '--os ubuntu:noble'",
        )


def _installed(needs: tuple[DependencyStatus, ...], python: str) -> frozenset[tuple[str, str]]:
    wanted: dict[str, set[str]] = {}
    for need in needs:
        if need.manager:
            wanted.setdefault(need.manager, set()).update(need.names)
    return frozenset(
        (manager, name)
        for manager, names in wanted.items()
        for name in installed_names(manager, names, python)
    )


def _lines(
    needs: tuple[DependencyStatus, ...], have: frozenset[tuple[str, str]], python: str, *, everything: bool
) -> Iterator[str]:
    """Yield a script: comments with dependencies and their users, and install commands."""
    missing = [need for need in needs if not need.provider and not _is_there(need, have)]
    if everything:
        for need in needs:
            if need not in missing:
                where = need.provider or f"{need.manager}: {' '.join(need.names) or 'nothing to install'}"
                yield f"# {need.key} ({where}), needed by {', '.join(need.users)}"
    for need in missing:
        names = ", ".join(need.names)
        if need.manager:
            called = "" if need.names == (need.key,) else f" ({need.manager}: {names})"
            yield f"# {need.key}{called}, needed by {', '.join(need.users)}"
    yield from command_lines(missing, have, python)
    for need in missing:
        users = ", ".join(need.users)
        if need.ros:
            yield f"# {need.key}, needed by {users}: ROS package; source an installation that contains it"
        elif not need.manager:
            yield f"# {need.key} is unknown, needed by {users}"
    if not missing:
        yield "# nothing is missing"


def _is_there(need: DependencyStatus, have: frozenset[tuple[str, str]]) -> bool:
    return need.manager is not None and all((need.manager, name) in have for name in need.names)


def _plain(
    needs: tuple[DependencyStatus, ...], have: frozenset[tuple[str, str]], system: System
) -> dict[str, object]:
    return {
        "system": f"{system.name}:{system.version}",
        "needs": [
            {
                "key": need.key,
                "users": list(need.users),
                "provider": need.provider,
                "manager": need.manager,
                "names": list(need.names),
                "missing": not need.provider and not _is_there(need, have),
            }
            for need in needs
        ],
    }
