"""`forge build`: build the packages of a workspace in the order in which they need each other."""

from __future__ import annotations

import os
import sys
import time
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING

from forge import options as shared
from forge.discovery import ROS_DEFAULTS
from forge.errors import Problem, SelectionError, WorkspaceError, raise_if_any
from forge.execution import execute
from forge.installation import begin_workspace, finish_workspace, recorded_underlays
from forge.interpreter import find_interpreter, require_modules
from forge.jobs import job_runner
from forge.journal import open_journal
from forge.names import did_you_mean
from forge.planning import make_plan, wanted_names
from forge.prefixes import find_underlays
from forge.provision import missing_problems
from forge.recipes.cmake import jobs_given
from forge.recipes.kitchen import Kitchen
from forge.reporting import HANDLERS, Report
from forge.schedule import Board
from forge.snapshot import take_snapshot
from forge.sourcing import workspace_environment
from forge.tools import find_tools
from forge.transcript import open_transcript
from forge.workspace import Loaded, load_workspace, warn

if TYPE_CHECKING:
    import argparse

    from forge.cli import Parser
    from forge.interpreter import Interpreter
    from forge.layout import Layout
    from forge.model import BuildPlan


def register(parser: Parser) -> None:
    """Add the options of `forge build`."""
    shared.add_discovery(parser)
    shared.add_selection(parser)
    shared.add_layout(parser)
    parser.add_argument("--symlink-install", action="store_true", help="link files instead of copying them")
    parser.add_argument(
        "--continue-on-error", action="store_true", help="build what does not need the failed"
    )
    parser.add_argument("--executor", choices=["parallel", "sequential"], default="parallel")
    parser.add_argument(
        "--parallel-workers",
        type=int,
        default=_processors(),
        metavar="N",
        help="packages at a time (0: any number)",
    )
    parser.add_argument("--python", metavar="PATH", help="the interpreter to build with and for")
    parser.add_argument("--cmake-args", nargs="*", default=[], metavar="ARG", help="given to every cmake")
    parser.add_argument(
        "--ament-cmake-args", nargs="*", default=[], metavar="ARG", help="to ament_cmake packages"
    )
    parser.add_argument(
        "--cmake-force-configure", action="store_true", help="configure even when nothing changed"
    )
    parser.add_argument("--event-handlers", nargs="*", default=[], metavar="NAME+", help="as console_direct+")
    parser.greedy = frozenset({"--cmake-args", "--ament-cmake-args"})


def run(options: argparse.Namespace) -> int:
    """Build; returns 0, 1 when a package failed, 2 when an interface definition is wrong."""
    begun = time.monotonic()
    root = Path.cwd()
    handlers = _handlers(options.event_handlers)
    layout = shared.layout_of(options, root)
    variables = _variables(layout)
    loaded = load_workspace(root, options, variables, embedded=True, install=layout.install)
    names = _wanted(loaded)
    _refuse_what_cannot_work(loaded, names)
    kitchen, interpreter = _kitchen(options, loaded, names, layout)
    begin_workspace(layout)
    with (
        closing(open_journal(layout.build)) as journal,
        closing(open_transcript(layout.logs, "build", sys.argv)) as transcript,
    ):
        snapshot = take_snapshot((loaded.packages[n] for n in loaded.packages), layout, journal.digests)
        plan = make_plan(names, loaded.provision, snapshot, kitchen)
        report = Report(plan, handlers, transcript.folder)
        try:
            for event in execute(
                plan, job_runner(loaded.provision, layout, interpreter, variables), _board(plan, options)
            ):
                journal.record(event, plan)
                transcript.write(event)
                report.show(event)
        finally:
            finish_workspace(layout, find_underlays(variables, layout.install).chain, interpreter.path)
            report.summarise(time.monotonic() - begun)
    return report.exit_code


def _variables(layout: Layout) -> dict[str, str]:
    """Return the environment with the ROS variables that manifests ask for and the recorded underlays.

    An underlay of an earlier build counts though this shell has not sourced it: the workspace stands on
    it, and forgetting to source must not change what is built.
    """
    variables = {**ROS_DEFAULTS, "COLCON": "1", **os.environ}
    sourced = find_underlays(variables, layout.install).chain
    forgotten = [root for root in recorded_underlays(layout.install) if root not in sourced]
    return workspace_environment([root for root in forgotten if root.is_dir()], variables)


def _wanted(loaded: Loaded) -> tuple[str, ...]:
    """Return what to build: of what was selected the workspace's own, and the embedded ones below."""
    return wanted_names(loaded.selection, loaded.provision, loaded.provision.needs)


def _refuse_what_cannot_work(loaded: Loaded, names: tuple[str, ...]) -> None:
    """Raise WorkspaceError with everything that would make the build fail anyway."""
    errors, warnings = missing_problems(loaded.provision, names)
    problems = [*loaded.workspace.problems, *errors]
    if not loaded.workspace.packages and not problems:
        hint = "go to the folder that has 'src' in it, or make a package: forge pkg create my_package"
        problems.append(Problem(f"there is no package below '{loaded.workspace.root}'", hint=hint))
    warn(warnings)
    raise_if_any(problems, WorkspaceError)


def _kitchen(
    options: argparse.Namespace, loaded: Loaded, names: tuple[str, ...], layout: Layout
) -> tuple[Kitchen, Interpreter]:
    """Return the tools and options of this build, once everything it takes was found."""
    packages = [loaded.packages[name] for name in names]
    tools = find_tools(packages, os.environ)
    interpreter = find_interpreter(options.python, os.environ)
    if any("rosidl_interface_packages" in package.manifest.groups for package in packages):
        require_modules(interpreter, ("numpy",))
    kitchen = Kitchen(
        root=loaded.workspace.root,
        layout=layout,
        python=interpreter.path,
        site_packages=interpreter.site_packages,
        forge=(sys.executable, "-m", "forge"),
        jobs=0 if jobs_given(os.environ.get("MAKEFLAGS", "")) else _processors(),
        cmake=tools.cmake if tools else None,
        ninja=tools.ninja if tools else None,
        cmake_args=tuple(argument.lstrip() for argument in options.cmake_args),
        ament_cmake_args=tuple(argument.lstrip() for argument in options.ament_cmake_args),
        force_configure=options.cmake_force_configure,
        environment_generator=os.environ.get("CMAKE_GENERATOR"),
    )
    return kitchen, interpreter


def _board(plan: BuildPlan, options: argparse.Namespace) -> Board:
    limit = 1 if options.executor == "sequential" else options.parallel_workers
    return Board(plan, limit, continue_on_error=options.continue_on_error)


def _handlers(words: list[str]) -> dict[str, bool]:
    """Return which event handlers are on; raises SelectionError for one that nobody knows."""
    unknown = [word for word in words if word.rstrip("+-") not in HANDLERS or word[-1] not in "+-"]
    raise_if_any(
        (
            Problem(
                f"--event-handlers takes names with '+' or '-' at the end, not '{word}'",
                hint=did_you_mean(word.rstrip("+-"), HANDLERS),
            )
            for word in unknown
        ),
        SelectionError,
    )
    return {**HANDLERS, **{word[:-1]: word.endswith("+") for word in words}}


def _processors() -> int:
    return len(os.sched_getaffinity(0))
