"""Recipes for CMake packages, with and without ament: configure if needed, build, install; pure."""

from __future__ import annotations

import hashlib
from itertools import chain
from typing import TYPE_CHECKING

from forge.base.cmake_syntax import cmake_arguments, quoted
from forge.base.errors import Problem
from forge.base.layout import CONFIGURED_FILE, SCRATCH_DIR
from forge.build.recipes.context import Recipe, common_options
from forge.build.recipes.extensions import active_extensions
from forge.build.tasks import Step, StepKind
from forge.build.up_to_date import PATH_MAPS, ROSDISTRO
from forge.workspace.resolve import GENERATORS

if TYPE_CHECKING:
    from pathlib import Path

    from forge.base.frozen import Pairs
    from forge.build.recipes.context import BuildContext
    from forge.build.tests.recipes import TestContext
    from forge.workspace.model import Package


def plain_recipe(package: Package, context: BuildContext) -> Recipe:
    return _recipe(package, context, context.cmake_args)


def plain_options(package: Package, context: BuildContext) -> tuple[str, ...]:
    """Return the options that require a configure run when they change."""
    # Not the maps themselves: they follow from the paths among the common options.
    mapped = (PATH_MAPS,) if context.path_maps else ()
    extended = (option for each in active_extensions(context) for option in each.options(package, context))
    return (*common_options(package, context), *context.cmake_args, *mapped, *extended)


def ament_recipe(package: Package, context: BuildContext) -> Recipe:
    """Return the steps for an ament_cmake package; AMENT_CMAKE_SYMLINK_INSTALL selects symlinks."""
    links = ("AMENT_CMAKE_SYMLINK_INSTALL", "1" if _links(package, context) else "0")
    arguments = (*context.cmake_args, *context.ament_cmake_args)
    entries = (links, *_test_results(context), *_distribution(package, context))
    return _recipe(package, context, arguments, entries)


def ament_options(package: Package, context: BuildContext) -> tuple[str, ...]:
    """Return the options that require a configure run when they change."""
    test_results = (f"--test-result-base={value}" for _, value in _test_results(context))
    distribution = (f"{ROSDISTRO}{value}" for _, value in _distribution(package, context))
    return (*plain_options(package, context), *test_results, *distribution, *context.ament_cmake_args)


def tests(package: Package, context: TestContext) -> Recipe:
    """Return the CTest run of a built package."""
    from forge.build.tests.detection import ctest_configuration
    from forge.build.tests.recipes import ctest_recipe

    return ctest_recipe(package, context, ctest_configuration(context.layout.build_dir(package.name)))


def common_arguments(context: BuildContext) -> tuple[str, ...]:
    """Return the CMake arguments for every new build folder."""
    return (*_generator(context, context.cmake_args), *context.cmake_args)


def scratch_folder(build_dir: Path) -> Path:
    """Return the folder for the files that forge passes to CMake."""
    return build_dir / SCRATCH_DIR


def _recipe(package: Package, context: BuildContext, arguments: tuple[str, ...], ament: Pairs = ()) -> Recipe:
    """Return the steps; `ament` are CMake variables."""
    from forge.base.templating import render
    from forge.build.recipes import initial_cache

    build = context.layout.build_dir(package.name)
    folder = scratch_folder(build)
    manifest = folder / "manifest.cmake"
    additions = [each.addition(package, context) for each in active_extensions(context)]
    parts = tuple(file for addition in additions for file in addition.files)
    # CMake includes this file at the end of project().
    include = folder / "project.cmake"
    included = [quoted(str(path)) for path, _ in parts if path.suffix == ".cmake"]
    entries = (*ament, ("CMAKE_PROJECT_INCLUDE", str(include)))
    files = (
        (folder / "initial_cache.cmake", initial_cache.initial_cache(context, manifest, entries)),
        (manifest, initial_cache.manifest_variables(package.manifest)),
        (include, render("cmake/project.cmake.j2", parts=included)),
        *parts,
    )
    configure = _configure(package, context, arguments, (files[0][1], *(text for _, text in parts)))
    cmake = str(context.cmake)
    first = ("--clean-first",) if context.clean_first else ()
    launchers = (word for addition in reversed(additions) for word in addition.build_launcher)
    build_argv = (*launchers, cmake, "--build", str(build), *first, *_jobs(context))
    build_step = Step(StepKind.BUILD, build_argv, build)
    install = (cmake, "--install", str(build))
    # CMake skips a file whose time differs by less than a second from the installed one, even if its content
    # differs: a second build within a second would not be installed.
    env: Pairs = (("CMAKE_INSTALL_ALWAYS", "1"),)
    if _links(package, context):
        env = (*env, ("CMAKE_INSTALL_MODE", "ABS_SYMLINK_OR_COPY"))
    install_step = Step(StepKind.INSTALL, install, build, env)
    return Recipe((configure, *_target(build, context), build_step, install_step), files)


def _target(build: Path, context: BuildContext) -> tuple[Step, ...]:
    if not context.target:
        return ()
    argv = (str(context.cmake), "--build", str(build), "--target", context.target, *_jobs(context))
    if context.skip_target:
        argv = ("sh", "-c", _IF_TARGET_EXISTS, context.target, *argv)
    return (Step(StepKind.BUILD_TARGET, argv, build, target=context.target),)


_IF_TARGET_EXISTS = r"""targets=$("$1" --build "$3" --target help) || exit
printf '%s\n' "$targets" | sed -n 's/^\.\.\. \([^ ]*\).*/\1/p; s/: .*//p' | grep -qxF -- "$0" || exit 0
exec "$@"
"""
"""Builds one target if ninja's or make's list of targets contains it."""


def _configure(
    package: Package, context: BuildContext, arguments: tuple[str, ...], texts: tuple[str, ...]
) -> Step:
    """Return the configure step, skipped if the last configure run had the same arguments and these texts."""
    build = context.layout.build_dir(package.name)
    arguments, env = _with_path_maps(arguments, context)
    argv = (
        str(context.cmake),
        # With -S and -B, since CMake takes a source folder with a CMakeCache.txt for a build folder.
        *("-S", str(context.root / package.path), "-B", str(build)),
        "-C",
        str(scratch_folder(build) / "initial_cache.cmake"),
        *_generator(context, arguments, only_make=package.name in context.only_make),
        *arguments,
        f"-DCMAKE_INSTALL_PREFIX={context.layout.prefix(package.name)}",
    )
    parts = (*argv, *(flags for _, flags in env), *texts)
    digest = hashlib.sha256("\0".join(parts).encode(errors="surrogateescape")).hexdigest()
    return Step(
        StepKind.CONFIGURE, argv, build, env, record=(scratch_folder(build) / CONFIGURED_FILE, digest)
    )


def _with_path_maps(arguments: tuple[str, ...], context: BuildContext) -> tuple[tuple[str, ...], Pairs]:
    """Return the arguments and the environment variables that pass the path maps to compilers.

    CMake takes the initial flags of a language from the environment, unless an argument sets them.
    """
    parsed = tuple(cmake_arguments(arguments))
    found, env = [list(argument.words) for argument in parsed], []
    setting = {
        each.definition[0]: words for each, words in zip(parsed, found, strict=True) if each.definition
    }
    for language, maps in context.path_maps:
        if words := setting.get(f"CMAKE_{language}_FLAGS"):
            words[-1] += f" {maps}"
        else:
            variable = FLAGS[language]
            flags = dict(context.flags).get(language, "")
            env.append((variable, f"{flags} {maps}".strip()))
    return tuple(chain.from_iterable(found)), tuple(env)


FLAGS = {"C": "CFLAGS", "CXX": "CXXFLAGS"}
"""The variable from which CMake takes the initial flags of a language."""


def unfit_generator(package: Package, context: BuildContext) -> Problem | None:
    """Return a problem if the package cannot be built with the generator chosen by the user, or None."""
    context = context.of(package)
    arguments = context.cmake_args
    if package.build_type == "ament_cmake":
        arguments += context.ament_cmake_args
    name = context.environment_generator or ""
    for argument in cmake_arguments(arguments):
        if argument.option == "-G":
            name = argument.value.strip()
    if name not in _MULTI_CONFIG_GENERATORS:
        return None
    message = f"'{package.name}' cannot be built with '{name}': multi-config generators are not supported"
    return Problem(message, hint="use '-G Ninja' and choose one, for example '-DCMAKE_BUILD_TYPE=Release'")


_MULTI_CONFIG_GENERATORS = frozenset({"Ninja Multi-Config", "Xcode"})
"""Generators that select the build type (Debug, Release, ...) at build time instead of configure time."""


def _generator(
    context: BuildContext, arguments: tuple[str, ...], *, only_make: bool = False
) -> tuple[str, ...]:
    """Return the arguments that select Ninja, unless the user chose a generator."""
    if any(argument.option == "-G" for argument in cmake_arguments(arguments)):
        return ()
    if context.environment_generator or context.ninja is None:
        return ()
    if only_make and context.make:
        return ("-G", "Unix Makefiles")
    return ("-G", "Ninja", f"-DCMAKE_MAKE_PROGRAM={context.ninja}")


def _jobs(context: BuildContext) -> tuple[str, ...]:
    """Return the load limit for the build tool; the runner sets the number of jobs."""
    return () if context.load_limit is None else ("--", f"-l{context.load_limit:g}")


def _test_results(context: BuildContext) -> Pairs:
    return (("AMENT_TEST_RESULTS_DIR", str(context.test_results)),) if context.test_results else ()


def _distribution(package: Package, context: BuildContext) -> Pairs:
    """Return the ROS distribution for the package from which all interface packages learn it."""
    is_read = package.embedded and package.name == GENERATORS
    return (("FORGE_ROSDISTRO", context.rosdistro),) if is_read else ()


def _links(package: Package, context: BuildContext) -> bool:
    """Return True if files are symlinked into the prefix; not for embedded packages, which upgrades move."""
    return context.layout.symlink and not package.embedded
