"""`forge fetch`: lock and download the ROS packages that a workspace lacks; `forge build` builds them."""

from __future__ import annotations

import os
import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from forge.base.distributions import OLDEST, distribution_option
from forge.base.errors import (
    HostError,
    Problem,
    SelectionError,
    WorkspaceError,
    print_warnings,
    raise_if_any,
)
from forge.base.frozen import frozen
from forge.base.options import option, options_of
from forge.base.text import counted, listed
from forge.cli import options as shared
from forge.cli.preparation import build_variables, known_rosdistro
from forge.environment.prefixes import find_underlays, provider, system_prefixes
from forge.plugins.fetch.closure import check_names, middleware_package, resolve
from forge.plugins.fetch.index import read_snapshot
from forge.plugins.fetch.lock import LOCK_FILE, Lock, cache_folder, read_lock, write_lock
from forge.plugins.fetch.sources import (
    clone_folder,
    download_clones,
    download_packages,
    lock_clones,
    lock_packages,
    source_folder,
)
from forge.plugins.fetch.underlay import is_underlay
from forge.workspace.discovery import discover_embedded
from forge.workspace.load import load_workspace
from forge.workspace.model import BUILD_KINDS, RUN_KINDS, TEST_KINDS
from forge.workspace.resolve import provided_names
from forge.workspace.selection import Query

if TYPE_CHECKING:
    from collections.abc import Mapping

    from forge.plugins.fetch.index import Snapshot
    from forge.plugins.fetch.lock import LockedPackage


@frozen
class Options:
    names: tuple[str, ...] = option(
        "packages to fetch besides those that the workspace needs", default=(), positional=True, metavar="PKG"
    )
    query: Query = options_of(Query)
    rosdistro: str | None = distribution_option()
    rmw: str | None = option(
        "middleware: cyclonedds, fastrtps, zenoh, or the name of its package (default: that of the lock, "
        "else cyclonedds)",
        metavar="NAME",
    )
    test: bool = option("include the dependencies of tests", default=False)
    update: tuple[str, ...] | None = option(
        "move these packages, or all, to the versions of the index", nargs="*", metavar="PKG"
    )
    locked: bool = option(f"exit with code 2 if {LOCK_FILE} would change", default=False)
    offline: bool = option("use what was downloaded before, and no network", default=False)
    index: str | None = option(
        "URL of the index of distributions (default: ROSDISTRO_INDEX_URL, else the public one)", metavar="URL"
    )
    install_base: str = shared.install_base_option()


def run(options: Options) -> int:
    """Print the plan, download what is missing, and write the lock; returns 0."""
    root = Path.cwd()
    cache = cache_folder(os.environ)
    lock = read_lock(root)
    layout = shared.FolderOptions(install_base=options.install_base).layout(root)
    chosen = known_rosdistro(options.rosdistro, root, layout.install)
    distribution = chosen or (lock.distribution if lock else OLDEST)
    if lock and lock.distribution != distribution:
        lock = None
    snapshot = _snapshot(options, distribution, lock)
    middleware = options.rmw or (lock.middleware if lock else "cyclonedds")
    middleware = middleware_package(middleware, snapshot) if options.rmw or not lock else middleware
    check_names(options.names, snapshot)
    check_names([name for name in options.update or () if not lock or name not in _names(lock)], snapshot)
    requested = tuple(sorted({*options.names, *(lock.requested if lock else ())}))

    wanted, has_packages = _wanted(options, snapshot, root, distribution)
    if not (has_packages or requested):
        hint = "change to the root of a workspace, or name packages: forge fetch turtlesim"
        raise SelectionError(Problem(f"no packages found below '{root}'", hint=hint))
    variables = build_variables(layout, os.environ, distribution)
    underlays = find_underlays(variables, layout.install)
    own = tuple(path for path in underlays.prefixes if is_underlay(path, cache))
    foreign = replace(underlays, prefixes=tuple(path for path in underlays.prefixes if path not in own))
    system = tuple(path for path in system_prefixes(variables) if not is_underlay(path, cache))
    needs = resolve(
        {**dict.fromkeys(requested, ()), **wanted},
        snapshot,
        lambda name: provider(name, foreign, system) is not None,
        middleware,
        tests=options.test,
    )
    if not needs.packages:
        print("nothing to fetch: the workspace has all that it needs")
        return 0

    pinned = _pinned(lock, options, needs.packages)
    missing = needs.packages.keys() - pinned.keys()
    problems: list[Problem] = []
    if missing:
        if options.offline:
            hint = "run 'forge fetch' with network access"
            raise HostError(Problem(f"{listed(sorted(missing))} not locked yet", hint=hint))
        fresh, problems = lock_packages(missing, snapshot)
        pinned.update((each.name, each) for each in fresh)
    packages = tuple(pinned[name] for name in sorted(pinned))
    new = Lock(
        distribution,
        snapshot.digest,
        middleware,
        requested,
        packages,
        lock.clones if lock else (),
        tuple(needs.keys),
    )
    if options.locked and (lock is None or replace(new, snapshot=lock.snapshot) != lock):
        hint = f"run 'forge fetch', and commit {LOCK_FILE}"
        raise WorkspaceError(Problem(f"'{LOCK_FILE}' does not fit the workspace", hint=hint))
    absent = [each for each in packages if not source_folder(cache, each).is_dir()]
    print(
        f"ROS {distribution}: {counted(len(packages), 'package')} in "
        f"{len({each.repository for each in packages})} repositories, {len(absent)} to download",
        flush=True,
    )
    if options.offline and absent:
        hint = "run 'forge fetch' with network access"
        names = listed([each.name for each in absent])
        raise HostError(Problem(f"the sources of {names} were not downloaded yet", hint=hint))
    progress = _Progress(len(absent))
    problems += download_packages(packages, cache, progress.count)
    progress.end()
    clones = new.clones
    if not (options.offline or options.locked or problems):
        found, more = lock_clones(packages, cache, tests=options.test)
        clones, problems = tuple(found), [*problems, *more]
    problems += [] if options.offline else download_clones(clones, cache)
    raise_if_any(problems, HostError)
    for clone in clones:
        print(f"{listed(clone.packages)} will use {clone.repository} ({clone.tag})")
        if not clone_folder(cache, clone).is_dir():
            raise HostError(Problem(f"'{clone.repository}' was not downloaded yet"))
    new = replace(new, clones=clones)
    if not options.locked and write_lock(root, new):
        print(f"wrote {LOCK_FILE}; 'forge build' builds the packages once, for all workspaces")
    return 0


def _snapshot(options: Options, distribution: str, lock: Lock | None) -> Snapshot:
    """Return the releases, from the network only if the last answer is not that of the lock."""
    if options.update is None and lock:
        try:
            kept = read_snapshot(distribution, os.environ, offline=True)
        except HostError:
            if options.offline:
                raise
        else:
            if kept.digest == lock.snapshot or options.offline:
                return kept
    return read_snapshot(distribution, os.environ, options.index, offline=options.offline)


def _wanted(
    options: Options, snapshot: Snapshot, root: Path, distribution: str
) -> tuple[dict[str, tuple[str, ...]], bool]:
    """Return what the workspace's packages need from outside, with those packages, and whether there are any.

    If forge's embedded packages are enough for all of them, that is nothing.
    """
    kinds = BUILD_KINDS | RUN_KINDS | (TEST_KINDS if options.test else frozenset())
    loaded = load_workspace(root, options.query, {**os.environ, "ROS_DISTRO": distribution})
    raise_if_any(loaded.workspace.problems, WorkspaceError)
    print_warnings(loaded.warnings)
    users: dict[str, set[str]] = {}
    for node in loaded.selection.names:
        package = loaded.packages[node]
        for name in package.manifest.names(kinds):
            if name not in loaded.workspace.packages:
                users.setdefault(name, set()).add(package.name)
    embedded = provided_names(discover_embedded(distribution))
    if users.keys() & snapshot.releases.keys() <= embedded and not options.names:
        return {}, bool(loaded.packages)
    return {name: tuple(sorted(names)) for name, names in sorted(users.items())}, bool(loaded.packages)


def _pinned(
    lock: Lock | None, options: Options, needed: Mapping[str, tuple[str, ...]]
) -> dict[str, LockedPackage]:
    """Return the packages that stay as they are locked."""
    if lock is None or options.update == ():
        return {}
    moved = options.update or ()
    return {each.name: each for each in lock.packages if each.name in needed and each.name not in moved}


def _names(lock: Lock) -> set[str]:
    return {each.name for each in lock.packages}


class _Progress:
    """Counts downloads on a terminal, in one line."""

    def __init__(self, total: int) -> None:
        self._total, self._done, self._shown = total, 0, sys.stderr.isatty()

    def count(self, package: LockedPackage) -> None:
        self._done += 1
        if self._shown:
            print(f"\r\x1b[K[{self._done}/{self._total}] {package.name}", end="", file=sys.stderr, flush=True)

    def end(self) -> None:
        if self._shown and self._done:
            print("\r\x1b[K", end="", file=sys.stderr, flush=True)
