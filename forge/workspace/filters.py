"""Filters packages by results of earlier builds and tests, and by changes in git."""

from __future__ import annotations

from typing import TYPE_CHECKING

from forge.base.errors import Problem, SelectionError, raise_if_any
from forge.base.files import text_or_nothing
from forge.base.graph import closure, reverse
from forge.base.layout import BUILD_RESULT, TEST_RESULT
from forge.base.text import listed
from forge.workspace.git_changes import GitError, Repositories, repository_of

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping
    from pathlib import Path

    from forge.workspace.model import Package
    from forge.workspace.selection import FilterResult, Graph, Query


def apply_filters(
    query: Query, root: Path, packages: Mapping[str, Package], needs: Graph
) -> tuple[tuple[FilterResult, ...], tuple[Problem, ...]]:
    """Return the packages that each filter keeps, with the reason why others are left out, and warnings.

    Raises SelectionError if git cannot determine changes.
    """
    warnings: tuple[Problem, ...] = ()
    limits = list(_by_results(query, root / query.build_base, packages))
    if query.select_changed or query.above_changed:
        changed, warnings = changed_packages(root, packages, query.since)
        if query.above_changed:
            changed = closure(reverse(needs), changed)
        limits.append((f"not changed since {query.since}", changed))
    return tuple(limits), warnings


def changed_packages(
    root: Path, packages: Mapping[str, Package], revision: str
) -> tuple[frozenset[str], tuple[Problem, ...]]:
    """Return the names of packages with files that differ from a git revision, and warnings.

    Untracked files count unless ignored. A package that no repository knows counts as changed. Raises
    SelectionError for an unknown revision, and if there is no repository.
    """
    repositories = Repositories(revision)
    used: set[Path] = set()
    found: set[str] = set()
    outside: list[str] = []
    problems: list[Problem] = []
    for name, package in packages.items():
        folder = (root / package.path).resolve()
        top = repository_of(folder)
        if top is None:
            outside.append(name)
            continue
        try:
            used.add(top)
            if folder not in repositories[top].files:
                outside.append(name)
            elif folder in repositories[top].changes or _is_moved(root, package.path, repositories):
                found.add(name)
        except GitError as error:
            problems += error.problems
    raise_if_any(dict.fromkeys(problems), SelectionError)
    if outside and len(outside) == len(packages):
        hint = "select packages by name, for example with '--packages-select', or run 'git init'"
        message = "cannot determine changed packages: none of them is in a git repository"
        raise SelectionError(Problem(message, hint=hint))
    return frozenset(found).union(outside), tuple(_doubts(repositories, used, revision, outside))


def _is_moved(root: Path, path: Path, repositories: Repositories) -> bool:
    for at in (root / path, *(root / path).parents):
        if at == root:
            break
        link = at.parent.resolve() / at.name
        if at.is_symlink() and (top := repository_of(link.parent)) and link in repositories[top].changes:
            return True
    return False


def _doubts(
    repositories: Repositories, used: Iterable[Path], revision: str, outside: list[str]
) -> Iterator[Problem]:
    """Yield warnings about packages that may count as changed although they are not, or for other reasons."""
    if outside:
        verb = "is" if len(outside) == 1 else "are"
        yield Problem(f"{listed(outside)} {verb} in no git repository and always counted as changed")
    yield from (problem for _, other in sorted(repositories.items()) if (problem := other.incomplete))
    independent = [str(top) for top in sorted(used) if repositories[top].superproject is None]
    if len(independent) > 1 and revision != "HEAD":
        yield Problem(
            f"'{revision}' is resolved separately in {len(independent)} repositories: {listed(independent)}"
        )


def _by_results(query: Query, build: Path, names: Iterable[str]) -> Iterator[FilterResult]:
    if query.select_build_failed:
        yield "did not fail to build", _ended(build, BUILD_RESULT, names, failed=True)
    if query.skip_build_finished:
        finished = _ended(build, BUILD_RESULT, names, failed=False)
        yield "already built successfully", frozenset(names) - finished
    if query.select_test_failures:
        yield "had no test failures", _ended(build, TEST_RESULT, names, failed=True)
    if query.skip_test_passed:
        yield "passed its tests before", frozenset(names) - _ended(build, TEST_RESULT, names, failed=False)


def _ended(build: Path, file: str, names: Iterable[str], *, failed: bool) -> frozenset[str]:
    """Return the packages whose last run failed, or succeeded; interrupted runs count as neither."""
    words = {name: text_or_nothing(build / name / file).strip() for name in names}
    return frozenset(
        name for name, word in words.items() if word not in {"", "SIGINT"} and (word != "0") == failed
    )
