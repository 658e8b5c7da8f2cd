"""`forge fetch`: lock and download the ROS packages that a workspace lacks; `forge build` builds them."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from threading import Lock as Mutex

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from forge.base.distributions import OLDEST, distribution_option
from forge.base.errors import (
    HostError,
    Problem,
    SelectionError,
    WorkspaceError,
    print_warnings,
    raise_if_any,
)
from forge.base.files import read_file, read_text, replace_file
from forge.base.frozen import frozen
from forge.base.layout import Layout
from forge.base.names import did_you_mean
from forge.base.options import flag, option, options_of
from forge.base.text import counted, listed
from forge.cli import options as shared
from forge.cli.config import configured_word
from forge.cli.preparation import build_variables, known_rosdistro
from forge.environment.prefixes import Underlays, find_underlays, provider, system_prefixes
from forge.plugins.fetch.closure import Needs, check_names, middleware_package, middlewares, needs_of, resolve
from forge.plugins.fetch.downloads import announced
from forge.plugins.fetch.index import Release, Snapshot, distributions_with, read_snapshot
from forge.plugins.fetch.lock import (
    LOCK_FILE,
    Lock,
    LockedPackage,
    Module,
    cache_folder,
    read_lock,
    write_lock,
)
from forge.plugins.fetch.python import (
    REQUIREMENTS,
    add_modules,
    declared_requirements,
    install_modules,
    is_requirement,
    is_system_module,
    lock_modules,
    make_environment,
    missing_programs,
    sees_system,
    workspace_environment,
)
from forge.plugins.fetch.repos import Imports, import_packages, repos_text
from forge.plugins.fetch.sources import (
    clone_folder,
    copy_sources,
    download_clones,
    download_packages,
    lock_clones,
    lock_packages,
    only_download,
    source_folder,
)
from forge.plugins.fetch.underlay import is_underlay
from forge.toolchain.interpreter import find_interpreter, own_command
from forge.workspace.discovery import discover_embedded
from forge.workspace.load import LoadedWorkspace, load_workspace
from forge.workspace.manifest import declaration, parse_manifest
from forge.workspace.model import BUILD_KINDS, RUN_KINDS, TEST_KINDS, Package
from forge.workspace.resolve import is_ros_name, provided_names
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
        "update these packages, or all, to the versions in the index", nargs="*", metavar="PKG"
    )
    locked: bool = flag(f"exit with code 2 if {LOCK_FILE} would change")
    offline: bool = flag("use earlier downloads only, without network access")
    vendor: str | None = option("copy the sources to this folder of the workspace", metavar="DIR")
    export: str | None = option("write the repositories and tags for vcs to this file", metavar="FILE.repos")
    imported: str | None = option(
        "use the repositories and versions in this file of vcs instead of those of the index",
        flag="--import",
        metavar="FILE.repos",
    )
    index: str | None = option(
        "URL of the index of distributions (default: ROSDISTRO_INDEX_URL, else the public one)", metavar="URL"
    )
    python: str | None = option(
        "interpreter to use instead of '.venv' (default: that of forge.toml)", metavar="PATH"
    )
    install_base: str = shared.install_base_option()
    profile: str | None = shared.profile_option()


@frozen
class _Surroundings:
    """External packages of the workspace, except those that forge built for locks."""

    variables: Mapping[str, str]
    underlays: Underlays
    system: tuple[Path, ...]

    def has(self, name: str) -> bool:
        return provider(name, self.underlays, self.system) is not None


def run(options: Options) -> int:
    """Lock and download the packages that the workspace needs, and print other dependencies; returns 0."""
    cache = cache_folder(os.environ)
    with only_download(cache):
        return _fetch(options, Path.cwd(), cache)


def _fetch(options: Options, root: Path, cache: Path) -> int:
    layout = shared.FolderOptions(install_base=options.install_base).layout(root)
    before = read_lock(root)
    chosen = known_rosdistro(options.rosdistro, root, layout.install)
    distribution = chosen or (before.distribution if before else OLDEST)
    if before and before.distribution != distribution:
        names = (*before.requested, *options.names)
        options = replace(options, names=names, rmw=options.rmw or before.middleware)
        before = None
    snapshot = _snapshot(options, distribution, before)
    loaded = load_workspace(root, options.query, {**os.environ, "ROS_DISTRO": distribution})
    raise_if_any(loaded.workspace.problems, WorkspaceError)
    print_warnings(loaded.warnings)
    imports = _imports(options, snapshot, before, cache)
    snapshot = replace(snapshot, releases={**snapshot.releases, **imports.releases})
    middleware, requested = _choices(options, snapshot, before, loaded, imports)
    surroundings = _surroundings(layout, cache, distribution)
    print_warnings(_unknown(loaded, snapshot, surroundings))
    own = loaded.workspace.packages
    needs = resolve(
        {**dict.fromkeys(requested, ()), **_wanted(options, snapshot, loaded)},
        snapshot,
        lambda name: name in own or surroundings.has(name),
        middleware,
        tests=options.test,
    )
    packages, problems = _locked(options, before, needs, snapshot, imports)
    lock = Lock(
        distribution,
        snapshot.digest,
        middleware,
        requested,
        packages,
        before.clones if before and needs.packages else (),
        tuple(needs.keys),
        tuple(pair for pair in before.pip if pair[0] in needs.keys) if before else (),
        modules=before.modules if before else (),
    )
    projects = [each for name, each in own.items() if name in loaded.selection.names]
    declared = declared_requirements(projects, {*own, *snapshot.releases, *_embedded(distribution)})
    ros, python = _requirements(needs, lock, declared, surroundings)
    lock = replace(lock, python=python)
    if options.locked and (before is None or replace(lock, snapshot=before.snapshot) != before):
        hint = f"run 'forge fetch', and commit {LOCK_FILE}"
        raise WorkspaceError(Problem(f"'{LOCK_FILE}' is out of date", hint=hint))
    if packages or problems:
        lock = _download(options, lock, cache, problems)
    manifests = [source_folder(cache, each) / "package.xml" for each in packages]
    sources = [Package(path.parent, parse_manifest(read_file(path), path, os.environ)) for path in manifests]
    if before is None or lock.keys != before.keys:
        lock = replace(lock, pip=_pip_names([*sources, *projects], lock))
        ros, python = _requirements(needs, lock, declared, surroundings)
    if not (packages or python):
        print(f"nothing to fetch: no package of ROS {distribution} is missing")
        if options.export:
            print(f"did not write '{options.export}': there is nothing to export")
        if before:
            write_lock(root, replace(lock, python=(), modules=()))
        return 0
    configured = options.python or configured_word("python", root, surroundings.variables)
    interpreter = find_interpreter(
        configured, surroundings.variables, surroundings.underlays.chain, root=root
    )
    environment = workspace_environment(root, interpreter)
    if environment and python:
        system = sees_system(lock, surroundings.underlays.chain)
        make_environment(environment, interpreter.path, system=system)
    program = environment / "bin/python3" if environment else interpreter.path
    lock = replace(lock, python=python, modules=_modules(options, lock, before, ros, python, program, cache))
    print_warnings(announced(sources, lock.keys, surroundings.variables))
    print_warnings(missing_programs(needs.keys, surroundings.variables))
    for line in _system_packages(sources, lock) if sources else ():
        print(line)
    if options.export:
        replace_file(Path(options.export), repos_text(packages).encode())
        print(f"wrote {options.export}")
    if options.vendor:
        copy_sources(packages, cache, root / options.vendor)
        print(f"copied the packages to '{options.vendor}': they are now part of the workspace")
        lock = replace(lock, packages=(), clones=())
    written = not options.locked and bool(lock.packages or lock.modules) and write_lock(root, lock)
    if written and lock.packages:
        print(f"wrote {LOCK_FILE}; 'forge build' builds the packages once, for all workspaces")
    elif written:
        print(f"wrote {LOCK_FILE}")
    if environment and lock.modules:
        install_modules(environment, lock.modules, cache, offline=options.offline)
    elif lock.modules:
        print_warnings(add_modules(interpreter, lock.modules, cache, offline=options.offline))
    return 0


def _snapshot(options: Options, distribution: str, lock: Lock | None) -> Snapshot:
    """Return the releases; use the network only if the cached answer differs from that of the lock."""
    if options.update is None and lock:
        try:
            cached_snapshot = read_snapshot(distribution, os.environ, offline=True)
        except HostError:
            if options.offline:
                raise
        else:
            if cached_snapshot.digest == lock.snapshot or options.offline:
                return cached_snapshot
    return read_snapshot(distribution, os.environ, options.index, offline=options.offline)


def _imports(options: Options, snapshot: Snapshot, lock: Lock | None, cache: Path) -> Imports:
    """Return the packages imported now or when they were locked; these differ from the index."""
    locked_imports = {
        each.name: each
        for each in (lock.packages if lock and options.update != () else ())
        if each.name not in (options.update or ())
        and (each.name not in snapshot.releases or snapshot.releases[each.name].repository != each.repository)
    }
    missing = [each.name for each in locked_imports.values() if not source_folder(cache, each).is_dir()]
    hint = "run 'forge fetch' with network access"
    if options.offline and (missing or options.imported):
        what = listed(missing) if missing else f"'{options.imported}'"
        raise HostError(Problem(f"not downloaded yet: {what}", hint=hint))
    raise_if_any(download_packages(locked_imports.values(), cache, lambda *_: None), HostError)
    releases = {
        name: Release(
            name,
            each.version,
            each.repository,
            each.tag,
            read_text(source_folder(cache, each) / "package.xml"),
        )
        for name, each in locked_imports.items()
    }
    if options.imported:
        new = import_packages(Path(options.imported), snapshot, cache)
        return Imports({**locked_imports, **new.packages}, {**releases, **new.releases})
    return Imports(locked_imports, releases)


def _choices(
    options: Options, snapshot: Snapshot, lock: Lock | None, loaded: LoadedWorkspace, imports: Imports
) -> tuple[str, tuple[str, ...]]:
    """Return the package of the middleware, and the packages that the user requested by name.

    Both are remembered in the lock. Without any package, the imported ones are used, and the others need not
    be named again. Raises SelectionError for names that the distribution does not have.
    """
    locked_names = (
        {*(each.name for each in lock.packages), *(each.name for each in lock.modules)} if lock else ()
    )
    names = [*options.names, *(name for name in options.update or () if name not in locked_names)]
    check_names(
        names, snapshot, lambda name: [] if options.offline else distributions_with(name, options.index)
    )
    imported = sorted(middlewares(snapshot) & imports.packages.keys()) if options.imported else []
    if lock and not options.rmw:
        middleware = lock.middleware
    elif len(imported) == 1 and not options.rmw:
        middleware = imported[0]
    else:
        middleware = middleware_package(options.rmw or "cyclonedds", snapshot)
    wanted = {*options.names, *(lock.requested if lock else ())} - loaded.workspace.packages.keys()
    if options.imported and not (wanted or loaded.packages):
        needed = {
            name
            for each in imports.packages
            for name in snapshot.manifest(each).names(BUILD_KINDS | RUN_KINDS)
        }
        wanted = imports.packages.keys() - needed or {*imports.packages}
    if not (wanted or loaded.packages):
        hint = "change to the root of a workspace, or name packages: forge fetch turtlesim"
        raise SelectionError(Problem(f"no packages found below '{loaded.workspace.root}'", hint=hint))
    return middleware, tuple(sorted(wanted))


def _wanted(options: Options, snapshot: Snapshot, loaded: LoadedWorkspace) -> dict[str, tuple[str, ...]]:
    """Return the external dependencies of the workspace, with the packages that need them.

    The result is empty if forge's embedded packages satisfy all of them.
    """
    kinds = BUILD_KINDS | RUN_KINDS | (TEST_KINDS if options.test else frozenset())
    all_middlewares = middlewares(snapshot)
    users: dict[str, set[str]] = {}
    for node in loaded.selection.names:
        package = loaded.packages[node]
        for name in needs_of(package.manifest, kinds, all_middlewares, tests=options.test):
            if name not in loaded.workspace.packages:
                users.setdefault(name, set()).add(package.name)
    embedded = _embedded(snapshot.distribution)
    if users.keys() & snapshot.releases.keys() <= embedded and not options.names:
        return {}
    return {name: tuple(sorted(names)) for name, names in sorted(users.items())}


def _unknown(loaded: LoadedWorkspace, snapshot: Snapshot, surroundings: _Surroundings) -> Iterator[Problem]:
    """Yield the dependencies of the workspace that must be misspelled, or packages released elsewhere."""
    released = {*loaded.workspace.packages, *snapshot.releases}
    others = {*released, *_embedded(snapshot.distribution), *REQUIREMENTS}
    for package in (loaded.packages[node] for node in loaded.selection.names):
        for name in package.manifest.names(BUILD_KINDS | RUN_KINDS):
            if "-" in name or name in others or surroundings.has(name):
                continue
            hint = did_you_mean(name, released, 0.85)
            if hint or is_ros_name(name):
                message = (
                    f"ROS '{snapshot.distribution}' has no package '{name}', which '{package.name}' needs"
                )
                yield Problem(message, declaration(package.manifest.path, name), hint)


def _embedded(distribution: str) -> frozenset[str]:
    return provided_names(discover_embedded(distribution))


def _surroundings(layout: Layout, cache: Path, distribution: str) -> _Surroundings:
    def foreign(paths: Iterable[Path]) -> tuple[Path, ...]:
        return tuple(path for path in paths if not is_underlay(path, cache))

    variables = build_variables(layout, os.environ, distribution)
    all_underlays = find_underlays(variables, layout.install)
    underlays = replace(
        all_underlays, prefixes=foreign(all_underlays.prefixes), chain=foreign(all_underlays.chain)
    )
    return _Surroundings(variables, underlays, foreign(system_prefixes(variables)))


def _requirements(
    needs: Needs, lock: Lock, declared: Iterable[str], surroundings: _Surroundings
) -> tuple[set[str], tuple[str, ...]]:
    """Return the PyPI requirements of locked packages, and those including the workspace's own.

    With an installed ROS distribution, the modules of its keys come from the system.
    """
    ros: set[str] = set()
    own = set(declared)
    for key, pip in {**REQUIREMENTS, **dict(lock.pip)}.items():
        users = needs.keys.get(key, ())
        if needs.packages.keys() & set(users):
            ros.update(filter(is_requirement, pip.split()))
        elif key in needs.keys and (key not in REQUIREMENTS or not surroundings.underlays.chain):
            own.update(filter(is_requirement, pip.split()))
    return ros, tuple(sorted({*ros, *own}))


def _pip_names(packages: Sequence[Package], lock: Lock) -> tuple[tuple[str, str], ...]:
    """Return the PyPI distributions of those keys of the lock that rosdep installs from PyPI."""
    if not any(map(is_system_module, lock.keys)):
        return ()
    rows = json.loads(_deps(packages, lock, "--json", "--all") or '{"needs": []}')["needs"]
    pairs = ((row["key"], " ".join(row["names"])) for row in rows if row["manager"] == "pip")
    return tuple(sorted(pair for pair in pairs if is_system_module(pair[0])))


def _deps(packages: Sequence[Package], lock: Lock, *words: str) -> str:
    """Return the output of `forge deps` for the lock's keys, which is '' if it fails."""
    declared = {name for each in packages for name in each.manifest.names(BUILD_KINDS | RUN_KINDS)}
    skipped = (declared - set(lock.keys)) | REQUIREMENTS.keys() | dict(lock.pip).keys()
    folders = (str(Path.cwd() / each.path) for each in packages)
    argv = own_command("deps", *words, "--no-test-dependencies", "--rosdistro", lock.distribution)
    argv += ("--skip-keys", *sorted(skipped), "--base-paths", *folders)
    with tempfile.TemporaryDirectory() as folder:  # a folder without forge.toml
        return subprocess.run(argv, cwd=folder, capture_output=True, text=True, check=False).stdout


def _modules(
    options: Options,
    lock: Lock,
    before: Lock | None,
    ros: set[str],
    python: tuple[str, ...],
    program: Path,
    cache: Path,
) -> tuple[Module, ...]:
    """Return the Python modules, at the versions of the lock if these fulfil the requirements."""
    pinned = [each for each in lock.modules if options.update is None or each.name not in options.update]
    pinned = [] if options.update == () else pinned
    fulfilled = {each.name for each in pinned if each.ros}
    is_fulfilled = {canonicalize_name(Requirement(each).name) for each in ros} <= fulfilled
    if before and before.python == python and len(pinned) == len(before.modules) and is_fulfilled:
        return before.modules
    return lock_modules(ros, python, pinned, program, cache, offline=options.offline)


def _locked(
    options: Options, lock: Lock | None, needs: Needs, snapshot: Snapshot, imports: Imports
) -> tuple[tuple[LockedPackage, ...], list[Problem]]:
    """Return the needed packages, at the versions of the lock if possible, and problems with the others."""
    updated = options.update or ()
    locked = lock.packages if lock and options.update != () else ()
    pinned = {each.name: each for each in locked if each.name in needs.packages and each.name not in updated}
    pinned.update((name, each) for name, each in imports.packages.items() if name in needs.packages)
    missing = needs.packages.keys() - pinned.keys()
    if missing and options.offline:
        hint = "run 'forge fetch' with network access"
        verb = "is" if len(missing) == 1 else "are"
        raise HostError(Problem(f"{listed(sorted(missing))} {verb} not locked yet", hint=hint))
    fresh, problems = lock_packages(missing, snapshot)
    pinned.update((each.name, each) for each in fresh)
    return tuple(pinned[name] for name in sorted(pinned)), problems


def _download(options: Options, lock: Lock, cache: Path, problems: list[Problem]) -> Lock:
    """Download missing packages, and return the lock with the repositories that packages clone themselves.

    Raises HostError with these problems and those of the downloads, after downloading everything else.
    """
    if not lock.packages:
        raise HostError(*problems)
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
    clones, warnings = lock.clones, list[Problem]()
    if not (options.locked or problems):
        locked_clones, warnings = lock_clones(lock.packages, cache)
        clones = tuple(locked_clones)
    problems += download_clones(clones, cache, progress.count)
    progress.end()
    print_warnings(warnings)
    raise_if_any(problems, HostError)
    return replace(lock, clones=clones)


def _system_packages(sources: Sequence[Package], lock: Lock) -> Iterator[str]:
    """Yield the output of `forge deps` for the sources: packages to install, and unknown names.

    Python modules come from PyPI.
    """
    lines = [line for line in _deps(sources, lock).splitlines() if line]
    unknown = [line.split()[1] for line in lines if " is unknown, needed by " in line]
    if commands := [line for line in lines if not line.startswith("#")]:
        yield "the system lacks packages that they need; to install them:"
        yield from (f"  {command}" for command in commands)
    if unknown:
        yield f"system packages whose names are unknown here, see 'forge help deps': {' '.join(unknown)}"


class _Progress:
    """Shows the progress of downloads, on a terminal in one line.

    Git servers do not announce sizes, so only received bytes are shown.
    """

    def __init__(self, total: int) -> None:
        self._total, self._done, self._bytes = total, 0, 0
        self._shown, self._mutex = sys.stderr.isatty(), Mutex()

    def count(self, name: str, size: int) -> None:
        with self._mutex:
            self._done += 1
            self._bytes += size
            if self._shown:
                line = f"[{self._done}/{max(self._total, self._done)}, {self._megabytes()}] {name}"
                print(f"\r\x1b[K{line}", end="", file=sys.stderr, flush=True)

    def end(self) -> None:
        if self._shown and self._done:
            print("\r\x1b[K", end="", file=sys.stderr, flush=True)
        if self._done:
            print(f"downloaded {self._megabytes()}", flush=True)

    def _megabytes(self) -> str:
        return f"{self._bytes / 1e6:.1f} MB"
