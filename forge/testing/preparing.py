"""Prepares a test run: packages, dependencies, context and plan."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path

from forge.base.errors import (
    GroupedProblems,
    HostError,
    Problem,
    WarningReporter,
    WorkspaceError,
    raise_if_any,
)
from forge.base.files import text_or_nothing
from forge.base.graph import closures, ordered_names
from forge.base.layout import BUILD_RESULT, PACKAGE_LOCK, TEST_SCRATCH_DIR, Layout
from forge.base.text import listed, quoted_names
from forge.build.build_dir import read_deferred, tests_need_build
from forge.build.build_types import build_type_of, by_toolchain, unknown_types
from forge.build.journal import open_journal
from forge.build.tasks import BuildPlan, Task
from forge.build.tests.options import TestOptions
from forge.build.tests.recipes import TestContext, framework, requirements_of_tests
from forge.environment.install_state import recorded_python
from forge.environment.prefixes import PACKAGES, find_underlays, provider
from forge.toolchain.cmake_variables import was_built_without_tests
from forge.toolchain.interpreter import find_interpreter
from forge.toolchain.programs import find_ctest
from forge.toolchain.python_modules import install_command, missing_modules
from forge.toolchain.targets import find_target
from forge.workspace.cmake_text import compiled_packages
from forge.workspace.load import LoadedWorkspace
from forge.workspace.model import CMAKE_TYPES, PYTHON_TYPES, TEST_KINDS, Package

_TEST_MODULES = ("pytest", "pytest_cov", "pytest_repeat")


def tested_names(loaded: LoadedWorkspace, warn: WarningReporter) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the selected packages, and, with a warning, those whose build type is not supported.

    Raises WorkspaceError for invalid manifests and duplicate names.
    """
    raise_if_any(loaded.workspace.problems, WorkspaceError)
    own = [name for name in loaded.selection.names if not loaded.packages[name].embedded]
    kinds = {name: loaded.packages[name].build_type for name in own}
    unknown = unknown_types(loaded.packages[name] for name in own)
    warn(
        Problem(
            f"cannot test '{name}': unsupported build type '{kind}'",
            group=GroupedProblems(f"cannot test {{}}: unsupported build type '{kind}'", name),
        )
        for name, kind in kinds.items()
        if name in unknown
    )
    supported = tuple(name for name in own if name not in unknown)
    return supported, tuple(name for name in own if name in unknown)


def needs_of_tests(names: Sequence[str], loaded: LoadedWorkspace) -> dict[str, tuple[str, ...]]:
    """Return the packages in the environment of each package's tests, lowest first, itself included."""
    needs = loaded.resolution.needs
    ordered = ordered_names(needs)
    position = {name: index for index, name in enumerate(ordered)}
    below = closures(needs, ordered)
    seen = {}
    for name in names:
        later = loaded.resolution.postponed.get(name, frozenset())
        wanted = frozenset(below[name]).union(later, *(below[other] for other in later)) - {name}
        seen[name] = (*sorted(wanted, key=position.__getitem__), name)
    return seen


def absent_problems(
    needs: Mapping[str, Sequence[str]], layout: Layout, variables: Mapping[str, str]
) -> dict[str, Problem]:
    """Return problems of packages that are not installed, or miss dependencies; WorkspaceError if all do."""
    underlays = find_underlays(variables, layout.install)
    problems = {}
    for name, wanted in needs.items():
        absent = [
            need
            for need in wanted
            if not (layout.prefix(need) / PACKAGES / need).is_file()
            and (need == name or provider(need, underlays) is None)
        ]
        if absent:
            absent = [name] if name in absent else absent
            verb = "is" if len(absent) == 1 else "are"
            message = f"'{name}' cannot be tested: {quoted_names(absent)} {verb} not built"
            problems[name] = Problem(message, hint=layout.command(f"build --packages-up-to {name}"))
    if problems and len(problems) == len(needs):
        if len(problems) == 1:
            raise WorkspaceError(*problems.values())
        message = f"no package can be tested: {listed(tuple(problems))} or their dependencies are not built"
        hint = f"run '{layout.command('build')}' first, with the same options to select packages"
        raise WorkspaceError(Problem(message, hint=hint))
    return problems


def prepare_context(
    options: TestOptions,
    loaded: LoadedWorkspace,
    layout: Layout,
    variables: Mapping[str, str],
    names: Sequence[str],
) -> tuple[TestContext, dict[str, Problem]]:
    """Return the programs and options of the tests, and a problem for each package that lacks a program."""
    packages = [loaded.packages[name] for name in names]
    cmake = [package for package in packages if package.build_type in CMAKE_TYPES]
    python = [package for package in packages if package.build_type in PYTHON_TYPES]
    without_ctest = _lacking(cmake, lambda: find_ctest(os.environ))
    lacking = dict(without_ctest)
    if layout.target and not find_target(layout.target).has_emulator(layout):
        message = f"this machine cannot run the tests of programs for '{layout.target}'"
        hint = "install qemu-user, for example with `apt install qemu-user`, then build again"
        compiled = (package.name for package in compiled_packages(packages))
        lacking |= dict.fromkeys(compiled, Problem(message, hint=hint))
    recorded, chain = recorded_python(layout.install), find_underlays(variables, layout.install).chain
    interpreter = find_interpreter(options.python, variables, chain, recorded, loaded.workspace.root)
    missing = missing_modules(interpreter.path, _TEST_MODULES) if python else ()
    context = TestContext(
        root=loaded.workspace.root,
        layout=layout,
        python=interpreter.path,
        ctest=find_ctest(os.environ) if cmake and not without_ctest else None,
        modules=frozenset(_TEST_MODULES) - frozenset(missing),
        options=options,
    )
    for toolchain, of_type in by_toolchain(packages):
        lacking |= _lacking(of_type, partial(toolchain, of_type, context, variables))
    if "pytest" in missing:
        need_pytest = {
            package.name: package
            for package in python
            if framework(package, context.of(package), requirements_of_tests(context.source(package)))
            == "pytest"
        }
        message = f"'{interpreter.path}' has no pytest, which is required by {listed([*need_pytest])}"
        declared = any("python3-pytest" in each.manifest.names(TEST_KINDS) for each in need_pytest.values())
        if declared and (loaded.workspace.root / PACKAGE_LOCK).exists():
            command = "run 'forge fetch --test'"
        else:
            command = install_command(interpreter.path, ("pytest",))
        hint = f"{command}; or test with unittest: --python-testing unittest"
        lacking |= dict.fromkeys(need_pytest, Problem(message, hint=hint))
    if lacking and len(lacking) == len(names):
        raise HostError(*dict.fromkeys(lacking.values()))
    return context, lacking


def _lacking(packages: Sequence[Package], require: Callable[[], object]) -> dict[str, Problem]:
    """Return a problem for each of the packages if their requirement is missing."""
    try:
        if packages:
            require()
    except HostError as fault:
        return {package.name: fault.problems[0] for package in packages}
    return {}


def make_test_plan(
    names: Sequence[str], loaded: LoadedWorkspace, context: TestContext, warn: WarningReporter
) -> BuildPlan:
    """Return a task per package, without dependencies."""
    if context.options.pytest_with_coverage and "pytest_cov" not in context.modules:
        warn([Problem("coverage is not measured: the interpreter has no pytest-cov")])
    tasks = {}
    for name in names:
        package = loaded.packages[name]
        recipe = build_type_of(package).tests(package, context.of(package))
        tasks[name] = Task(
            name,
            package,
            context.layout.prefix(name),
            context.layout.build_dir(name),
            (),
            recipe.steps,
            "it is selected",
            files=recipe.files,
            clean=recipe.clean,
            scratch_dir=TEST_SCRATCH_DIR,
        )
    return BuildPlan(tasks)


def has_no_tests(build: Path) -> bool:
    """Return whether the last build of a CMake package excluded its tests, here or at the cache's origin."""
    deferred = read_deferred(build)
    return was_built_without_tests(build) if deferred is None or deferred.done else not deferred.steps


def not_runnable(
    names: Sequence[str], loaded: LoadedWorkspace, layout: Layout, ran: BuildPlan
) -> dict[str, Problem]:
    """Return a problem for each package whose tests are not built or outdated; `ran` tried to build them."""
    restored, problems = restored_names(names, loaded, layout), {}
    records = open_journal(layout.build).records
    for name in names:
        build, message = layout.build_dir(name), ""
        again = layout.command(f"build --packages-select {name}")
        hint = layout.command(f"build --force --packages-select {name}")
        deferred = read_deferred(build)
        if name in restored:
            if deferred is None:
                message = "its build folder is missing, and its installed files came from the cache"
            elif deferred.steps and not deferred.done:
                hint = ""
                message = "building its tests failed" if name in ran.tasks else "its tests are not built"
        elif loaded.packages[name].build_type in CMAKE_TYPES:
            cached = (build / "CMakeCache.txt").is_file()
            generated = (build / "cmake_install.cmake").is_file()
            failed = text_or_nothing(build / BUILD_RESULT).strip() not in {"", "0"}
            if (cached or failed) and not generated:
                message, hint = "CMake failed in the last build", again
            elif not cached:
                message = "its build folder is missing"
        if not message and name in records and not records[name].complete:
            # Its installed files and test programs may be from an earlier build.
            message, hint = "its last build failed or was stopped", again
        if message:
            group = GroupedProblems(
                f"{{}} cannot be tested: {message}", name, hint and layout.command("build --force")
            )
            problems[name] = Problem(f"'{name}' cannot be tested: {message}", hint=hint or None, group=group)
    return problems


def restored_names(names: Sequence[str], loaded: LoadedWorkspace, layout: Layout) -> frozenset[str]:
    """Return the packages whose installed files came from the cache, and whose tests need a build folder."""
    records = open_journal(layout.build).records
    return frozenset(
        name
        for name in names
        if tests_need_build(loaded.packages[name])
        and name in records
        and records[name].complete
        and not records[name].began
    )
