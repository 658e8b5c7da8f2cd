"""What the tests of a workspace share, and the plan of a run."""

from __future__ import annotations

import os
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from forge.budget import Budget
from forge.capacity import processors, shortage
from forge.digests import FileTable, mark_tree
from forge.errors import EnvironmentFault, Place, Problem, WorkspaceError, raise_if_any
from forge.freshness import source_changes
from forge.graph import closures, ordered_names
from forge.interpreter import find_interpreter, missing_modules
from forge.jobserver import joined_pool
from forge.journal import open_journal
from forge.makeflags import read_make_flags
from forge.model import BuildPlan, Task
from forge.prefixes import PACKAGES, find_underlays, provider
from forge.records import TABLE
from forge.results import recorded_python
from forge.testing.looking import look
from forge.testing.recipes import TEST_RECIPES, Bench, Look, framework
from forge.tools import CMAKE_TYPES, find_ctest
from forge.workspace import warn

if TYPE_CHECKING:
    import argparse
    from collections.abc import Iterator, Mapping, Sequence

    from forge.layout import Layout
    from forge.model import Package
    from forge.workspace import Loaded

DESK = "handover_test"
"""Where forge leaves, in a build folder, what the tests see and the line that repeats them."""

_AROUND_PYTEST = ("pytest", "pytest_cov", "pytest_repeat", "pytest_rerunfailures")


def tested_names(loaded: Loaded) -> tuple[str, ...]:
    """Return the selected packages that forge knows how to test; what it brings along is not the user's.

    Raises WorkspaceError for manifests that cannot be read and names that two packages have.
    """
    raise_if_any(loaded.workspace.problems, WorkspaceError)
    own = [name for name in loaded.selection.names if not loaded.packages[name].embedded]
    kinds = {name: loaded.packages[name].build_type for name in own}
    warn(
        Problem(f"no recipe to test '{name}', whose build type is '{kind}'")
        for name, kind in kinds.items()
        if kind not in TEST_RECIPES
    )
    return tuple(name for name, kind in kinds.items() if kind in TEST_RECIPES)


def needs_of_tests(names: Sequence[str], loaded: Loaded) -> dict[str, tuple[str, ...]]:
    """Return what each package's tests see: all that it needs, lowest first, and the package itself."""
    needs = loaded.provision.needs
    ordered = ordered_names(needs)
    position = {name: index for index, name in enumerate(ordered)}
    below = closures(needs, ordered)
    seen = {}
    for name in names:
        later = loaded.provision.postponed.get(name, frozenset())
        wanted = below[name].union(later, *(below[other] for other in later)) - {name}
        seen[name] = (*sorted(wanted, key=position.__getitem__), name)
    return seen


def absent_problems(
    needs: Mapping[str, Sequence[str]], layout: Layout, variables: Mapping[str, str]
) -> dict[str, Problem]:
    """Return the packages that cannot be tested since they, or what they need, are not installed."""
    underlays = find_underlays(variables, layout.install)
    found = {}
    for name, wanted in needs.items():
        absent = [
            need
            for need in wanted
            if not (layout.prefix(need) / PACKAGES / need).is_file()
            and (need == name or provider(need, underlays) is None)
        ]
        if absent:
            quoted = ", ".join(f"'{need}'" for need in absent)
            verb = "is" if len(absent) == 1 else "are"
            message = f"'{name}' cannot be tested: {quoted} {verb} not built"
            found[name] = Problem(message, hint=f"forge build --packages-up-to {name}")
    return found


def not_built_here(names: Sequence[str], loaded: Loaded, layout: Layout) -> tuple[Problem, ...]:
    """Return what is to be said of packages whose tests are not there, since they came from a cache."""
    here = (name for name in names if loaded.packages[name].build_type in CMAKE_TYPES)
    gone = [name for name in here if not (layout.build_dir(name) / "CMakeCache.txt").is_file()]
    if not gone:
        return ()
    who = ", ".join(f"'{name}'" for name in gone)
    message = f"no tests run of {who}: only what is installed came from the cache"
    return (Problem(message, hint=f"forge build --force --packages-select {' '.join(gone)}"),)


def unbuilt_edits(needs: Mapping[str, Sequence[str]], loaded: Loaded, layout: Layout) -> tuple[Problem, ...]:
    """Return what is to be said of packages that changed since they were built: tests use what was built.

    Tests of a Python package run in its source folder, and links lead there, too.
    """
    records = open_journal(layout.build).records
    table = FileTable(layout.build / TABLE)
    used = {
        need
        for name, wanted in needs.items()
        for need in wanted
        if not (_is_python(loaded, need) and (need == name or layout.symlink))
    }
    problems = []
    for name in sorted(used):
        record, package = records.get(name), loaded.packages.get(name)
        if package is None or package.embedded or record is None or not record.complete:
            continue
        home = str(loaded.workspace.root / package.path)
        table.news.clear()
        if mark_tree(home, table, record.sources).digest != record.sources.digest:
            what = source_changes(tuple(os.path.relpath(path, home) for path in sorted(table.news)))
            message = f"'{name}' changed since it was built, and tests use what was built: {what}"
            problems.append(Problem(message, Place(package.path), "forge build"))
    return tuple(problems)


def _is_python(loaded: Loaded, name: str) -> bool:
    package = loaded.packages.get(name)
    return package is not None and "python" in package.build_type


def prepare_bench(options: argparse.Namespace, loaded: Loaded, names: Sequence[str], layout: Layout) -> Bench:
    """Return the programs and options of the tests; raises EnvironmentFault for what is missing."""
    types = {loaded.packages[name].build_type for name in names}
    ctest = find_ctest(os.environ) if types & CMAKE_TYPES else None
    interpreter = find_interpreter(options.python or recorded_python(layout.install), os.environ)
    missing = missing_modules(interpreter, _AROUND_PYTEST) if types - CMAKE_TYPES else ()
    return Bench(
        root=loaded.workspace.root,
        layout=layout,
        python=interpreter.path,
        ctest=ctest,
        modules=frozenset(_AROUND_PYTEST) - frozenset(missing),
        results=Path(options.test_result_base).absolute() if options.test_result_base else None,
        framework=options.python_testing,
        until_fail=options.retest_until_fail,
        until_pass=options.retest_until_pass,
        coverage=options.pytest_with_coverage,
        ctest_args=_words(options.ctest_args),
        pytest_args=_words(options.pytest_args),
        unittest_args=_words(options.unittest_args),
    )


def open_test_budget(options: argparse.Namespace, variables: Mapping[str, str]) -> Budget:
    """Return a token for each package that may be tested at a time; a make above us may give them.

    Each test runs one job, as far as forge knows: what programs under test start is theirs.
    """
    flags = read_make_flags(variables.get("MAKEFLAGS", ""))
    pool = joined_pool(flags.auth) if flags.auth and not options.jobs else None
    short = partial(shortage, options.memory_limit, options.load_limit or flags.load)
    return Budget(options.jobs or flags.jobs or processors(), pool, flags=flags, short=short)


def make_test_plan(names: Sequence[str], loaded: Loaded, bench: Bench) -> BuildPlan:
    """Return a task per package; none waits for another. Raises EnvironmentFault when pytest is missing."""
    looks = {}
    for name in names:
        package = loaded.packages[name]
        looks[name] = look(package, bench.source(package), bench.layout.build_dir(name))
    raise_if_any(_without_pytest([loaded.packages[name] for name in names], bench, looks), EnvironmentFault)
    if bench.coverage and "pytest_cov" not in bench.modules:
        warn([Problem("there is no coverage: the interpreter has no pytest-cov")])
    tasks = {}
    for name in names:
        package = loaded.packages[name]
        tasks[name] = _task(package, bench.of(package), looks[name])
    return BuildPlan(tasks)


def _task(package: Package, bench: Bench, seen: Look) -> Task:
    recipe = TEST_RECIPES[package.build_type](package, bench, seen)
    return Task(
        name=package.name,
        package=package,
        prefix=bench.layout.prefix(package.name),
        build_dir=bench.layout.build_dir(package.name),
        needs=(),
        steps=recipe.steps,
        reason="it is selected",
        files=recipe.files,
        clean=recipe.clean,
        desk=DESK,
    )


def _without_pytest(
    packages: Sequence[Package], bench: Bench, looks: Mapping[str, Look]
) -> Iterator[Problem]:
    wanting = [
        package.name
        for package in packages
        if package.build_type not in CMAKE_TYPES
        and framework(package, bench.of(package), looks[package.name]) == "pytest"
    ]
    if wanting and "pytest" not in bench.modules:
        who = ", ".join(f"'{name}'" for name in wanting)
        hint = f"{bench.python} -m pip install pytest; or test with unittest: --python-testing unittest"
        yield Problem(f"'{bench.python}' has no pytest, which tests {who}", hint=hint)


def _words(given: Sequence[str]) -> tuple[str, ...]:
    """Return the arguments of a greedy option without the blanks that shield them."""
    return tuple(word.lstrip() for word in given)
