"""What a build takes before it can be planned: a clean environment, tools, options; and what stops it."""

from __future__ import annotations

import contextlib
import os
import shlex
import sys
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING

from forge import __version__
from forge.digests import digest_words, source_files, stamp_files
from forge.discovery import ROS_DEFAULTS, special_files
from forge.errors import Problem, WorkspaceError, raise_if_any
from forge.freshness import environment_that_counts
from forge.interpreter import find_interpreter, own_command, require_modules
from forge.launching.choice import chosen
from forge.lengths import too_long
from forge.makeflags import read_make_flags
from forge.named_inputs import NamedInputs
from forge.options import cache_wanted
from forge.places import unfit_folders
from forge.planning import Standing
from forge.prefixes import find_underlays
from forge.provision import INTERFACE_GROUP, missing_problems
from forge.recipes.cmake import FLAGS, unfit_generator
from forge.recipes.kitchen import Kitchen
from forge.results import recorded_underlays
from forge.tools import CMAKE_TYPES, condensed, find_tools, identities
from forge.underlays import lost_underlays
from forge.unused_variables import odd_words
from forge.workspace import warn

if TYPE_CHECKING:
    import argparse
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from forge.interpreter import Interpreter
    from forge.layout import Layout
    from forge.model import BuildPlan, Pairs, Task
    from forge.workspace import Loaded


def build_variables(layout: Layout, surroundings: Mapping[str, str]) -> dict[str, str]:
    """Return the environment of a build: the surroundings, ROS defaults, and the recorded underlays.

    Whoever sourced this workspace before building it gets the same build as who did not: its own
    entries are left out. An underlay of an earlier build counts though this shell has not sourced it.
    """
    variables = {**ROS_DEFAULTS, "COLCON": "1", **without_own(surroundings, layout.install)}
    sourced = find_underlays(variables, layout.install).chain
    forgotten = [root for root in recorded_underlays(layout.install) if root not in sourced and root.is_dir()]
    if not forgotten:
        return variables
    from forge.sourcing import workspace_environment  # noqa: PLC0415  (it may start a shell)

    return workspace_environment(forgotten, variables)


def tell_of_lost_underlays(layout: Layout, surroundings: Mapping[str, str]) -> None:
    """Warn of underlays that an earlier build or the environment names, and that are gone."""
    warn(lost_underlays(layout.install, without_own(surroundings, layout.install)))


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


def refuse_what_cannot_work(loaded: Loaded, names: Sequence[str], layout: Layout) -> None:
    """Raise WorkspaceError with everything that would make the build fail anyway."""
    errors, _ = missing_problems(loaded.provision, names)
    problems = [*loaded.workspace.problems, *errors]
    if not loaded.workspace.packages and not problems:
        hint = "go to the folder that has 'src' in it, or make a package: forge pkg create my_package"
        problems.append(Problem(f"there is no package below '{loaded.workspace.root}'", hint=hint))
    python = any("python" in loaded.packages[name].build_type for name in names)
    problems += unfit_folders((loaded.workspace.root, layout.build, layout.install), python=python)
    raise_if_any(problems, WorkspaceError)


def refuse_what_would_fail(
    plan: BuildPlan, loaded: Loaded, kitchen: Kitchen, variables: Mapping[str, str]
) -> None:
    """Raise WorkspaceError for what would make tasks fail or hang; warn of what will hurt later."""
    errors, warnings = too_long(
        plan, loaded.provision.packages, kitchen.layout, kitchen.site_packages, variables
    )
    warn(warnings)
    own = [task for task in plan.tasks.values() if not task.embedded]
    raise_if_any((*_unfit_generators(own, kitchen), *errors), WorkspaceError)
    # Tools would wait for a named pipe, and CMake installs a file into a folder of its name without a word.
    raise_if_any((p for task in own for p in special_files(kitchen.root, task.package.path)), WorkspaceError)
    if plan.tasks:
        from forge.fallback import in_the_way  # noqa: PLC0415  (a build of nothing is quick)

        found = (p for task in plan.tasks.values() for p in in_the_way(task, kitchen.layout))
        raise_if_any(found, WorkspaceError)


def _unfit_generators(tasks: Iterable[Task], kitchen: Kitchen) -> Iterator[Problem]:
    """Yield the first package whose generator forge has no steps for: one is enough."""
    packages = (task.package for task in tasks if task.package.build_type in CMAKE_TYPES)
    problems = (unfit_generator(package, kitchen) for package in packages)
    yield from islice(filter(None, problems), 1)


def prepare(
    options: argparse.Namespace,
    loaded: Loaded,
    names: Sequence[str],
    layout: Layout,
    variables: Mapping[str, str],
) -> tuple[Kitchen, Interpreter]:
    """Return the tools and options that all packages share; raises EnvironmentFault for what is missing."""
    packages = [loaded.packages[name] for name in names]
    warn(odd_words([word.lstrip() for word in (*options.cmake_args, *options.ament_cmake_args)]))
    launcher = chosen(options.compiler_launcher)
    tools = find_tools(packages, variables, launcher)
    interpreter = find_interpreter(options.python, variables)
    if any(INTERFACE_GROUP in package.manifest.groups for package in packages):
        require_modules(interpreter, ("numpy",))
    through_worker = (sys.executable, "-S", "-E", str(Path(__file__).with_name("worker_client.py")))
    # Only a watch has a worker that has loaded what Python packages take.
    warm = through_worker if getattr(options, "again", False) else own_command()
    kitchen = Kitchen(
        root=loaded.workspace.root,
        layout=layout,
        python=interpreter.path,
        site_packages=interpreter.site_packages,
        wheels=(*warm, "-m", "forge.wheels"),
        generator=through_worker,
        tools=identities(tools, interpreter.path, variables, options.cmake_args),
        cmake=tools.cmake if tools else None,
        ninja=tools.ninja if tools else None,
        make=tools.make if tools else None,
        only_make=tools.only_make if tools else frozenset(),
        load_limit=options.load_limit or read_make_flags(variables.get("MAKEFLAGS", "")).load,
        cmake_args=tuple(argument.lstrip() for argument in options.cmake_args),
        ament_cmake_args=tuple(argument.lstrip() for argument in options.ament_cmake_args),
        launcher=tools.launcher if tools else None,
        test_results=Path(options.test_result_base).absolute() if options.test_result_base else None,
        force_configure=options.cmake_force_configure,
        clean_cache=options.cmake_clean_cache,
        clean_first=options.cmake_clean_first,
        target=options.cmake_target,
        skip_target=options.cmake_target_skip_unavailable,
        environment_generator=variables.get("CMAKE_GENERATOR"),
        path_maps=_path_maps(options, loaded.workspace.root, layout, variables),
        flags=tuple((language, variables.get(variable, "")) for language, variable in FLAGS.items()),
    )
    return kitchen, interpreter


def _path_maps(
    options: argparse.Namespace, root: Path, layout: Layout, variables: Mapping[str, str]
) -> Pairs:
    """Return the flags that let packages come out the same wherever they are built; none without a cache."""
    if not cache_wanted(options, variables):
        return ()
    # Compilers take the last that fits, so the root, which usually holds the others, comes first.
    folders = ((root, "."), (layout.build, "./build"), (layout.install, "./install"))
    maps = " ".join(shlex.quote(f"-ffile-prefix-map={folder}={name}") for folder, name in folders)
    return tuple((language, maps) for language in FLAGS)


def standing(
    options: argparse.Namespace,
    loaded: Loaded,
    kitchen: Kitchen,
    variables: Mapping[str, str],
) -> tuple[Standing, NamedInputs]:
    """Return what holds for every package: forge, tools, environment, and whom --force means.

    And apart what finds out what single packages name, to be saved once the plan is made.
    """
    stamp, provision = forge_stamp(), loaded.provision
    named = NamedInputs(kitchen, provision.needs, provision.packages, variables, stamp)
    held = Standing(
        forge=stamp,
        tools=condensed(kitchen.tools),
        environment=environment_that_counts(variables),
        underlays=_names_below(find_underlays(variables, kitchen.layout.install).prefixes),
        force=force_of(options),
        selected=frozenset(loaded.selection.names),
        named=named.of,
    )
    return held, named


def _names_below(prefixes: Sequence[Path]) -> str:
    """Return a digest of the names by which packages may be found in the prefixes, which comes cheap."""
    words: list[str] = []
    for prefix in prefixes:
        for folder in ("share", "lib/cmake"):
            with contextlib.suppress(OSError):
                words += (f"{prefix}/{folder}", *sorted(os.listdir(prefix / folder)))  # noqa: PTH208
    return digest_words(*words) if words else ""


def force_of(options: argparse.Namespace) -> str:
    """Return the option that asks for packages though they are fresh; '' when none does, or has done so."""
    if getattr(options, "again", False):
        return ""
    words = (
        "audit",
        "force",
        "cmake-force-configure",
        "cmake-clean-cache",
        "cmake-clean-first",
        "cmake-target",
    )
    return next((f"--{word}" for word in words if getattr(options, word.replace("-", "_"))), "")


def forge_stamp() -> str:
    """Return what tells this forge apart: its version, and the stats of its code and templates.

    An upgrade changes both; a checkout that is worked on changes the latter alone.
    """
    home = Path(__file__).parent
    folders = [home] if (home / "_templates").is_dir() else [home, home.parent / "templates"]
    files = [path for folder in folders for path in source_files(str(folder), "embedded")]
    return f"{__version__} {stamp_files(files)}"
