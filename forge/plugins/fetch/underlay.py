"""The underlay of a lock: a workspace in the user's cache, in which the locked packages are built once.

`CACHE/underlays/DISTRIBUTION-KEY` belongs to one distribution, machine, compiler, interpreter and set of
sourced underlays. Workspaces whose locks agree in the commits of all common packages share it; it grows as
they need more. Its sources are links into the user's cache; it is built by an ordinary `forge build`.
"""

from __future__ import annotations

import fcntl
import json
import os
import shutil
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path

from forge import __version__
from forge.base.env_vars import expand_home
from forge.base.errors import HostError, Problem
from forge.base.files import read_file, replace_file, text_or_nothing
from forge.base.layout import Layout
from forge.base.text import counted, digest, duration, listed
from forge.cli.build_options import BuildOptions
from forge.cli.preparation import without_own
from forge.environment.prefixes import installed_packages
from forge.plugins.fetch import nested
from forge.plugins.fetch.lock import LOCK_FILE, Lock, cache_folder, read_lock
from forge.plugins.fetch.python import compiled_against, prepare_interpreter, prepare_workspace
from forge.plugins.fetch.sources import (
    clone_folder,
    combined_clone,
    download_clones,
    download_packages,
    only_download,
    source_folder,
)
from forge.toolchain.interpreter import find_interpreter, own_command
from forge.workspace.manifest import parse_manifest
from forge.workspace.model import BUILD_KINDS, RUN_KINDS

SETTINGS = """\
# Written by forge: the packages of ROS that forge.lock files name, built once for all workspaces.
[build]
merge-install = true
cmake-args = ["-DBUILD_TESTING=OFF", "-DTRACETOOLS_DISABLED=ON"]
"""
_CLONES = "mirrors.json"
"""The repositories that the packages of all locks clone while they are built: a mirror for each tag."""
BUILT = "built.json"
"""The sources of the built packages, by name, and the state of the system during the build.

The file is absent until a build has checked them. Its time is the time of the last use.
"""
_SYSTEM = (
    *("/var/lib/dpkg/status", "/var/lib/rpm/rpmdb.sqlite", "/usr/lib/sysimage/rpm/rpmdb.sqlite"),
    *("/var/lib/pacman/local", "/lib/apk/db/installed"),
)
"""Files that package managers write when they install or remove something."""
_PAUSE = 0.2
"""Seconds between checks of the progress of another process."""
_NEEDS = "needs.json"
"""Declared dependencies missing from recent locks, by a digest of the packages."""
_MAX_STORED_NEEDS = 20


def is_underlay(path: Path, cache: Path) -> bool:
    """Return whether a prefix is in an underlay that forge built for a lock."""
    return path.is_relative_to(cache / "underlays")


def build(
    root: Path, underlays: Sequence[Path], variables: Mapping[str, str], options: BuildOptions
) -> tuple[Path, ...]:
    """Return the install folder of the underlay of a workspace's lock, after building missing packages.

    `underlays` are those that the shell sourced, `variables` the environment without the workspace's own
    entries. Raises HostError if a package cannot be downloaded or built.
    """
    lock = read_lock(root)
    if lock is None or not (lock.packages or lock.modules):
        return ()
    cache = cache_folder(variables)
    foreign = [path for path in underlays if not is_underlay(path, cache)]
    interpreter = find_interpreter(options.python, variables, foreign, root=root)
    prepare_workspace(root, lock, interpreter, cache, foreign)
    if not lock.packages:
        return ()
    if foreign:
        others = _outer_needs(lock, cache, variables)
        for path in [
            each
            for each in foreign
            if others.isdisjoint(package.name for package in installed_packages(each))
        ]:
            # An unrelated workspace sourced in this shell must not lead to a different underlay.
            foreign.remove(path)
            variables = without_own(variables, Layout(path, path, None))
    names = (variables.get("CC") or "cc", variables.get("CXX") or "c++")
    programs = [shutil.which(name, path=variables.get("PATH")) or name for name in names]
    programs = [os.path.realpath(path) for path in (*programs, str(interpreter.path))]
    key = digest(
        os.uname().machine,
        str(cache),  # folder names differ, because the package cache compares results at different paths
        *map(str, foreign),
        *programs,
        *compiled_against(lock),
    )
    state = _state((*programs, *_SYSTEM))
    wanted = {each.name: source_folder(cache, each).name for each in lock.packages}
    while True:
        folder = _fitting_folder(cache / "underlays", f"{lock.distribution}-{key}", wanted)
        if _is_built(folder, wanted, state):
            with suppress(OSError):
                os.utime(folder / BUILT)
            return (folder / "install",)
        folder.mkdir(parents=True, exist_ok=True)
        is_built = partial(_is_built, folder, wanted, state)
        with locked(folder, wait=not options.folders.no_wait, or_until=is_built):
            # The previous holder of the lock may have built these packages, or others with the same names.
            if is_built() or not _fits(folder, wanted):
                continue
            _download(lock, cache)
            _extend(folder, lock, cache)
            python = prepare_interpreter(folder, lock, interpreter.path, cache)
            _run_build(folder, lock, cache, variables, options, python, state)
            return (folder / "install",)


def _state(paths: Iterable[str]) -> str:
    """Return a digest of the files and of forge; if it changes, a build checks all packages."""
    parts = [__version__]
    for path in paths:
        with suppress(OSError):
            status = os.stat(path)  # noqa: PTH116  (a few for each build)
            parts.append(f"{path} {status.st_size} {status.st_mtime_ns}")
    return digest(*parts)


def _fitting_folder(base: Path, name: str, wanted: Mapping[str, str]) -> Path:
    """Return the first underlay of this name that contains no package in another version."""
    number = 0
    while not _fits(folder := base / (f"{name}-{number}" if number else name), wanted):
        number += 1
    return folder


def _fits(folder: Path, wanted: Mapping[str, str]) -> bool:
    return all(wanted.get(name, path.name) == path.name for name, path in linked_sources(folder).items())


def linked_sources(folder: Path) -> dict[str, Path]:
    """Return the cache folders that an underlay's packages link to, by name; they may no longer exist."""
    links = sorted((folder / "src").glob("*"))
    return {link.name: link.readlink() for link in links if link.is_symlink()}


def _is_built(folder: Path, wanted: Mapping[str, str], state: str) -> bool:
    with suppress(ValueError, LookupError, AttributeError, TypeError):
        built = json.loads(text_or_nothing(folder / BUILT) or "{}")
        return bool(built["state"] == state and built["packages"].items() >= wanted.items())
    return False


def lock_path(folder: Path) -> Path:
    """Return the lock of an underlay; it is beside the folder, which may be removed."""
    return folder.parent / f".{folder.name}.lock"


@contextmanager
def locked(folder: Path, *, wait: bool, or_until: Callable[[], bool] = lambda: False) -> Iterator[None]:
    """Lock an underlay; without the lock if the condition holds while another process has it."""
    with lock_path(folder).open("w") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            if not wait:
                hint = "try again later, or omit '--no-wait'"
                raise HostError(Problem(f"another process is building in '{folder}'", hint=hint)) from None
            print(f"waiting for another process that is building in '{folder}'", file=sys.stderr, flush=True)
            while not or_until():
                with suppress(BlockingIOError):
                    fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                    break
                time.sleep(_PAUSE)
        folder.mkdir(exist_ok=True)
        yield


def _declared(manifests: Iterable[Path], variables: Mapping[str, str]) -> set[str]:
    """Return the names of all build and run dependencies."""
    parsed_manifests = (parse_manifest(read_file(path), path, variables) for path in manifests)
    return {name for each in parsed_manifests for name in each.names(BUILD_KINDS | RUN_KINDS)}


def _outer_needs(lock: Lock, cache: Path, variables: Mapping[str, str]) -> set[str]:
    """Return the dependencies that the locked packages declare and that are not in the lock.

    They are stored for the next build, which would otherwise read each manifest again.
    """
    names = {each.name for each in lock.packages}
    key = digest(lock.distribution, *(f"{each.name} {each.commit}" for each in lock.packages))
    stored: dict[str, list[str]] = {}
    with suppress(ValueError):
        stored = json.loads(text_or_nothing(cache / _NEEDS) or "{}")
        if key in stored:
            return set(stored[key])
    _download(lock, cache)
    # The conditions of manifests refer to the distribution.
    environment = {**variables, "ROS_DISTRO": lock.distribution}
    needs = (
        _declared((source_folder(cache, each) / "package.xml" for each in lock.packages), environment) - names
    )
    latest = [*stored.items()][1 - _MAX_STORED_NEEDS :]
    with suppress(OSError):
        replace_file(cache / _NEEDS, json.dumps({**dict(latest), key: sorted(needs)}).encode())
    return needs


def _download(lock: Lock, cache: Path) -> None:
    with only_download(cache):
        problems = [
            *download_packages(lock.packages, cache, lambda *_: None),
            *download_clones(lock.clones, cache, lambda *_: None),
        ]
    if problems:
        raise HostError(*problems)


def _extend(folder: Path, lock: Lock, cache: Path) -> None:
    """Link the sources of the packages into the underlay."""
    (folder / "src").mkdir(exist_ok=True)
    replace_file(folder / "forge.toml", SETTINGS.encode())
    for name, source in linked_sources(folder).items():
        if not source.is_dir():
            (folder / "src" / name).unlink()
    for each in lock.packages:
        link = folder / "src" / each.name
        if not link.is_symlink():
            link.symlink_to(source_folder(cache, each))


def _run_build(
    folder: Path,
    lock: Lock,
    cache: Path,
    variables: Mapping[str, str],
    options: BuildOptions,
    python: str,
    state: str,
) -> None:
    began = time.monotonic()
    # Users set it for their nodes; ROS packages that read it would be rebuilt whenever it changes.
    own = {name: value for name, value in variables.items() if name != "RMW_IMPLEMENTATION"}
    own["PWD"] = str(folder)  # programs check these
    own |= _clone_settings(folder, lock, cache, own)
    # Provide programs that the system lacks, such as vcs for packages that clone repositories.
    own["PATH"] = os.pathsep.join([*filter(None, [own.get("PATH")]), str(Path(python).parent)])
    if options.cache.remote_cache:
        own["FORGE_REMOTE_CACHE"] = options.cache.remote_cache  # hides passwords from other users
    sources = linked_sources(folder)
    # Declared packages that are not locked are optional, such as other middlewares.
    optional = _declared((folder / "src" / name / "package.xml" for name in sources), own)
    words = ["--rosdistro", lock.distribution, "--python", python, "--json", *_passed_on(options)]
    words += ["--skip-keys", *sorted(optional)]
    # Packages of other workspaces, which may be broken, can wait.
    words += ["--packages-up-to", *(each.name for each in lock.packages)]

    def record(good: set[str]) -> None:
        built = {name: path.name for name, path in sources.items() if name in good}
        replace_file(folder / BUILT, json.dumps({"state": state, "packages": built}, indent=1).encode())

    handlers = options.report.handlers

    def what(count: int) -> str:
        return f"{counted(count, 'package')} of ROS {lock.distribution}"

    def head(count: int) -> str:
        return f"building {what(count)} in '{folder}', once for all workspaces"

    shows = handlers["console_start_end"]
    report = nested.Report(folder, head if shows else None, status=shows and handlers["status"])
    # Until the build has checked all packages, none counts as built, even if this process is killed.
    (folder / BUILT).unlink(missing_ok=True)
    code = nested.run(own_command("build", *words), own, report, record)
    if report.failed:
        names = listed(report.failed)
        hint = f"see above; 'forge build' tries again, and the workspace of the packages is '{folder}'"
        raise HostError(Problem(f"{names} of '{LOCK_FILE}' could not be built", hint=hint))
    if code:
        sys.stderr.write("".join(report.text))
        message = f"the packages of '{LOCK_FILE}' could not be built"
        raise HostError(Problem(message, hint=f"see above; the workspace of the packages is '{folder}'"))
    if shows and report.built:
        print(
            f"built {what(report.built)} [{duration(time.monotonic() - began)}]", file=sys.stderr, flush=True
        )


def _clone_settings(folder: Path, lock: Lock, cache: Path, variables: Mapping[str, str]) -> dict[str, str]:
    """Return the variables that make git clone pinned repositories from the cache, without network.

    Packages built again with these variables may clone repositories that other locks have pinned. Settings
    that the variables already contain are kept.
    """
    pinned: dict[str, dict[str, str]] = {}
    with suppress(ValueError):
        pinned = json.loads(text_or_nothing(folder / _CLONES) or "{}")
    for each in lock.clones:
        pinned.setdefault(each.repository, {})[each.tag] = str(clone_folder(cache, each))
    replace_file(folder / _CLONES, json.dumps(pinned, indent=1, sort_keys=True).encode())
    present = {}
    for url, by_tag in sorted(pinned.items()):
        if mirrors := {tag: Path(path) for tag, path in sorted(by_tag.items()) if Path(path).is_dir()}:
            present[url] = combined_clone(mirrors, folder / "clones")
    count = variables.get("GIT_CONFIG_COUNT", "")
    first = int(count) if count.isdecimal() else 0
    settings = {"GIT_CONFIG_COUNT": str(first + len(present))}
    for number, (url, path) in enumerate(present.items(), first):
        settings[f"GIT_CONFIG_KEY_{number}"] = f"url.{path.as_uri()}.insteadOf"
        settings[f"GIT_CONFIG_VALUE_{number}"] = url
    return settings


def _passed_on(options: BuildOptions) -> Iterator[str]:
    """Yield the options of the outer build that also apply to ROS packages: jobs and caches."""
    jobs, cache, limit = options.jobs, options.cache, options.jobs.memory_limit
    values = {
        "--jobs": jobs.jobs,
        "--parallel-workers": jobs.parallel_workers or None,
        "--load-limit": jobs.load_limit,
        "--memory-limit": limit and (f"{100 * limit.share}%" if limit.share else limit.size or "none"),
        "--cache": cache.cache and expand_home(cache.cache).absolute(),
        "--cache-timeout": cache.cache_timeout,
        "--cache-size": cache.cache_size,
        "--compiler-launcher": options.cmake.compiler_launcher,
    }
    yield from (f"{name}={value}" for name, value in values.items() if value is not None)
    yield from ("--cache-read-only",) if cache.cache_read_only else ()
    yield from ("--continue-on-error",) if options.continue_on_error else ()
