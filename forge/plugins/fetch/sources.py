"""The sources of locked packages in the user's cache, shared by all workspaces, read-only.

`CACHE/sources/NAME/VERSION-COMMIT` is the tree of a package, `CACHE/clones/COMMIT.git` a repository
that a package clones while it is built. Both are complete once they have these names.
"""

from __future__ import annotations

import errno
import fcntl
import os
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

from forge.base.env_vars import without_passwords
from forge.base.errors import ForgeError, HostError, Problem, SelectionError, raise_if_any
from forge.base.files import DRAFT, delete_tree, text_or_nothing
from forge.base.text import digest, listed
from forge.plugins.fetch import git
from forge.plugins.fetch.downloads import is_repository, linux_calls
from forge.plugins.fetch.git import NetworkError
from forge.plugins.fetch.index import Release, Snapshot
from forge.plugins.fetch.lock import Clone, LockedPackage
from forge.plugins.fetch.records import write_record
from forge.workspace.cmake_text import cmake_files

_CONNECTIONS = 8
_Item = TypeVar("_Item")
_Result = TypeVar("_Result")


def source_folder(cache: Path, package: LockedPackage) -> Path:
    return cache / "sources" / package.name / f"{package.version}-{package.commit[:12]}"


def clone_folder(cache: Path, clone: Clone) -> Path:
    return cache / "clones" / f"{clone.commit}.git"


@contextmanager
def only_download(cache: Path) -> Iterator[None]:
    """Wait for downloads of other processes, and remove partial files of killed ones."""
    cache.mkdir(parents=True, exist_ok=True)
    with (cache / ".download.lock").open("w") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            print("waiting for another process that is downloading packages", file=sys.stderr, flush=True)
            fcntl.flock(file, fcntl.LOCK_EX)
        for folder in ("sources", "sources/*", "clones", "modules"):
            for draft in cache.glob(f"{folder}/.*{DRAFT}"):
                delete_tree(draft)
        yield


def lock_packages(names: Iterable[str], snapshot: Snapshot) -> tuple[list[LockedPackage], list[Problem]]:
    """Return the packages with the commits of their tags, and a problem for each missing tag."""
    by_repository: dict[str, list[Release]] = {}
    for name in sorted(names):
        by_repository.setdefault(snapshot.releases[name].repository, []).append(snapshot.releases[name])

    def look_up(url: str) -> dict[str, str]:
        return git.commits_of(url, [release.tag for release in by_repository[url]])

    locked, problems = [], []
    unreachable: list[tuple[str, NetworkError]] = []
    for url, commits in in_parallel(look_up, by_repository):
        releases = by_repository[url]
        if isinstance(commits, NetworkError):
            unreachable += ((each.name, commits) for each in releases)
            continue
        if isinstance(commits, ForgeError):
            names = listed([each.name for each in releases])
            message = f"cannot read '{without_passwords(url)}', which has {names}"
            problems.append(Problem(f"{message}: {commits.problems[0].message}"))
            continue
        for each in releases:
            if commit := commits.get(each.tag):
                locked.append(LockedPackage(each.name, each.version, url, each.tag, commit))
            else:
                problems.append(
                    Problem(f"'{without_passwords(url)}' has no tag '{each.tag}' for '{each.name}'")
                )
    return locked, [*problems, *_network_problem(unreachable)]


def _network_problem(failed: Sequence[tuple[str, NetworkError]]) -> Iterator[Problem]:
    """Yield one problem for all downloads that failed because of the network, if any did."""
    if failed:
        hint = "check the network, and run 'forge fetch' again: finished downloads are kept"
        reason = failed[0][1].problems[0].message
        yield Problem(f"cannot download {listed([name for name, _ in failed])}: {reason}", hint=hint)


def download_packages(
    packages: Iterable[LockedPackage], cache: Path, done: Callable[[str, int], object]
) -> list[Problem]:
    """Download the packages missing from the cache; return a problem for each failure.

    `done` is called for each with its name and the number of received bytes, possibly in other threads.
    """

    def download(package: LockedPackage) -> None:
        parent = source_folder(cache, package).parent
        parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(DRAFT, ".", parent) as tree:
            size = git.check_out(package.repository, package.tag, package.commit, Path(tree))
            place_package(Path(tree), package, cache)
        done(package.name, size)

    missing = [each for each in packages if not source_folder(cache, each).is_dir()]
    problems = []
    unreachable: list[tuple[str, NetworkError]] = []
    for package, result in in_parallel(download, missing):
        if isinstance(result, NetworkError):
            unreachable.append((package.name, result))
        elif isinstance(result, ForgeError):
            problems += [
                replace(each, message=f"cannot download '{package.name}': {each.message}")
                for each in result.problems
            ]
    return [*problems, *_network_problem(unreachable)]


def place_package(tree: Path, package: LockedPackage, cache: Path) -> None:
    """Copy a package from the tree of its commit to its folder in the cache."""
    folder = source_folder(cache, package)
    with _new_folder(folder) as draft:
        _copy_tree(tree / package.path, draft)
        for file in _files(draft):
            file.chmod(file.stat().st_mode & ~0o222)
        write_record(folder, draft)


def lock_clones(packages: Iterable[LockedPackage], cache: Path) -> tuple[list[Clone], list[Problem]]:
    """Return the repositories that the packages clone, and warnings of those that cannot be pinned.

    Calls below `if(BUILD_TESTING)` do not count. CMake decides whether a call is made at all.
    """
    warnings = []
    hint = "if the build clones it, the commit is not locked, and network access is needed"
    users: dict[tuple[str, str], set[str]] = {}
    for package in packages:
        for text in map(text_or_nothing, cmake_files(source_folder(cache, package))):
            for call in linux_calls(text) if "GIT_REPOSITORY" in text or "ament_vendor" in text else ():
                words = dict(zip(call.words, call.words[1:], strict=False))
                url = words.get("GIT_REPOSITORY") or words.get("VCS_URL") or ""
                tag = words.get("GIT_TAG") or words.get("VCS_VERSION") or ""
                for_tests = any("BUILD_TESTING" in each for each in call.conditions)
                if not (is_repository(call.words) and "://" in url and tag and not for_tests):
                    continue
                if "$" in url + tag:
                    message = f"'{package.name}' may clone '{url}': CMake computes the tag '{tag}'"
                    warnings.append(Problem(message, hint=hint))
                else:
                    users.setdefault((url, tag), set()).add(package.name)

    def look_up(clone: tuple[str, str]) -> str:
        url, tag = clone
        return tag if len(tag) == 40 else git.commits_of(url, [tag]).get(tag, "")

    clones = []
    for (url, tag), commit in in_parallel(look_up, users):
        names = tuple(sorted(users[url, tag]))
        if isinstance(commit, str) and commit:
            clones.append(Clone(url, tag, commit, names))
        else:
            reason = commit.problems[0].message if isinstance(commit, ForgeError) else f"no tag '{tag}'"
            warnings.append(Problem(f"'{names[0]}' may clone '{url}': {reason}", hint=hint))
    return clones, warnings


def download_clones(
    clones: Iterable[Clone], cache: Path, done: Callable[[str, int], object]
) -> list[Problem]:
    """Download the repositories missing from the cache, like `download_packages`."""

    def download(clone: Clone) -> None:
        with _new_folder(clone_folder(cache, clone)) as draft:
            size = git.mirror(clone.repository, clone.tag, clone.commit, draft)
        done(clone.repository, size)

    missing = [each for each in clones if not clone_folder(cache, each).is_dir()]
    return [
        replace(problem, message=f"cannot download '{clone.repository}': {problem.message}")
        for clone, result in in_parallel(download, missing)
        if isinstance(result, ForgeError)
        for problem in result.problems
    ]


def combined_clone(mirrors: Mapping[str, Path], folder: Path) -> Path:
    """Return a repository with these tags of one repository; each tag has a mirror in the cache."""
    if len(mirrors) == 1:
        return next(iter(mirrors.values()))
    combined = folder / f"{digest(*map(str, sorted(mirrors.values())))}.git"
    if not combined.is_dir():
        with _new_folder(combined) as draft:
            git.combine(mirrors, draft)
    return combined


def in_parallel(
    function: Callable[[_Item], _Result], items: Iterable[_Item]
) -> Iterator[tuple[_Item, _Result | ForgeError]]:
    """Yield each item with the result of the function, or with the error that it raised, in order.

    Raises HostError if the disk is full.
    """

    def attempt(item: _Item) -> _Result | ForgeError:
        try:
            return function(item)
        except ForgeError as error:
            return error

    all_items, pool = list(items), ThreadPoolExecutor(_CONNECTIONS)
    try:
        yield from zip(all_items, pool.map(attempt, all_items), strict=True)
    except OSError as error:
        if error.errno != errno.ENOSPC:
            raise
        hint = (
            "free some space, or set XDG_CACHE_HOME to a folder on another disk: finished downloads are kept"
        )
        raise HostError(Problem("no space left on the disk of forge's cache", hint=hint)) from None
    finally:
        pool.shutdown(cancel_futures=True)  # after Ctrl-C, or with a full disk


@contextmanager
def _new_folder(path: Path) -> Iterator[Path]:
    """Yield a draft and rename it at the end; after an error, the draft is removed."""
    path.parent.mkdir(parents=True, exist_ok=True)
    draft = Path(tempfile.mkdtemp(DRAFT, f".{path.name}.", path.parent))
    try:
        yield draft
        with suppress(OSError):  # another process was faster
            draft.rename(path)
    finally:
        if draft.exists():
            delete_tree(draft)


def copy_sources(packages: Iterable[LockedPackage], cache: Path, folder: Path) -> None:
    """Copy packages into a folder, for the user to edit; raises SelectionError if one is there already."""
    copies = {folder / each.name: source_folder(cache, each) for each in packages}
    hint = "remove it, or choose another folder with '--vendor'"
    existing = (path for path in copies if os.path.lexists(path))
    raise_if_any((Problem(f"'{path}' exists already", hint=hint) for path in existing), SelectionError)
    for path, source in copies.items():
        with _new_folder(path) as draft:
            _copy_tree(source, draft)
            for file in _files(draft):
                file.chmod(file.stat().st_mode | 0o200)


def _copy_tree(source: Path, target: Path) -> None:
    """Copy the contents of a folder without its git repository; raises one OSError if the disk is full."""
    ignored = shutil.ignore_patterns(".git")
    try:
        shutil.copytree(source, target, symlinks=True, dirs_exist_ok=True, ignore=ignored)
    except shutil.Error as error:
        _, path, reason = error.args[0][0]
        if os.strerror(errno.ENOSPC) not in reason:
            raise
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), path) from None


def _files(folder: Path) -> Iterator[Path]:
    """Yield the files below a folder, without links."""
    for place, _, names in os.walk(folder):
        yield from (path for name in names if not (path := Path(place, name)).is_symlink())
