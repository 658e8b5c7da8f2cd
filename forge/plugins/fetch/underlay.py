"""The underlay of a lock: a workspace in the user's cache, in which the locked packages are built once.

`CACHE/underlays/DISTRIBUTION-KEY` belongs to one distribution, machine, compiler, interpreter and set of
sourced underlays. Workspaces whose locks agree in the commits of all common packages share it; it grows as
they need more. Its sources are links into the user's cache; it is built by an ordinary `forge build`.
"""

from __future__ import annotations

import fcntl
import json
import os
import platform
import shutil
import subprocess
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

from forge.base.errors import HostError, Problem
from forge.base.files import read_file, replace_file, text_or_nothing
from forge.base.layout import Layout
from forge.base.text import counted, digest
from forge.cli.preparation import without_own
from forge.environment.prefixes import installed_packages
from forge.plugins.fetch.lock import LOCK_FILE, Lock, cache_folder, read_lock
from forge.plugins.fetch.python import prepare_interpreter
from forge.plugins.fetch.sources import (
    clone_folder,
    download_clones,
    download_packages,
    source_folder,
)
from forge.toolchain.interpreter import own_command
from forge.workspace.manifest import parse_manifest
from forge.workspace.model import BUILD_KINDS, RUN_KINDS

_SETTINGS = """\
# Written by forge: the packages of ROS that forge.lock files name, built once for all workspaces.
[build]
merge-install = true
cmake-args = ["-DBUILD_TESTING=OFF", "-DTRACETOOLS_DISABLED=ON"]
"""
_BUILT = "built.json"
"""The commits of the packages of the last successful build, by name."""


def is_underlay(path: Path, cache: Path) -> bool:
    """Tell whether a prefix lies in an underlay that forge built for a lock."""
    return path.is_relative_to(cache / "underlays")


def build(
    root: Path, underlays: Sequence[Path], variables: Mapping[str, str], jobs: int | None
) -> tuple[Path, ...]:
    """Return the install folder of the underlay of a workspace's lock, after building what it lacks.

    `underlays` are those that the shell sourced, `variables` the environment without the workspace's own
    entries. Raises HostError if a package cannot be downloaded or built.
    """
    lock = read_lock(root)
    if lock is None or not lock.packages:
        return ()
    cache = cache_folder(variables)
    foreign = [path for path in underlays if not is_underlay(path, cache)]
    if foreign:
        _download(lock, cache)
        manifests = (source_folder(cache, each) / "package.xml" for each in lock.packages)
        others = _declared(manifests, variables).difference(each.name for each in lock.packages)
        for path in [each for each in foreign if others.isdisjoint(_names_in(each))]:
            # Another workspace in this shell, which the packages do not need, makes no other underlay.
            foreign.remove(path)
            variables = without_own(variables, Layout(path, path, None))
    key = digest(
        platform.machine(),
        *map(str, foreign),
        *(
            os.path.realpath(shutil.which(name, path=variables.get("PATH")) or name)
            for name in _programs(variables)
        ),
    )
    commits = {each.name: each.commit for each in lock.packages}
    folder = _fitting_folder(cache / "underlays", f"{lock.distribution}-{key}", commits)
    if _commits(folder / _BUILT).items() >= commits.items():
        return (folder / "install",)
    folder.mkdir(parents=True, exist_ok=True)
    with _locked(folder):
        if not _commits(folder / _BUILT).items() >= commits.items():
            _download(lock, cache)
            _extend(folder, lock, cache)
            _run_build(folder, lock, cache, variables, jobs)
            known = _commits(folder / _BUILT)
            replace_file(folder / _BUILT, json.dumps({**known, **commits}, indent=1, sort_keys=True).encode())
    return (folder / "install",)


def _programs(variables: Mapping[str, str]) -> tuple[str, ...]:
    return (variables.get("CC") or "cc", variables.get("CXX") or "c++", "python3")


def _fitting_folder(base: Path, name: str, commits: Mapping[str, str]) -> Path:
    """Return the first underlay of this name that has no package at another commit."""
    number = 0
    while True:
        folder = base / (f"{name}-{number}" if number else name)
        there = {link.name: link.resolve().name for link in _links(folder)}
        if all(there[each].endswith(commit[:12]) for each, commit in commits.items() if each in there):
            return folder
        number += 1


def _links(folder: Path) -> list[Path]:
    return sorted((folder / "src").glob("*"))


def _commits(path: Path) -> dict[str, str]:
    try:
        commits: dict[str, str] = json.loads(text_or_nothing(path) or "{}")
    except ValueError:
        return {}
    return commits


@contextmanager
def _locked(folder: Path) -> Iterator[None]:
    with (folder / ".lock").open("w") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            print(f"waiting for another forge that builds in '{folder}'", file=sys.stderr, flush=True)
            fcntl.flock(file, fcntl.LOCK_EX)
        yield


def _declared(manifests: Iterable[Path], variables: Mapping[str, str]) -> set[str]:
    """Return the names of all build and run dependencies."""
    found = (parse_manifest(read_file(path), path, variables) for path in manifests)
    return {name for each in found for name in each.names(BUILD_KINDS | RUN_KINDS)}


def _names_in(root: Path) -> set[str]:
    return {each.name for each in installed_packages(root)}


def _download(lock: Lock, cache: Path) -> None:
    problems = [
        *download_packages(lock.packages, cache, lambda _: None),
        *download_clones(lock.clones, cache),
    ]
    if problems:
        raise HostError(*problems)


def _extend(folder: Path, lock: Lock, cache: Path) -> None:
    """Link the sources of the packages into the underlay."""
    (folder / "src").mkdir(exist_ok=True)
    replace_file(folder / "forge.toml", _SETTINGS.encode())
    for each in lock.packages:
        link = folder / "src" / each.name
        if not link.is_symlink():
            link.symlink_to(source_folder(cache, each))


def _run_build(folder: Path, lock: Lock, cache: Path, variables: Mapping[str, str], jobs: int | None) -> None:
    python = prepare_interpreter(folder, lock, variables)
    # Users set it for their nodes; packages of ROS that ask for it would be built anew whenever it changes.
    own = {name: value for name, value in variables.items() if name != "RMW_IMPLEMENTATION"}
    # Commands of git that packages run get what the lock pins, without any network.
    own |= {
        f"GIT_CONFIG_KEY_{i}": f"url.{clone_folder(cache, each).as_uri()}.insteadOf"
        for i, each in enumerate(lock.clones)
    }
    own |= {f"GIT_CONFIG_VALUE_{i}": each.repository for i, each in enumerate(lock.clones)}
    own |= {"GIT_CONFIG_COUNT": str(len(lock.clones))} if lock.clones else {}
    print(
        f"building {counted(len(lock.packages), 'package')} of ROS {lock.distribution} in '{folder}', "
        "once for all workspaces",
        file=sys.stderr,
        flush=True,
    )
    # What packages declare and no lock has is optional: other middlewares, for example.
    optional = _declared(folder.glob("src/*/package.xml"), own)
    words = ["--rosdistro", lock.distribution, "--python", python, *(("--jobs", str(jobs)) if jobs else ())]
    words += ["--event-handlers", "console_start_end-", "--skip-keys", *sorted(optional)]
    process = subprocess.Popen(own_command("build", *words), cwd=folder, env=own)
    try:
        code = process.wait()
    except KeyboardInterrupt:
        process.wait()  # it got the signal as well, and ends its own processes
        raise
    if code:
        message = f"the packages of '{LOCK_FILE}' could not be built"
        hint = f"mend what the messages above say and build again; the logs are in '{folder / 'log'}'"
        raise HostError(Problem(message, hint=hint))
