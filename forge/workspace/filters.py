"""Filters packages by results of earlier builds and tests, and by changes in git."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from forge.base.errors import Location, Problem, SelectionError
from forge.base.graph import closure, reverse
from forge.base.layout import BUILD_RESULT, TEST_RESULT
from forge.base.text import listed

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping
    from pathlib import Path

    from forge.workspace.model import Package
    from forge.workspace.selection import FilterResult, Graph, PackageFilters


_RUN_NOTHING = ("-c", "core.fsmonitor=false")
"""Ignore a program for detecting changes that a repository's configuration may name."""


def apply_filters(
    filters: PackageFilters, root: Path, packages: Mapping[str, Package], needs: Graph
) -> tuple[tuple[FilterResult, ...], tuple[Problem, ...]]:
    """Return the packages that each filter keeps, with the reason why others are left out, and warnings.

    Raises SelectionError if git cannot determine changes.
    """
    warnings: tuple[Problem, ...] = ()
    limits = list(_by_results(filters, root / filters.build_base, packages))
    if filters.select_changed or filters.above_changed:
        changed, outside = changed_packages(root, packages, filters.since)
        if outside:
            verb = "is" if len(outside) == 1 else "are"
            message = f"{listed(outside)} {verb} in no git repository and always counted as changed"
            warnings = (Problem(message),)
        if filters.above_changed:
            changed = closure(reverse(needs), changed)
        limits.append((f"not changed since {filters.since}", changed))
    return tuple(limits), warnings


def changed_packages(
    root: Path, packages: Mapping[str, Package], revision: str
) -> tuple[frozenset[str], tuple[str, ...]]:
    """Return the names of packages with files that differ from a revision of their git repository.

    Untracked files count unless ignored. A package outside of any repository counts as changed; these are
    also returned separately. Raises SelectionError for an unknown revision, and if there is no repository.
    """
    folders = {name: (root / package.path).resolve() for name, package in packages.items()}
    changes: dict[Path, list[Path]] = {}
    found: set[str] = set()
    outside = []
    for name, folder in folders.items():
        repository = next((at for at in (folder, *folder.parents) if (at / ".git").exists()), None)
        if repository is None:
            outside.append(name)
            continue
        if repository not in changes:
            changes[repository] = list(_changes(repository, revision))
        if any(path.is_relative_to(folder) for path in changes[repository]):
            found.add(name)
    if outside and len(outside) == len(packages):
        hint = "select packages by name, for example with '--packages-select', or run 'git init'"
        message = "cannot determine changed packages: none of them is in a git repository"
        raise SelectionError(Problem(message, hint=hint))
    return frozenset(found).union(outside), tuple(outside)


def _by_results(filters: PackageFilters, build: Path, names: Iterable[str]) -> Iterator[FilterResult]:
    if filters.select_build_failed:
        yield "did not fail to build", _ended(build, BUILD_RESULT, names, failed=True)
    if filters.skip_build_finished:
        yield (
            "already built successfully",
            frozenset(names) - _ended(build, BUILD_RESULT, names, failed=False),
        )
    if filters.select_test_failures:
        yield "had no test failures", _ended(build, TEST_RESULT, names, failed=True)
    if filters.skip_test_passed:
        yield "passed its tests before", frozenset(names) - _ended(build, TEST_RESULT, names, failed=False)


def _ended(build: Path, file: str, names: Iterable[str], *, failed: bool) -> frozenset[str]:
    """Return the packages whose last run failed, or succeeded; interrupted runs count as neither."""
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
    """Yield the paths that differ from the revision: modified, deleted, staged or untracked."""
    import subprocess  # noqa: PLC0415  (rarely needed)

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
            raise SelectionError(Problem("cannot determine changed files: git is not installed")) from None
        except subprocess.CalledProcessError as error:
            reason = os.fsdecode(error.stderr).strip().partition("\n")[0]
            hint = "use '--since REV' with a revision that exists in all repositories of the workspace"
            message = f"git cannot determine changes since '{revision}': {reason}"
            raise SelectionError(Problem(message, Location(repository), hint)) from None
        yield from (repository / os.fsdecode(name) for name in done.stdout.split(b"\0") if name)
