"""The stages of a build before its plan runs: environment, packages, checks, tools, and the plan itself."""

from __future__ import annotations

import os
import shlex
import sys
import time
from contextlib import AbstractContextManager, nullcontext, suppress
from dataclasses import replace
from functools import cache, partial
from itertools import islice
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

from forge import __version__
from forge.base.ament_index import INDEX
from forge.base.distributions import VARIABLE, distribution_in
from forge.base.env_vars import expand_home
from forge.base.errors import (
    ForgeError,
    GroupedProblems,
    Location,
    Problem,
    WarningReporter,
    WorkspaceError,
    raise_if_any,
)
from forge.base.extensions import OPTIONS, RECIPES, UNDERLAYS, find, installed, own_plugin
from forge.base.files import current_umask, names_in
from forge.base.frozen import Pairs, frozen
from forge.base.graph import closure
from forge.base.layout import NO_CODE, PACKAGE, PACKAGE_LOCK, Layout, own_folders
from forge.build import folder_marks, planning
from forge.build.build_types import leave_out, with_toolchains
from forge.build.inputs.fingerprints import digest_strings, source_files, stamp_files
from forge.build.journal import open_journal
from forge.build.model import BuildInputs, Fingerprint, Snapshot
from forge.build.recipes.cmake import FLAGS, unfit_generator
from forge.build.recipes.context import BuildContext
from forge.build.snapshot import take_snapshot
from forge.engine.variables import relevant_environment
from forge.environment import install_state
from forge.environment.prefixes import PACKAGES, find_underlays, spellings, tidy_prefixes
from forge.execution.makeflags import read_make_flags
from forge.toolchain.cmake_variables import OLDEST_POLICY, builds_tests, unset_definitions
from forge.toolchain.compiler_launchers import selected_launcher
from forge.toolchain.interpreter import Interpreter, find_interpreter, lacks_modules, own_command
from forge.toolchain.programs import condensed, find_tools, identities
from forge.workspace.discovery import ROS_DEFAULTS, special_files
from forge.workspace.load import LoadedWorkspace, find_packages, load_workspace
from forge.workspace.model import CMAKE_TYPES, PYTHON_TYPES
from forge.workspace.resolve import INTERFACE_GROUP

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from forge.build.state import BuildState
    from forge.build.tasks import BuildPlan
    from forge.cli.build_options import BuildOptions
    from forge.output.console import ConsoleReporter
    from forge.toolchain.targets import CrossBuild
    from forge.workspace.model import Package, Workspace
    from forge.workspace.selection import SearchPaths


_MANY_WHEELS = 4
"""Starting the worker takes as long as it saves with three Python packages."""


class BuildMode:
    """Reports the result of a single build, like colcon; `WatchLoop` overrides the methods."""

    quiet = False
    """Whether to omit progress messages; failures and stderr output of packages are printed in any case."""
    silent_if_up_to_date = False
    """Whether to print nothing if all packages are up to date."""

    def __init__(self) -> None:
        self.warn = WarningReporter()

    def worker(
        self, plan: BuildPlan, library: Path | None, *, has_rosidl: bool
    ) -> AbstractContextManager[dict[str, str]]:
        """Return a context that yields the variables for the worker of short commands, observed by `library`.

        With `has_rosidl`, the generators of a distribution compile the interfaces.
        """
        packages = [task.package for task in plan.tasks.values()]
        compiles = not has_rosidl and any(INTERFACE_GROUP in each.manifest.groups for each in packages)
        installs = _has_many_wheels(packages)
        if not (compiles or installs):
            return nullcontext({})
        from forge.cli.worker import INTERFACE_MODULES, WHEEL_MODULES, worker

        return worker(*INTERFACE_MODULES * compiles, *WHEEL_MODULES * installs, library=library)

    def conclude(self, _plan: BuildPlan, report: ConsoleReporter, seconds: float) -> None:
        report.summarise(seconds)


@frozen
class PreparedBuild:
    options: BuildOptions
    loaded: LoadedWorkspace
    names: tuple[str, ...]
    """The packages to build, in topological order."""
    context: BuildContext
    interpreter: Interpreter
    variables: Mapping[str, str]
    mode: BuildMode
    cross: CrossBuild | None
    began: float
    """The monotonic start time."""

    @property
    def compilers(self) -> Pairs:
        """The inputs of every compilation: programs by their identities, and variables."""
        return (*self.context.tools, *relevant_environment(self.variables))


def _with_packages_of_underlays(
    loaded: LoadedWorkspace,
    names: Sequence[str],
    layout: Layout,
    variables: Mapping[str, str],
    warn: WarningReporter,
) -> LoadedWorkspace:
    """Return the workspace without dependencies on unbuilt packages that are in an underlay.

    As in colcon, `names` are built with the packages of the underlay if those of the workspace are not built.
    """
    resolution = loaded.resolution
    others = closure(resolution.needs, names) - frozenset(names)
    prefixes = find_underlays(variables, layout.install).prefixes if others else ()
    substitutes = {
        name: prefix
        for name in sorted(others)
        if not (layout.prefix(name) / "share" / name / "package.sh").is_file()
        for prefix in prefixes[::-1]
        if any((prefix / index / name).is_file() for index in (PACKAGES, INDEX / "packages"))
    }
    if not substitutes:
        return loaded
    warn(
        Problem(
            f"'{name}' of the workspace is not built yet; using the one in '{prefix}'",
            hint=f"build it too (--packages-up-to), or ignore it: --packages-ignore {' '.join(substitutes)}",
            group=GroupedProblems(
                "{} of the workspace are not built yet; using those of the underlays", name
            ),
        )
        for name, prefix in substitutes.items()
    )
    needs = {name: below.difference(substitutes) for name, below in resolution.needs.items()}
    return replace(loaded, resolution=replace(resolution, needs=needs))


def prepare(options: BuildOptions, layout: Layout, mode: BuildMode) -> PreparedBuild:
    """Load and select the packages, find the tools, and collect the options shared by all packages.

    Raises WorkspaceError with all problems that prevent the build, HostError for missing tools.
    """
    began = time.monotonic()
    cmake, query = options.cmake, options.query
    if options.reset_underlays and not options.dry_run and folder_marks.is_own_install_base(layout.install):
        install_state.forget_underlays(layout.install)
    outside = without_own(os.environ, layout)
    locked: tuple[Path, ...] = ()
    if os.path.lexists(PACKAGE_LOCK) and not options.dry_run:
        # Build missing packages of the underlay that the lock of the workspace names.
        build = find(UNDERLAYS, PACKAGE_LOCK, "file", ("build",)).build
        locked = build(Path.cwd(), find_underlays(outside, layout.install).chain, outside, options)
    variables = build_variables(layout, os.environ, options.rosdistro, locked)
    about_surroundings = own_plugin(OPTIONS, "advice-surroundings")
    if about_surroundings:
        overlays = find_underlays(os.environ, layout.install).overlays
        underlays = replace(find_underlays(variables, layout.install), overlays=overlays)
        mode.warn(about_surroundings.about_underlays(layout.install, outside, underlays, variables[VARIABLE]))
    is_tested = partial(builds_tests, cmake_args=cmake.cmake_args, ament_cmake_args=cmake.ament_cmake_args)
    loaded = load_workspace(
        Path.cwd(), query, variables, embedded=True, install=layout.install, tested=is_tested
    )
    mode.warn(loaded.warnings)
    names = planning.names_to_build(loaded.selection, loaded.resolution)
    requested = frozenset(names) if query.strict else query.named
    names, unsupported = leave_out(names, loaded.packages, loaded.resolution.needs, requested)
    mode.warn(unsupported)
    problems = list(loaded.workspace.problems)
    if not (problems or loaded.workspace.packages or os.path.lexists(PACKAGE_LOCK)):
        raise_if_any(output_problems(loaded, layout, ()), WorkspaceError)
        require_packages(loaded)
    python = any("python" in loaded.packages[name].build_type for name in names)
    problems += folder_marks.path_problems(
        (loaded.workspace.root, layout.build, layout.install), python=python
    )
    bases = {"--test-result-base": options.test_result_base, "--cache": options.cache.cache}
    problems += output_problems(loaded, layout, names, bases)
    raise_if_any(problems, WorkspaceError)
    loaded = _with_packages_of_underlays(loaded, names, layout, variables, mode.warn)
    target, cross = options.folders.target, None
    if target:
        cross = target.prepare(layout, variables, options.cross)
        variables = {**variables, **cross.variables}
    packages = [loaded.packages[name] for name in names]
    cmake_args = (*cmake.cmake_args, *cmake.ament_cmake_args)
    if advice := own_plugin(OPTIONS, "advice-cmake-arguments"):
        mode.warn(advice.suspicious_arguments(cmake_args))
        mode.warn(advice.tested_anyway(packages, is_tested) if query.no_test_dependencies else ())
        for package in packages:
            words = (*package.option_values("cmake-args"), *package.option_values("ament-cmake-args"))
            suspicious = advice.suspicious_arguments(words)
            mode.warn(replace(each, location=Location(package.path)) for each in suspicious)
    if any(package.build_type in CMAKE_TYPES for package in packages):
        raise_if_any(unset_definitions(cmake_args))
    launcher = selected_launcher(cmake.compiler_launcher)
    tools = find_tools(packages, variables, launcher, has_compiler=cross is not None, cmake_args=cmake_args)
    chain = find_underlays(variables, layout.install).chain
    interpreter = find_interpreter(options.python, variables, chain, root=loaded.workspace.root)
    if about_surroundings:
        mode.warn(
            about_surroundings.other_interpreter(install_state.recorded_python(layout.install), interpreter)
        )
    if cross and cross.python_version:
        interpreter = replace(interpreter, version=cross.python_version)
    shared_args = (*(cross.cmake_args if cross else ()), *cmake.cmake_args)
    through_worker = (sys.executable, "-S", "-E", str(PACKAGE / "execution/worker_client.py"))
    own_recipes = () if cmake.no_fast_rosidl else installed(RECIPES)
    # Without a worker, its client would only start forge in a second step.
    warm = through_worker if options.is_rebuild or _has_many_wheels(packages) else own_command()
    # Caches need results that are independent of the workspace's path. Compilers use the last matching map:
    # the root, which usually contains the others, comes first.
    folders = ((loaded.workspace.root, "."), (layout.build, "./build"), (layout.install, "./install"))
    maps = " ".join(shlex.quote(f"-ffile-prefix-map={folder}={name}") for folder, name in folders)
    path_maps = tuple((language, maps) for language in FLAGS)
    context = BuildContext(
        root=loaded.workspace.root,
        layout=layout,
        python=interpreter.path,
        site_packages=interpreter.site_packages,
        rosdistro=distribution_in(variables),
        wheels=(*warm, "-m", "forge.cli.install_wheel"),
        generator=through_worker,
        tools=identities(tools, interpreter.path, variables, cross.programs if cross else ()),
        cmake=tools.cmake if tools else None,
        ninja=tools.ninja if tools else None,
        make=tools.make if tools else None,
        only_make=tools.only_make if tools else frozenset(),
        umask=current_umask(),
        load_limit=options.jobs.load_limit or read_make_flags(variables.get("MAKEFLAGS", "")).load,
        cmake_args=shared_args,
        ament_cmake_args=cmake.ament_cmake_args,
        launcher=tools.launcher if tools else None,
        recipes=(*own_recipes, *cmake.recipes),
        embedded=frozenset(name for name, each in loaded.resolution.packages.items() if each.embedded),
        test_results=Path(options.test_result_base).absolute() if options.test_result_base else None,
        force_configure=cmake.cmake_force_configure,
        clean_cache=cmake.cmake_clean_cache,
        clean_first=cmake.cmake_clean_first,
        target=cmake.cmake_target,
        skip_target=cmake.cmake_target_skip_unavailable,
        environment_generator=variables.get("CMAKE_GENERATOR"),
        path_maps=path_maps if options.cache.wanted else (),
        cargo_args=options.cargo_args,
        no_test_dependencies=query.no_test_dependencies,
        flags=tuple((language, variables.get(variable, "")) for language, variable in FLAGS.items()),
    )
    context = with_toolchains(context, packages, variables)
    if options.audit:
        find(OPTIONS, "audit", "option").require_observer(layout, variables)
    return PreparedBuild(options, loaded, names, context, interpreter, variables, mode, cross, began)


def _has_many_wheels(packages: Iterable[Package]) -> bool:
    """Return whether there are enough Python packages for a worker that installs them."""
    return sum(package.build_type in PYTHON_TYPES for package in packages) >= _MANY_WHEELS


def make_plan(build: PreparedBuild, state: BuildState) -> tuple[BuildPlan, Snapshot]:
    """Compare all inputs with the journal, and record the packages that are up to date."""
    loaded, context, variables = build.loaded, build.context, build.variables
    snapshot = take_snapshot(
        context.root, loaded.packages.values(), context.layout, state.journal, state.table
    )
    # Names of packages are cheap to compare, unlike their contents.
    words: list[str] = []
    for prefix in find_underlays(variables, context.layout.install).prefixes:
        for folder in ("share", "lib/cmake"):
            if names := names_in(prefix / folder):
                words += (f"{prefix}/{folder}", *names)
    shared = BuildInputs(
        forge=forge_stamp(),
        tools=condensed(context.tools),
        environment=tuple((name, digest_strings(value)) for name, value in relevant_environment(variables)),
        underlays=digest_strings(*words) if words else "",
    )
    forced = dict.fromkeys(loaded.selection.names, build.options.forced_by)
    plan, hashes = planning.make_plan(build.names, loaded.resolution, snapshot, context, shared, forced)
    # Up-to-date packages whose files another package will overwrite are installed again after it.
    while reinstalled := state.merged_prefix.packages_to_reinstall(plan):
        changes = dict.fromkeys(reinstalled, "a package to be built overwrites one of its files")
        snapshot = replace(
            snapshot,
            installed={**snapshot.installed, **dict.fromkeys(reinstalled, Fingerprint())},
            installed_changes={**snapshot.installed_changes, **changes},
        )
        plan, hashes = planning.make_plan(build.names, loaded.resolution, snapshot, context, shared, forced)
    plan = state.merged_prefix.in_order(plan)
    state.confirm_up_to_date(plan, snapshot, hashes)
    return plan, snapshot


def check_plan(plan: BuildPlan, build: PreparedBuild) -> None:
    """Raise WorkspaceError for problems of the plan that would make tasks fail or hang; print warnings."""
    context, warn = build.context, build.mode.warn
    errors: tuple[Problem, ...] = ()
    if advice := own_plugin(OPTIONS, "advice-preflight"):
        packages, site = build.loaded.resolution.packages, context.site_packages
        errors, warnings = advice.variable_length_problems(
            plan, packages, context.layout, site, build.variables
        )
        warn(warnings)
    own = [task.package for task in plan.tasks.values() if not task.embedded]
    generators = (unfit_generator(each, context) for each in own if each.build_type in CMAKE_TYPES)
    raise_if_any((*islice(filter(None, generators), 1), *errors), WorkspaceError)
    opened_files: list[Problem] = []
    others: list[Problem] = []
    for package in own:
        names = _OPENED_OF_PYTHON if package.build_type in PYTHON_TYPES else ("CMakeLists.txt",)
        opened = {package.path / name for name in names}
        for problem in special_files(context.root, package.path):
            is_opened = problem.location is not None and problem.location.path in opened
            (opened_files if is_opened else others).append(problem)
    raise_if_any(opened_files, WorkspaceError)
    hint = "a program that opens it would wait or read without end"
    warn(replace(problem, hint=hint) for problem in others)
    if plan.tasks:
        from forge.build.prefix import blocking_paths
        from forge.toolchain.python_modules import require_modules

        if any(INTERFACE_GROUP in task.package.manifest.groups for task in plan.tasks.values()):
            require_modules(context.python, ("numpy",))
        # CMake installs a file into an existing folder of the same name.
        blocking = (path for task in plan.tasks.values() for path in blocking_paths(task, context.layout))
        raise_if_any(blocking, WorkspaceError)


_OPENED_OF_PYTHON = ("setup.py", "setup.cfg", "pyproject.toml")


def build_variables(
    layout: Layout,
    surroundings: Mapping[str, str],
    rosdistro: str | None = None,
    locked: Sequence[Path] = (),
) -> dict[str, str]:
    """Return the environment of a build: the caller's environment, ROS defaults and the recorded underlays.

    Entries of this workspace are removed: sourcing it before a build makes no difference. Underlays of
    an earlier build are used even if they are not sourced in this shell, and so are those `locked`. The ROS
    distribution is `rosdistro`, else that of the environment, of an underlay, or of an earlier build.
    """
    own = tidy_prefixes(without_own(surroundings, layout))
    sourced = find_underlays(own, layout.install).chain
    recorded = tuple(dict.fromkeys((*install_state.recorded_underlays(layout.install), *locked)))
    distribution = (
        rosdistro or own.get(VARIABLE) or _recorded_rosdistro((*recorded, *sourced), layout.install)
    )
    defaults = {**ROS_DEFAULTS, "COLCON": "1", "CMAKE_POLICY_VERSION_MINIMUM": OLDEST_POLICY}
    variables = {**defaults, **own, **({VARIABLE: distribution} if distribution else {})}
    real = {root.resolve() for root in sourced}
    forgotten = [root for root in recorded if root.resolve() not in real and root.is_dir()]
    incomplete = [root for root in sourced if lacks_modules(root, variables)]
    if not (forgotten or incomplete):
        return variables
    from forge.environment.sourcing import workspace_environment

    sourced_variables = workspace_environment([*incomplete, *forgotten], variables)
    return {**sourced_variables, VARIABLE: rosdistro} if rosdistro else sourced_variables


def without_own(variables: Mapping[str, str], layout: Layout) -> dict[str, str]:
    """Return the variables without path entries below install folders and overlays of this workspace."""
    install = layout.of_host.install
    sourced = find_underlays(variables, install)
    states = {root: install_state.recorded_state(root) for root in sourced.chain}
    profiles = (
        root
        for root, state in states.items()
        if (layout.profile or state.profile) and (root / state.root).resolve() == layout.root.resolve()
    )
    own = (install, *sourced.overlays, *profiles)
    roots = [path for root in own for path in spellings(root, variables)]
    below = tuple(f"{path}/" for path in roots)
    cleaned = dict(variables)
    for name, value in variables.items():
        if any(path in value for path in roots):
            entries = value.split(os.pathsep)
            remaining = [entry for entry in entries if not f"{entry}/".startswith(below)]
            if remaining:
                cleaned[name] = os.pathsep.join(remaining)
            else:
                del cleaned[name]
    return cleaned


def require_packages(loaded: LoadedWorkspace) -> None:
    """Raise WorkspaceError if there are no packages at all, for example outside of a workspace."""
    if not loaded.workspace.packages:
        hint = "change to the root of the workspace, or create a package: forge pkg create my_package"
        advice, ignoring = own_plugin(OPTIONS, "missing-packages"), own_plugin(OPTIONS, "ignored-packages")
        if advice and (empty := advice.unchecked_submodules(loaded.workspace.root)):
            hint = advice.submodule_remedy(empty)
        elif ignoring and any(ignoring.ignored_packages(loaded.workspace.root, (os.curdir,), os.environ)):
            hint = "packages are ignored; 'forge ignore' lists them, each with the file that hides it"
        problem = Problem(f"no packages found below '{loaded.workspace.root}'", hint=hint)
        raise WorkspaceError(problem)


def workspace_interpreter(python: str | None, layout: Layout, root: Path) -> Interpreter:
    """Return `python` if given, else the interpreter of the last build, else that of the next build."""
    variables = build_variables(layout, os.environ)
    recorded = install_state.recorded_python(layout.install)
    if not (python or recorded):
        from forge.cli.config import configured_word

        python = configured_word("python", root, variables)
    chain = find_underlays(variables, layout.install).chain
    return find_interpreter(python, variables, chain, recorded, root)


def known_rosdistro(rosdistro: str | None, root: Path, install: Path) -> str | None:
    """Return `rosdistro` if given, else the one that a build would use; None if it is unknown."""
    if rosdistro or (rosdistro := os.environ.get(VARIABLE)):
        return rosdistro
    from forge.cli.config import configured_word

    if configured := configured_word("rosdistro", root, os.environ):
        return configured
    underlays = (*install_state.recorded_underlays(install), *find_underlays(os.environ, install).chain)
    return _recorded_rosdistro(underlays, install)


def _recorded_rosdistro(underlays: Sequence[Path], install: Path) -> str | None:
    """Return the distribution of the highest underlay that recorded one, else that of the last build."""
    roots = (*reversed(underlays), install)
    return next(filter(None, (install_state.recorded_state(root).rosdistro for root in roots)), None)


def output_problems(
    loaded: LoadedWorkspace,
    layout: Layout,
    names: Iterable[str],
    others: Mapping[str, str | Path | None] = MappingProxyType({}),
    *,
    prefixes: bool = True,
) -> Iterator[Problem]:
    """Yield a problem for each output folder that forge did not create, or that contains foreign files.

    `names` are the packages with folders below the bases, `others` further output folders by option.
    """
    workspace = loaded.workspace
    sources = _sources(workspace.root, workspace)
    others = {**others, "FORGE_CACHE_DIR": os.environ.get("FORGE_CACHE_DIR")}
    folders = {option: expand_home(str(value)) for option, value in others.items() if value}
    bases = folder_marks.bases_of(layout) | {
        option: workspace.root / path for option, path in folders.items()
    }
    yield from folder_marks.base_problems(bases, sources, thorough=not workspace.packages)
    yield from folder_marks.occupied_bases(layout)
    yield from folder_marks.nesting_problems(layout, workspace.packages)
    records = cache(lambda: open_journal(layout.build).records)
    yield from folder_marks.folder_problems(names, layout, sources, records, prefixes=prefixes)


def check_bases(root: Path, search: SearchPaths, bases: Mapping[str, Path]) -> None:
    """Raise WorkspaceError for bases, by option, that are, contain or lie in sources."""
    sources = folder_marks.SourceFolders(root, ())
    with suppress(ForgeError):  # reported where packages are selected
        sources = _sources(root, find_packages(root, search, os.environ))
    raise_if_any(folder_marks.base_problems(bases, sources), WorkspaceError)


def _sources(root: Path, workspace: Workspace) -> folder_marks.SourceFolders:
    sources = (root / package.path for package in workspace.all_packages)
    return folder_marks.SourceFolders(root, sources)


def forge_stamp() -> str:
    """Return an identification of this forge: its version, the stats of its code, its Python and folder."""
    files = [path for folder in own_folders() for path in source_files(str(folder), NO_CODE)]
    python = ".".join(map(str, sys.version_info[:3]))
    return "\n".join((__version__, stamp_files(files), python, str(PACKAGE)))
