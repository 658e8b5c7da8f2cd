"""What a build takes before it can be planned: a clean environment, tools, options; and what stops it."""

from __future__ import annotations

import os
import sys
from contextlib import nullcontext
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from forge import __version__
from forge.budget import Budget
from forge.capacity import processors, shortage
from forge.digests import source_files, stamp_files
from forge.discovery import ROS_DEFAULTS
from forge.errors import Problem, WorkspaceError, raise_if_any
from forge.freshness import environment_that_counts
from forge.installation import recorded_underlays
from forge.interpreter import find_interpreter, require_modules
from forge.jobserver import common_style, joined_pool, own_pool, spoken
from forge.makeflags import read_make_flags
from forge.planning import Standing
from forge.prefixes import find_underlays
from forge.provision import missing_problems
from forge.recipes.cmake import common_arguments
from forge.recipes.kitchen import Kitchen
from forge.sourcing import workspace_environment
from forge.toolchain import Toolchain
from forge.tools import CMAKE_TYPES, find_tools, identities
from forge.workspace import warn

if TYPE_CHECKING:
    import argparse
    from collections.abc import Mapping, Sequence
    from contextlib import AbstractContextManager

    from forge.interpreter import Interpreter
    from forge.layout import Layout
    from forge.model import BuildPlan
    from forge.workspace import Loaded

INTERFACE_GROUP = "rosidl_interface_packages"


def build_variables(layout: Layout, surroundings: Mapping[str, str]) -> dict[str, str]:
    """Return the environment of a build: the surroundings, ROS defaults, and the recorded underlays.

    Whoever sourced this workspace before building it gets the same build as who did not: its own
    entries are left out. An underlay of an earlier build counts though this shell has not sourced it.
    """
    variables = {**ROS_DEFAULTS, "COLCON": "1", **without_own(surroundings, layout.install)}
    sourced = find_underlays(variables, layout.install).chain
    forgotten = [root for root in recorded_underlays(layout.install) if root not in sourced]
    return workspace_environment([root for root in forgotten if root.is_dir()], variables)


def without_own(variables: Mapping[str, str], install: Path) -> dict[str, str]:
    """Return the variables without path entries below `install`, and without those left empty by that."""
    own = str(install)
    cleaned = dict(variables)
    for name, value in variables.items():
        if own in value:
            entries = value.split(os.pathsep)
            kept = [entry for entry in entries if entry != own and not entry.startswith(own + os.sep)]
            if kept:
                cleaned[name] = os.pathsep.join(kept)
            else:
                del cleaned[name]
    return cleaned


def refuse_what_cannot_work(loaded: Loaded, names: Sequence[str]) -> None:
    """Raise WorkspaceError with everything that would make the build fail anyway."""
    errors, warnings = missing_problems(loaded.provision, names)
    problems = [*loaded.workspace.problems, *errors]
    if not loaded.workspace.packages and not problems:
        hint = "go to the folder that has 'src' in it, or make a package: forge pkg create my_package"
        problems.append(Problem(f"there is no package below '{loaded.workspace.root}'", hint=hint))
    warn(warnings)
    raise_if_any(problems, WorkspaceError)


def prepare(
    options: argparse.Namespace,
    loaded: Loaded,
    names: Sequence[str],
    layout: Layout,
    variables: Mapping[str, str],
) -> tuple[Kitchen, Interpreter]:
    """Return the tools and options that all packages share; raises EnvironmentFault for what is missing."""
    packages = [loaded.packages[name] for name in names]
    tools = find_tools(packages, variables)
    interpreter = find_interpreter(options.python, variables)
    if any(INTERFACE_GROUP in package.manifest.groups for package in packages):
        require_modules(interpreter, ("numpy",))
    kitchen = Kitchen(
        root=loaded.workspace.root,
        layout=layout,
        python=interpreter.path,
        site_packages=interpreter.site_packages,
        forge=(sys.executable, "-m", "forge"),
        generator=(sys.executable, "-S", "-E", str(Path(__file__).with_name("worker_client.py"))),
        tools=identities(tools, interpreter.path, variables),
        cmake=tools.cmake if tools else None,
        ninja=tools.ninja if tools else None,
        make=tools.make if tools else None,
        load_limit=options.load_limit or read_make_flags(variables.get("MAKEFLAGS", "")).load,
        cmake_args=tuple(argument.lstrip() for argument in options.cmake_args),
        ament_cmake_args=tuple(argument.lstrip() for argument in options.ament_cmake_args),
        test_results=Path(options.test_result_base).absolute() if options.test_result_base else None,
        force_configure=options.cmake_force_configure,
        environment_generator=variables.get("CMAKE_GENERATOR"),
    )
    return kitchen, interpreter


def toolchain_of(kitchen: Kitchen, variables: Mapping[str, str]) -> Toolchain | None:
    """Return what spares new packages the examination of the compilers.

    None without CMake, and where ament packages are told what others are not: that may be a compiler.
    """
    if kitchen.cmake is None or kitchen.ament_cmake_args:
        return None
    told_apart = (*kitchen.tools, *environment_that_counts(variables))
    return Toolchain(kitchen.layout.build, kitchen.cmake, common_arguments(kitchen), told_apart)


def warm_worker(plan: BuildPlan) -> AbstractContextManager[dict[str, str]]:
    """Return what starts a worker for the plan's interface packages and gives the variables to find it.

    Without such packages there is nothing to start, and nothing to find.
    """
    if not any(INTERFACE_GROUP in task.package.manifest.groups for task in plan.tasks.values()):
        return nullcontext({})
    from forge.worker import worker  # noqa: PLC0415  (the usual build has none)

    return worker()


def open_budget(
    options: argparse.Namespace, kitchen: Kitchen, variables: Mapping[str, str], plan: BuildPlan
) -> Budget:
    """Return the job tokens of a build: those of a make above us, else as many as were asked for.

    Which tools can share them is tried out, in one style for all, since one may start the other.
    """
    flags = read_make_flags(variables.get("MAKEFLAGS", ""))
    level = variables.get("CMAKE_BUILD_PARALLEL_LEVEL", "")
    jobs = options.jobs or flags.jobs or (int(level) if level.isdigit() else 0) or processors()
    pool = joined_pool(flags.auth) if flags.auth and not options.jobs else None
    if flags.auth and pool is None and not options.jobs:
        hint = "begin its rule with '+', or give forge its own --jobs"
        warn([Problem("the jobserver of the make above cannot be reached", hint=hint)])
    compiles = any(task.package.build_type in CMAKE_TYPES for task in plan.tasks.values())
    tools = {"ninja": kitchen.ninja, "make": kitchen.make} if compiles else {}
    spoken_by = {name: spoken(name, tool, variables) for name, tool in tools.items() if tool}
    style = pool.style if pool else common_style(spoken_by)
    if pool is None and style is not None:
        pool = own_pool(style)
    fluent = frozenset(name for name, styles in spoken_by.items() if style in styles)
    short = partial(shortage, options.memory_limit, kitchen.load_limit)
    return Budget(jobs, pool, fluent, flags, short)


def standing(
    options: argparse.Namespace,
    loaded: Loaded,
    kitchen: Kitchen,
    variables: Mapping[str, str],
) -> Standing:
    """Return what holds for every package: forge, tools, environment, and whom --force means."""
    return Standing(
        forge=_forge(),
        tools=kitchen.tools,
        environment=environment_that_counts(variables),
        force=options.force,
        selected=frozenset(loaded.selection.names),
    )


def _forge() -> str:
    """Return what tells this forge apart: its version, and the stats of its code and templates.

    An upgrade changes both; a checkout that is worked on changes the latter alone.
    """
    home = Path(__file__).parent
    folders = [home, home.parent / "templates"] if not (home / "_templates").is_dir() else [home]
    files = [path for folder in folders for path in source_files(str(folder))]
    own = [path for path in files if f"{os.sep}embedded{os.sep}" not in path]
    return f"{__version__} {stamp_files(own)}"
