"""`forge deps`: list dependencies of the workspace that are missing on this system, and install them."""

from __future__ import annotations

import os
import shlex
import sys
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

from forge.base.distributions import distribution_option
from forge.base.errors import (
    HostError,
    Problem,
    SelectionError,
    WorkspaceError,
    print_warnings,
    raise_if_any,
)
from forge.base.frozen import frozen
from forge.base.layout import Layout
from forge.base.names import did_you_mean
from forge.base.options import flag, option, options_of
from forge.base.own_environment import extra_command
from forge.cli import options as shared
from forge.cli.options import OptionSources
from forge.cli.preparation import build_variables, known_rosdistro, workspace_interpreter
from forge.environment.prefixes import find_underlays, provider, system_prefixes
from forge.plugins.system_deps.lookup import (
    USUAL_KINDS,
    DependencyStatus,
    PackageNames,
    find_package_names,
    has_rosdep,
    is_installed,
    mistyped_distribution,
    needs_of,
)
from forge.plugins.system_deps.system import (
    System,
    install_commands,
    installed_names,
    run_commands,
    system_of,
)
from forge.toolchain.python_modules import os_release
from forge.workspace.discovery import discover_embedded
from forge.workspace.load import load_workspace, resolve_workspace
from forge.workspace.model import TEST_KINDS, DependencyKind, Workspace
from forge.workspace.resolve import provided_names
from forge.workspace.selection import Query


@frozen
class Options:
    query: Query = options_of(Query)
    sources: OptionSources = options_of(OptionSources)
    install: bool = flag("show the install commands, ask, and run them")
    yes: bool = flag("do not ask for confirmation, and tell package managers not to ask", short="-y")
    skip_keys: tuple[str, ...] = option(
        "ignore these dependencies", default=(), nargs="+", accumulates=True, metavar="KEY"
    )
    json: bool = flag(
        "print one JSON object: system, and needs with key, users, provider, manager, names, missing"
    )
    all: bool = flag("also list satisfied dependencies and their providers")
    dependency_types: tuple[str, ...] | None = option(
        "consider only these types: build, buildtool, build_export, buildtool_export, exec, test, doc "
        "(default: all but doc)",
        short="-t",
        nargs="+",
        metavar="KIND",
    )
    rosdistro: str | None = distribution_option()
    rosdep_file: tuple[str, ...] | None = option(
        "look up names in these rosdep files first", nargs="+", metavar="FILE"
    )
    os: str | None = option(
        "list packages of another system, such as ubuntu:jammy or openeuler:24.03, regardless of those "
        "installed on this machine",
        metavar="NAME:VERSION",
    )
    build_base: str = shared.build_base_option()
    install_base: str = shared.install_base_option()
    python: str | None = option(
        "interpreter to check (default: that of the last or next build)", metavar="PATH"
    )


def run(options: Options) -> int:
    """Print a script with comments for each dependency and install commands, or run these; returns 0."""
    others = [other for other in ("os", "json") if options.install and getattr(options, other)]
    raise_if_any(
        (Problem(f"'--install' and '--{other}' exclude each other") for other in others), SelectionError
    )
    root = Path.cwd()
    rosdistro = known_rosdistro(options.rosdistro, root, root / options.install_base) or ""
    print_warnings(mistyped_distribution(rosdistro))
    variables = {**os.environ, "ROS_DISTRO": rosdistro} if rosdistro else dict(os.environ)
    kinds = _kinds(options.dependency_types or ())
    if options.query.no_test_dependencies and not options.dependency_types:
        kinds -= TEST_KINDS
    system = system_of(os_release(), options.os)
    names = find_package_names(options.rosdep_file or (), system, rosdistro)
    loaded = load_workspace(root, options.query, variables)
    raise_if_any(loaded.workspace.problems, WorkspaceError)
    if not loaded.packages:
        hint = "change to the root of the workspace, the folder that contains 'src'"
        raise SelectionError(Problem(f"no packages found below '{root}'", hint=hint))
    print_warnings(loaded.warnings)
    selected = [loaded.packages[node] for node in loaded.selection.names]
    layout = shared.FolderOptions(install_base=options.install_base, profile=options.sources.profile).layout(
        root
    )
    all_needs = needs_of(selected, kinds, _provider(loaded.workspace, layout), names.resolve)
    needs = tuple(need for need in all_needs if need.key not in options.skip_keys)
    print_warnings(_unresolved(needs, names, system))
    python = _python(options, layout, root)
    # The installed packages of another system are unknown.
    installed = frozenset() if options.os else _installed(needs, python)
    if options.json:
        import json

        shown = ("key", "users", "provider", "manager", "names")
        rows = [
            {
                **{name: getattr(need, name) for name in shown},
                "missing": not need.provider and not is_installed(need, installed),
            }
            for need in needs
        ]
        print(json.dumps({"system": f"{system.name}:{system.version}", "needs": rows}, indent=2))
        return 0
    missing = [need for need in needs if not need.provider and not is_installed(need, installed)]
    if options.install:
        unknown = [need for need in missing if not need.manager]
        keys = " ".join(need.key for need in unknown)
        hint = (
            f"nothing was installed; name packages in a '--rosdep-file', or ignore with '--skip-keys {keys}'"
        )
        raise_if_any(
            Problem(f"no package is known for '{need.key}', needed by {', '.join(need.users)}", hint=hint)
            for need in unknown
        )
    elevate = bool(options.os) or os.geteuid() != 0
    commands, manual = install_commands(missing, installed, python, elevate=elevate, ask=not options.yes)
    satisfied = [need for need in needs if options.all and need not in missing]
    for line in _script(satisfied, missing, commands, manual, _ros_remedy(names, system, rosdistro)):
        # The output may be piped to a shell: names must not contain line breaks.
        print(" ".join(line.split()))
    if options.install and commands:
        question = "Run this command?" if len(commands) == 1 else f"Run these {len(commands)} commands?"
        if options.yes or shared.confirmed(f"{question} [y/N] "):
            sys.stdout.flush()
            run_commands(commands)
        else:
            print("nothing was installed")
    return 0


def _script(
    satisfied: list[DependencyStatus],
    missing: list[DependencyStatus],
    commands: Mapping[str, tuple[str, ...]],
    manual: Mapping[str, list[str]],
    ros_remedy: str,
) -> Iterator[str]:
    """Yield the lines of a shell script with comments on missing dependencies and packages that need them."""
    for need in satisfied:
        where = need.provider or f"{need.manager}: {' '.join(need.names) or 'nothing to install'}"
        yield f"# {need.key} ({where}), needed by {', '.join(need.users)}"
    for need in missing:
        if need.manager:
            packages = "" if need.names == (need.key,) else f" ({need.manager}: {', '.join(need.names)})"
            yield f"# {need.key}{packages}, needed by {', '.join(need.users)}"
    yield from map(shlex.join, commands.values())
    for manager, names in manual.items():
        yield f"# install manually ({manager}): {' '.join(names)}"
    for need in missing:
        if need.ros:
            yield f"# {need.key}, needed by {', '.join(need.users)}: {ros_remedy}"
        elif not need.manager:
            yield f"# {need.key} is unknown, needed by {', '.join(need.users)}"
    if not missing:
        yield "# nothing is missing"


def _ros_remedy(names: PackageNames, system: System, rosdistro: str) -> str:
    """Return a remedy for a ROS package that no package manager provides."""
    source = "source an installation that contains it"
    if not rosdistro:
        return f"ROS package; {source}, or choose a distribution with --rosdistro"
    if names.lists_ros_packages:
        where = f"{system.name}:{system.version}".rstrip(":")
        return f"not released for {rosdistro} on {where}; {source}, or add its source code to the workspace"
    return f"ROS package; {source}"


def _kinds(words: tuple[str, ...]) -> frozenset[DependencyKind]:
    kinds_by_name = {kind.value: kind for kind in DependencyKind}
    hint = f"use one of {', '.join(kinds_by_name)}"
    unknown = (
        Problem(f"unknown dependency type '{word}'", hint=did_you_mean(word, kinds_by_name) or hint)
        for word in words
        if word not in kinds_by_name
    )
    raise_if_any(unknown, SelectionError)
    return frozenset(kinds_by_name[word] for word in words) or USUAL_KINDS


def _provider(workspace: Workspace, layout: Layout) -> Callable[[str], str | None]:
    """Return a function from a package name to its provider: workspace, underlay, system or forge.

    Underlays and embedded packages are determined as in a build.
    """
    variables = build_variables(layout, os.environ)
    underlays = find_underlays(variables, layout.install)
    system = tuple(path for path in system_prefixes(variables) if not path.is_relative_to(layout.install))
    withheld = resolve_workspace(workspace, variables, layout.install, embedded=True).withheld
    embedded = provided_names(discover_embedded()) - withheld.keys()

    def find(name: str) -> str | None:
        if name in workspace.packages:
            return "the workspace"
        prefix = provider(name, underlays, system)
        return str(prefix) if prefix else "forge" if name in embedded else None

    return find


def _python(options: Options, layout: Layout, root: Path) -> str:
    try:
        return str(workspace_interpreter(options.python, layout, root).path)
    except HostError as fault:
        print_warnings(fault.problems)
        return options.python or "python3"


def _unresolved(
    needs: tuple[DependencyStatus, ...], names: PackageNames, system: System
) -> Iterator[Problem]:
    """Yield a warning if keys are unknown because no database contains names for the system."""
    count = sum(not (need.provider or need.manager or need.ros) for need in needs)
    name = f"{system.name}:{system.version}".rstrip(":")
    keys = f"{count} dependenc{'y' if count == 1 else 'ies'}"
    update = "`sudo rosdep init` and `rosdep update`"
    if count and not has_rosdep():
        yield Problem(
            f"cannot look up {keys} for {name}: rosdep is not installed beside forge",
            hint=f"run `{extra_command('rosdep')}`, {update}",
        )
    elif count and not names.has_data:
        yield Problem(
            f"cannot look up {keys} for {name}: this machine has no rosdep database",
            hint=f"run {update}, or give a file with names to '--rosdep-file'",
        )
    elif count and not names.covers_system:
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
