"""Prepares a test run: packages, dependencies, context and plan."""

from __future__ import annotations

import os
from functools import partial
from typing import TYPE_CHECKING

from forge.base.errors import EnvironmentFault, Location, Problem, Several, WorkspaceError, raise_if_any
from forge.base.graph import closures, ordered_names
from forge.base.layout import FILE_TABLE, TEST_SCRATCH_DIR
from forge.base.text import listed
from forge.build.build_types import build_type_of, unknown_types
from forge.build.change_texts import changed_sources
from forge.build.inputs.fingerprints import FileTable, fingerprint_tree
from forge.build.journal import open_journal
from forge.build.tasks import BuildPlan, Task
from forge.build.tests.detection import inspect_tests
from forge.build.tests.recipes import TestContext, framework
from forge.environment.install_state import recorded_python
from forge.environment.prefixes import PACKAGES, find_underlays, provider
from forge.execution.job_pool import JobPool
from forge.execution.jobserver import join_pool
from forge.execution.makeflags import read_make_flags
from forge.toolchain.interpreter import find_interpreter
from forge.toolchain.programs import CARGO_TYPES, CMAKE_TYPES, PYTHON_TYPES, find_ctest
from forge.toolchain.python_modules import install_command, missing_modules
from forge.toolchain.resources import is_overloaded, processors
from forge.toolchain.untested import was_built_without_tests

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from forge.base.errors import WarningReporter
    from forge.base.layout import Layout
    from forge.build.tests.options import TestOptions
    from forge.execution.options import JobOptions
    from forge.workspace.load import LoadedWorkspace
    from forge.workspace.model import Package

_TEST_MODULES = ("pytest", "pytest_cov", "pytest_repeat", "pytest_rerunfailures", "coverage")


def tested_names(loaded: LoadedWorkspace, warn: WarningReporter) -> tuple[str, ...]:
    """Return the selected packages with a supported build type, except embedded ones; warn about others.

    Raises WorkspaceError for invalid manifests and duplicate names.
    """
    raise_if_any(loaded.workspace.problems, WorkspaceError)
    own = [name for name in loaded.selection.names if not loaded.packages[name].embedded]
    kinds = {name: loaded.packages[name].build_type for name in own}
    unknown = unknown_types(loaded.packages[name] for name in own)
    warn(
        Problem(
            f"cannot test '{name}': unsupported build type '{kind}'",
            several=Several(f"cannot test {{}}: unsupported build type '{kind}'", name),
        )
        for name, kind in kinds.items()
        if name in unknown
    )
    return tuple(name for name in own if name not in unknown)


def needs_of_tests(names: Sequence[str], loaded: LoadedWorkspace) -> dict[str, tuple[str, ...]]:
    """Return the packages in the environment of each package's tests, lowest first, itself included."""
    needs = loaded.resolution.needs
    ordered = ordered_names(needs)
    position = {name: index for index, name in enumerate(ordered)}
    below = closures(needs, ordered)
    seen = {}
    for name in names:
        later = loaded.resolution.postponed.get(name, frozenset())
        wanted = below[name].union(later, *(below[other] for other in later)) - {name}
        seen[name] = (*sorted(wanted, key=position.__getitem__), name)
    return seen


def absent_problems(
    needs: Mapping[str, Sequence[str]], layout: Layout, variables: Mapping[str, str]
) -> dict[str, Problem]:
    """Return problems for packages that are not installed, or whose dependencies are not."""
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
            absent = [name] if name in absent else absent
            quoted = ", ".join(f"'{need}'" for need in absent)
            verb = "is" if len(absent) == 1 else "are"
            message = f"'{name}' cannot be tested: {quoted} {verb} not built"
            found[name] = Problem(message, hint=f"forge build --packages-up-to {name}")
    return found


def require_any_built(names: Sequence[str], absent: Mapping[str, Problem]) -> None:
    """Raise WorkspaceError if no package can be tested, with one problem if there are several."""
    if not absent or len(absent) < len(names):
        return
    if len(absent) == 1:
        raise WorkspaceError(*absent.values())
    message = f"no package can be tested: {listed(tuple(absent))} or their dependencies are not built"
    hint = "run 'forge build' first, with the same options to select packages"
    raise WorkspaceError(Problem(message, hint=hint))


def built_without_tests(names: Sequence[str], loaded: LoadedWorkspace, layout: Layout) -> tuple[Problem, ...]:
    """Return a warning for the packages that were built without tests."""
    here = (name for name in names if loaded.packages[name].build_type in CMAKE_TYPES)
    without = [name for name in here if was_built_without_tests(layout.build_dir(name))]
    if not without:
        return ()
    message = f"{listed(without)} {'was' if len(without) == 1 else 'were'} built without tests"
    hint = "build without -DBUILD_TESTING=OFF and '--no-test-dependencies' to test"
    return (Problem(message, hint=f"{hint} {'it' if len(without) == 1 else 'them'}"),)


def changed_since_build(
    needs: Mapping[str, Sequence[str]], loaded: LoadedWorkspace, layout: Layout
) -> tuple[Problem, ...]:
    """Return warnings for packages that changed since their last build, which the tests use.

    Python tests run in the source folder, and symbolic links lead there, too.
    """
    records = open_journal(layout.build).records
    table = FileTable(layout.build / FILE_TABLE)
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
        if fingerprint_tree(home, table, record.sources).digest != record.sources.digest:
            what = changed_sources(home, layout.build_dir(name), record, table)
            message = f"'{name}' has changed since its last build, so that tests use outdated files: {what}"
            many = "{} have changed since their last build, so that tests use outdated files"
            kind = Several(many, name, "forge build")
            problems.append(Problem(message, Location(package.path), "forge build", kind))
    return tuple(problems)


def _is_python(loaded: LoadedWorkspace, name: str) -> bool:
    package = loaded.packages.get(name)
    return package is not None and "python" in package.build_type


def prepare_context(
    options: TestOptions,
    loaded: LoadedWorkspace,
    names: Sequence[str],
    layout: Layout,
    variables: Mapping[str, str],
) -> TestContext:
    """Return the programs and options of the tests; raises EnvironmentFault for missing programs."""
    rust = next((name for name in names if loaded.packages[name].build_type in CARGO_TYPES), None)
    if rust is not None:
        from forge.toolchain.rust import require_cargo  # noqa: PLC0415  (few workspaces have Rust)

        require_cargo(loaded.packages[rust], variables)
    types = {loaded.packages[name].build_type for name in names}
    ctest = find_ctest(os.environ) if types & CMAKE_TYPES else None
    recorded, chain = recorded_python(layout.install), find_underlays(variables, layout.install).chain
    interpreter = find_interpreter(options.python, variables, chain, recorded)
    missing = missing_modules(interpreter.path, _TEST_MODULES) if types & PYTHON_TYPES else ()
    return TestContext(
        root=loaded.workspace.root,
        layout=layout,
        python=interpreter.path,
        ctest=ctest,
        modules=frozenset(_TEST_MODULES) - frozenset(missing),
        options=options,
    )


def open_test_job_pool(options: JobOptions, variables: Mapping[str, str]) -> JobPool:
    """Return the job pool with one job per package under test; a parent make may provide it."""
    flags = read_make_flags(variables.get("MAKEFLAGS", ""))
    pool = join_pool(flags.auth) if flags.auth and not options.jobs else None
    short = partial(is_overloaded, options.memory_limit, options.load_limit or flags.load)
    return JobPool(options.jobs or flags.jobs or processors(), pool, flags=flags, is_overloaded=short)


def make_test_plan(
    names: Sequence[str], loaded: LoadedWorkspace, context: TestContext, warn: WarningReporter
) -> BuildPlan:
    """Return a task per package, without dependencies. Raises EnvironmentFault if pytest is missing."""
    packages = [loaded.packages[name] for name in names]
    raise_if_any(_without_pytest(packages, context), EnvironmentFault)
    if context.options.pytest_with_coverage and "pytest_cov" not in context.modules:
        warn([Problem("coverage is not measured: the interpreter has no pytest-cov")])
    return BuildPlan({package.name: _task(package, context.of(package)) for package in packages})


def _task(package: Package, context: TestContext) -> Task:
    recipe = build_type_of(package).tests(package, context)
    return Task(
        name=package.name,
        package=package,
        prefix=context.layout.prefix(package.name),
        build_dir=context.layout.build_dir(package.name),
        needs=(),
        steps=recipe.steps,
        reason="it is selected",
        files=recipe.files,
        clean=recipe.clean,
        scratch_dir=TEST_SCRATCH_DIR,
    )


def _without_pytest(packages: Sequence[Package], context: TestContext) -> Iterator[Problem]:
    wanting = [
        package.name
        for package in packages
        if package.build_type in PYTHON_TYPES and _framework(package, context) == "pytest"
    ]
    if wanting and "pytest" not in context.modules:
        packages_text = ", ".join(f"'{name}'" for name in wanting)
        command = install_command(context.python, ("pytest",))
        hint = f"{command}; or test with unittest: --python-testing unittest"
        yield Problem(f"'{context.python}' has no pytest, which is required by {packages_text}", hint=hint)


def _framework(package: Package, context: TestContext) -> str:
    tests = inspect_tests(package, context.source(package), context.layout.build_dir(package.name))
    return framework(package, context.of(package), tests)
