"""`forge fetch`: lock and download the ROS packages that a workspace lacks; `forge build` builds them."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from forge.base.distributions import OLDEST, distribution_option
from forge.base.errors import (
    HostError,
    Problem,
    SelectionError,
    WorkspaceError,
    print_warnings,
    raise_if_any,
)
from forge.base.files import read_file, replace_file
from forge.base.formats import yaml_text
from forge.base.frozen import frozen
from forge.base.layout import Layout
from forge.base.options import flag, option, options_of
from forge.base.text import counted, listed
from forge.cli import options as shared
from forge.cli.preparation import build_variables, known_rosdistro
from forge.environment.prefixes import find_underlays, provider, system_prefixes
from forge.plugins.fetch.closure import Needs, check_names, middleware_package, middlewares, needs_of, resolve
from forge.plugins.fetch.index import Snapshot, read_snapshot
from forge.plugins.fetch.lock import LOCK_FILE, Lock, LockedPackage, cache_folder, read_lock, write_lock
from forge.plugins.fetch.python import REQUIREMENTS
from forge.plugins.fetch.sources import (
    clone_folder,
    copy_sources,
    download_clones,
    download_packages,
    lock_clones,
    lock_packages,
    source_folder,
)
from forge.plugins.fetch.underlay import is_underlay
from forge.toolchain.interpreter import own_command
from forge.workspace.cmake_text import announced_downloads
from forge.workspace.discovery import discover_embedded
from forge.workspace.load import LoadedWorkspace, load_workspace
from forge.workspace.manifest import parse_manifest
from forge.workspace.model import BUILD_KINDS, RUN_KINDS, TEST_KINDS, Package
from forge.workspace.resolve import provided_names
from forge.workspace.selection import Query


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
    test: bool = flag("include the dependencies of tests")
    update: tuple[str, ...] | None = option(
        "move these packages, or all, to the versions of the index", nargs="*", metavar="PKG"
    )
    locked: bool = flag(f"exit with code 2 if {LOCK_FILE} would change")
    offline: bool = flag("use what was downloaded before, and no network")
    vendor: str | None = option("copy the sources to this folder of the workspace", metavar="DIR")
    export: str | None = option("write the repositories and tags for vcs to this file", metavar="FILE.repos")
    index: str | None = option(
        "URL of the index of distributions (default: ROSDISTRO_INDEX_URL, else the public one)", metavar="URL"
    )
    install_base: str = shared.install_base_option()


def run(options: Options) -> int:
    """Lock what the workspace needs, download it, and say what else it needs; returns 0."""
    root, cache = Path.cwd(), cache_folder(os.environ)
    layout = shared.FolderOptions(install_base=options.install_base).layout(root)
    before = read_lock(root)
    chosen = known_rosdistro(options.rosdistro, root, layout.install)
    distribution = chosen or (before.distribution if before else OLDEST)
    if before and before.distribution != distribution:
        before = None
    snapshot = _snapshot(options, distribution, before)
    loaded = load_workspace(root, options.query, {**os.environ, "ROS_DISTRO": distribution})
    raise_if_any(loaded.workspace.problems, WorkspaceError)
    print_warnings(loaded.warnings)
    middleware, requested = _choices(options, snapshot, before, loaded)
    needs = resolve(
        {**dict.fromkeys(requested, ()), **_wanted(options, snapshot, loaded)},
        snapshot,
        _presence(layout, cache, distribution, loaded),
        middleware,
        tests=options.test,
    )
    packages, problems = _locked(options, before, needs, snapshot)
    clones = before.clones if before and needs.packages else ()
    lock = Lock(distribution, snapshot.digest, middleware, requested, packages, clones, tuple(needs.keys))
    if options.locked and (before is None or replace(lock, snapshot=before.snapshot) != before):
        hint = f"run 'forge fetch', and commit {LOCK_FILE}"
        raise WorkspaceError(Problem(f"'{LOCK_FILE}' does not fit the workspace", hint=hint))
    if not needs.packages:
        print("nothing to fetch: the workspace has all that it needs")
        if before:
            write_lock(root, lock)
        return 0
    lock = _download(options, lock, cache, problems)
    sources = list(_sources(source_folder(cache, each) for each in packages))
    if note := announced_downloads(sources, {each.repository for each in lock.clones}):
        print_warnings([note])
    for line in _system_packages(sources, lock):
        print(line)
    if options.export:
        entries = {
            each.name: {"type": "git", "url": each.repository, "version": each.tag} for each in packages
        }
        replace_file(Path(options.export), yaml_text({"repositories": entries}).encode())
        print(f"wrote {options.export}")
    if options.vendor:
        copy_sources(packages, cache, root / options.vendor)
        print(f"copied the packages to '{options.vendor}': the workspace builds them as its own")
    elif not options.locked and write_lock(root, lock):
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


def _choices(
    options: Options, snapshot: Snapshot, lock: Lock | None, loaded: LoadedWorkspace
) -> tuple[str, tuple[str, ...]]:
    """Return the package of the middleware, and the packages that the user has asked for by name.

    Both are remembered in the lock. Raises SelectionError for names that the distribution does not have.
    """
    known = {each.name for each in lock.packages} if lock else set()
    check_names([*options.names, *(name for name in options.update or () if name not in known)], snapshot)
    if lock and not options.rmw:
        middleware = lock.middleware
    else:
        middleware = middleware_package(options.rmw or "cyclonedds", snapshot)
    names = {*options.names, *(lock.requested if lock else ())} - loaded.workspace.packages.keys()
    if not (names or loaded.packages):
        hint = "change to the root of a workspace, or name packages: forge fetch turtlesim"
        raise SelectionError(Problem(f"no packages found below '{loaded.workspace.root}'", hint=hint))
    return middleware, tuple(sorted(names))


def _wanted(options: Options, snapshot: Snapshot, loaded: LoadedWorkspace) -> dict[str, tuple[str, ...]]:
    """Return what the workspace's packages need from outside, with those packages.

    If forge's embedded packages are enough for all of them, that is nothing.
    """
    kinds = BUILD_KINDS | RUN_KINDS | (TEST_KINDS if options.test else frozenset())
    all_middlewares = middlewares(snapshot)
    users: dict[str, set[str]] = {}
    for node in loaded.selection.names:
        package = loaded.packages[node]
        for name in needs_of(package.manifest, kinds, all_middlewares):
            if name not in loaded.workspace.packages:
                users.setdefault(name, set()).add(package.name)
    embedded = provided_names(discover_embedded(snapshot.distribution))
    if users.keys() & snapshot.releases.keys() <= embedded and not options.names:
        return {}
    return {name: tuple(sorted(names)) for name, names in sorted(users.items())}


def _presence(
    layout: Layout, cache: Path, distribution: str, loaded: LoadedWorkspace
) -> Callable[[str], bool]:
    """Return whether the workspace, an underlay of the user or the system has a package."""
    variables = build_variables(layout, os.environ, distribution)
    underlays = find_underlays(variables, layout.install)
    foreign = tuple(path for path in underlays.prefixes if not is_underlay(path, cache))
    underlays = replace(underlays, prefixes=foreign)
    system = tuple(path for path in system_prefixes(variables) if not is_underlay(path, cache))
    packages = loaded.workspace.packages
    return lambda name: name in packages or provider(name, underlays, system) is not None


def _locked(
    options: Options, lock: Lock | None, needs: Needs, snapshot: Snapshot
) -> tuple[tuple[LockedPackage, ...], list[Problem]]:
    """Return the needed packages, at the versions of the lock if it has them, and problems with others."""
    moved = options.update or ()
    keep = lock.packages if lock and options.update != () else ()
    pinned = {each.name: each for each in keep if each.name in needs.packages and each.name not in moved}
    missing = needs.packages.keys() - pinned.keys()
    if missing and options.offline:
        hint = "run 'forge fetch' with network access"
        verb = "is" if len(missing) == 1 else "are"
        raise HostError(Problem(f"{listed(sorted(missing))} {verb} not locked yet", hint=hint))
    fresh, problems = lock_packages(missing, snapshot)
    pinned.update((each.name, each) for each in fresh)
    return tuple(pinned[name] for name in sorted(pinned)), problems


def _download(options: Options, lock: Lock, cache: Path, problems: list[Problem]) -> Lock:
    """Download what the cache lacks, and return the lock with what the packages clone themselves.

    Raises HostError with these problems and those of the downloads, after all others were downloaded.
    """
    absent = [each for each in lock.packages if not source_folder(cache, each).is_dir()]
    repositories = len({each.repository for each in lock.packages})
    print(
        f"ROS {lock.distribution}: {counted(len(lock.packages), 'package')} in {repositories} repositories, "
        f"{len(absent)} to download",
        flush=True,
    )
    if options.offline:
        names = [each.name for each in absent]
        names += [each.repository for each in lock.clones if not clone_folder(cache, each).is_dir()]
        if names:
            hint = "run 'forge fetch' with network access"
            raise HostError(Problem(f"not downloaded yet: {listed(names)}", hint=hint))
        return lock
    progress = _Progress(len(absent))
    problems += download_packages(absent, cache, progress.count)
    progress.end()
    clones = lock.clones
    if not (options.locked or problems):
        found, more = lock_clones(lock.packages, cache, tests=options.test)
        clones = tuple(found)
        problems += more
    problems += download_clones(clones, cache)
    raise_if_any(problems, HostError)
    return replace(lock, clones=clones)


def _sources(folders: Iterable[Path]) -> Iterator[Package]:
    for folder in folders:
        path = folder / "package.xml"
        yield Package(folder, parse_manifest(read_file(path), path, os.environ))


def _system_packages(sources: Sequence[Package], lock: Lock) -> Iterator[str]:
    """Yield what `forge deps` says about the sources: what to install, and names that it does not know.

    Python modules are installed from PyPI by the build.
    """
    declared = {name for each in sources for name in each.manifest.names(BUILD_KINDS | RUN_KINDS)}
    skipped = (declared - set(lock.keys)) | REQUIREMENTS.keys()
    argv = own_command("deps", "--no-test-dependencies", "--rosdistro", lock.distribution)
    argv += ("--skip-keys", *sorted(skipped), "--base-paths", *(str(each.path) for each in sources))
    done = subprocess.run(argv, cwd=sources[0].path, capture_output=True, text=True, check=False)
    lines = [line for line in done.stdout.splitlines() if line]
    unknown = [line.split()[1] for line in lines if " is unknown, needed by " in line]
    if commands := [line for line in lines if not line.startswith("#")]:
        yield "the system lacks packages that they need; to install them:"
        yield from (f"  {command}" for command in commands)
    if unknown:
        yield f"system packages whose names are unknown here, see 'forge help deps': {' '.join(unknown)}"


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
