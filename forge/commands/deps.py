"""`forge deps`: what the workspace needs and does not contain, and how the system calls it."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from forge import package_options
from forge.common_keys import common_keys
from forge.discovery import discover_embedded
from forge.errors import EnvironmentFault, Problem, SelectionError, WorkspaceError, raise_if_any
from forge.interpreter import find_interpreter
from forge.model import Kind
from forge.names import did_you_mean
from forge.outstanding import USUAL_KINDS, command_lines, needs_of
from forge.prefixes import find_underlays, provider, system_prefixes
from forge.provision import answered_names
from forge.rosdep import merged, system_of
from forge.rosdep_files import known_databases, os_release, read_databases
from forge.system_packages import installed_names
from forge.workspace import look_at_workspace, warn

if TYPE_CHECKING:
    import argparse
    from collections.abc import Callable, Iterator

    from forge.cli import Parser
    from forge.outstanding import Need
    from forge.rosdep import System
    from forge.workspace import Loaded


def register(parser: Parser) -> None:
    """Add the options of `forge deps`."""
    package_options.add(parser)
    parser.add_argument(
        "--json",
        action="store_true",
        help="print one JSON object: system, and needs with key, users, provider, manager, names, missing",
    )
    parser.add_argument("--all", action="store_true", help="name also what is there, and who provides it")
    parser.add_argument(
        "-t",
        "--dependency-types",
        nargs="+",
        metavar="KIND",
        help="only these: build, buildtool, build_export, buildtool_export, exec, test, doc "
        "(default: all but doc)",
    )
    parser.add_argument(
        "--rosdep-file",
        nargs="+",
        metavar="FILE",
        help="look names up in these files first; they are in rosdep's format",
    )
    parser.add_argument(
        "--os",
        metavar="NAME:VERSION",
        help="as another system calls them, as ubuntu:jammy or openeuler:24.03; what is installed here does "
        "not count then",
    )
    parser.add_argument(
        "--build-base",
        default="build",
        metavar="DIR",
        help="where results of builds are noted (default: build)",
    )
    parser.add_argument(
        "--install-base",
        default="install",
        metavar="DIR",
        help="the workspace's own install folder (default: install)",
    )
    parser.add_argument("--python", metavar="PATH", help="the interpreter that modules are for")


def run(options: argparse.Namespace) -> int:
    """Print what is needed, and a line for each package manager that installs it; returns 0."""
    root = Path.cwd()
    kinds = _kinds(options.dependency_types or ())
    system = system_of(os_release(), options.os)
    database = merged(
        (*read_databases(options.rosdep_file or ()), *known_databases(system, os.environ), common_keys())
    )
    loaded = look_at_workspace(root, options, os.environ)
    raise_if_any(loaded.workspace.problems, WorkspaceError)
    if not loaded.packages:
        hint = "go to the folder that has 'src' in it"
        raise SelectionError(Problem(f"there is no package below '{root}'", hint=hint))
    warn(loaded.doubts)
    selected = [loaded.packages[node] for node in loaded.selection.names]
    needs = needs_of(selected, kinds, _provider(loaded, root / options.install_base), database, system)
    python = _python(options)
    # Elsewhere, nobody knows here what is installed.
    have = frozenset() if options.os else _installed(needs, python)
    if options.json:
        import json  # noqa: PLC0415  (most people read)

        print(json.dumps(_plain(needs, have, system), indent=2))
        return 0
    for line in _lines(needs, have, python, everything=options.all):
        # It may be given to a shell: a name with a line end in it must not begin another line.
        print(" ".join(line.split()))
    return 0


def _kinds(words: tuple[str, ...]) -> frozenset[Kind]:
    known = {kind.value: kind for kind in Kind}
    unknown = [word for word in words if word not in known]
    if unknown:
        raise SelectionError(
            *(
                Problem(
                    f"there is no kind of dependency '{word}'",
                    hint=did_you_mean(word, known) or f"there are {', '.join(known)}",
                )
                for word in unknown
            )
        )
    return frozenset(known[word] for word in words) or USUAL_KINDS


def _provider(loaded: Loaded, install: Path) -> Callable[[str], str | None]:
    """Return what tells who has a package: the workspace, forge, an underlay or a prefix of the system."""
    underlays = find_underlays(os.environ, install)
    system = tuple(path for path in system_prefixes(os.environ) if not path.is_relative_to(install))
    own = {package.name for package in loaded.packages.values()} | loaded.workspace.packages.keys()
    embedded = answered_names(discover_embedded())

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


def _installed(needs: tuple[Need, ...], python: str) -> frozenset[tuple[str, str]]:
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
    needs: tuple[Need, ...], have: frozenset[tuple[str, str]], python: str, *, everything: bool
) -> Iterator[str]:
    """Yield a script: comments that say who needs what, commands that install it."""
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
            yield f"# {need.key} is of ROS: source an installation that has it, needed by {users}"
        elif not need.manager:
            yield f"# {need.key} is known to nobody here, needed by {users}"
    if not missing:
        yield "# nothing is missing"


def _is_there(need: Need, have: frozenset[tuple[str, str]]) -> bool:
    return need.manager is not None and all((need.manager, name) in have for name in need.names)


def _plain(needs: tuple[Need, ...], have: frozenset[tuple[str, str]], system: System) -> dict[str, object]:
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
