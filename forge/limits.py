"""Which packages the disk speaks for: how their last build and test ended, what git says has changed."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from forge.errors import Place, Problem, SelectionError
from forge.graph import closure, reverse

if TYPE_CHECKING:
    import argparse
    from collections.abc import Iterable, Iterator, Mapping
    from pathlib import Path

    from forge.model import Package
    from forge.selection import Graph, Limit

BUILD_RESULT = "colcon_build.rc"
TEST_RESULT = "colcon_test.rc"
"""Files in a package's build folder, shared with colcon: an exit code, SIGINT, or 'test failures'."""


_RUN_NOTHING = ("-c", "core.fsmonitor=false")
"""A repository's own settings may name a program that tells what has changed."""


def limits_of(
    options: argparse.Namespace, root: Path, packages: Mapping[str, Package], needs: Graph
) -> tuple[Limit, ...]:
    """Return what the options that depend on the disk keep of the packages.

    Raises SelectionError when git cannot tell what has changed.
    """
    limits = list(_by_results(options, root / options.build_base, packages))
    if options.packages_select_changed or options.packages_above_changed:
        changed = changed_packages(root, packages, options.since)
        if options.packages_above_changed:
            changed = closure(reverse(needs), changed)
        limits.append((f"not changed since {options.since}", changed))
    return tuple(limits)


def changed_packages(root: Path, packages: Mapping[str, Package], revision: str) -> frozenset[str]:
    """Return the names of packages with files that differ from a revision of their git repository.

    New files count, ignored ones do not. A package outside of any repository counts as changed: nobody
    knows that it did not. Raises SelectionError for a revision that a repository does not know.
    """
    folders = {name: (root / package.path).resolve() for name, package in packages.items()}
    changes: dict[Path, list[Path]] = {}
    found = set()
    for name, folder in folders.items():
        repository = next((at for at in (folder, *folder.parents) if (at / ".git").exists()), None)
        if repository is None:
            found.add(name)
            continue
        if repository not in changes:
            changes[repository] = list(_changes(repository, revision))
        if any(path.is_relative_to(folder) for path in changes[repository]):
            found.add(name)
    return frozenset(found)


def _by_results(options: argparse.Namespace, build: Path, names: Iterable[str]) -> Iterator[Limit]:
    if options.packages_select_build_failed:
        yield "did not fail to build", _ended(build, BUILD_RESULT, names, failed=True)
    if options.packages_skip_build_finished:
        yield "built well before", frozenset(names) - _ended(build, BUILD_RESULT, names, failed=False)
    if options.packages_select_test_failures:
        yield "had no test failures", _ended(build, TEST_RESULT, names, failed=True)
    if options.packages_skip_test_passed:
        yield "passed its tests before", frozenset(names) - _ended(build, TEST_RESULT, names, failed=False)


def _ended(build: Path, file: str, names: Iterable[str], *, failed: bool) -> frozenset[str]:
    """Return the packages whose last result is a failure, or is none; an interruption is neither."""
    return frozenset(
        name
        for name in names
        if (word := _result(build / name / file)) not in {None, "SIGINT"} and (word != "0") == failed
    )


def _result(path: Path) -> str | None:
    try:
        return path.read_text(encoding="utf-8").strip()
    except OSError:
        return None


def _changes(repository: Path, revision: str) -> Iterator[Path]:
    """Yield the paths that differ from the revision: changed, removed, staged or new."""
    import subprocess  # noqa: PLC0415  (most builds ask nobody)

    diff = ("diff", "--name-only", "--no-renames", "-z", revision, "--")
    new = ("ls-files", "--others", "--exclude-standard", "-z")
    for words in (diff, new):
        try:
            done = subprocess.run(
                ("git", "-C", str(repository), *_RUN_NOTHING, *words),
                capture_output=True,
                check=True,
                stdin=subprocess.DEVNULL,
            )
        except FileNotFoundError:
            raise SelectionError(Problem("there is no git to ask what has changed")) from None
        except subprocess.CalledProcessError as error:
            said = os.fsdecode(error.stderr).strip().partition("\n")[0]
            hint = "name a revision that every repository of the workspace has: '--since REV'"
            message = f"git cannot tell what has changed since '{revision}': {said}"
            raise SelectionError(Problem(message, Place(repository), hint)) from None
        yield from (repository / os.fsdecode(name) for name in done.stdout.split(b"\0") if name)
