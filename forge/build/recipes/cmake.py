"""Recipes for CMake packages, with and without ament: configure if needed, build, install; pure."""

from __future__ import annotations

import hashlib
from itertools import chain
from typing import TYPE_CHECKING

from forge.base.cmake_syntax import cmake_arguments, quoted
from forge.base.errors import Problem
from forge.base.layout import CONFIGURED_FILE, SCRATCH_DIR
from forge.build.recipes.context import BuildContext, Recipe, active_extensions, common_options
from forge.build.tasks import Step, StepKind
from forge.build.up_to_date import ROSDISTRO, TARGET
from forge.workspace.resolve import GENERATORS

if TYPE_CHECKING:
    from pathlib import Path

    from forge.base.frozen import Pairs
    from forge.build.tests.recipes import TestContext
    from forge.workspace.model import Package


def options(package: Package, context: BuildContext) -> tuple[str, ...]:
    """Return the options that require a configure run when they change."""
    # Omit the maps themselves: they follow from the paths in the common options.
    mapped = ("--cache",) if context.path_maps else ()
    variables = _ament_variables(package, context)
    named = (f"{_OPTIONS[name]}{value}" for name, value in variables if name in _OPTIONS)
    extended = (option for each in active_extensions(context) for option in each.options(package, context))
    target = (f"{TARGET}{context.target}",) if context.target else ()
    return (*common_options(package, context), *context.cmake_args, *mapped, *named, *extended, *target)


_OPTIONS = {"AMENT_TEST_RESULTS_DIR": "--test-result-base=", "FORGE_ROSDISTRO": ROSDISTRO}
"""The options of the user for variables of ament."""


def _ament_variables(package: Package, context: BuildContext) -> Pairs:
    """Return the CMake variables that only packages with ament read."""
    if package.build_type != "ament_cmake":
        return ()
    results = context.test_results
    # All interface packages get the distribution from this package.
    has_distribution = package.embedded and package.name == GENERATORS
    return (
        ("AMENT_CMAKE_SYMLINK_INSTALL", "1" if context.links(package) else "0"),
        *((("AMENT_TEST_RESULTS_DIR", str(results)),) if results else ()),
        *((("FORGE_ROSDISTRO", context.rosdistro),) if has_distribution else ()),
    )


def tests(package: Package, context: TestContext) -> Recipe:
    from forge.build.tests.recipes import ctest_configuration, ctest_recipe

    return ctest_recipe(package, context, ctest_configuration(context.layout.build_dir(package.name)))


def common_arguments(context: BuildContext) -> tuple[str, ...]:
    """Return the CMake arguments for every new build folder."""
    return (*_generator(context, context.cmake_args), *context.cmake_args)


def scratch_folder(build_dir: Path) -> Path:
    return build_dir / SCRATCH_DIR


def recipe(package: Package, context: BuildContext) -> Recipe:
    from forge.base.templating import render
    from forge.build.recipes import initial_cache

    build, cmake = context.layout.build_dir(package.name), str(context.cmake)
    folder = scratch_folder(build)
    cache, manifest, include = (folder / f"{name}.cmake" for name in ("initial_cache", "manifest", "project"))
    additions = [each.addition(package, context) for each in active_extensions(context)]
    parts = tuple(file for addition in additions for file in addition.files)
    # CMake includes this file at the end of project().
    entries = (*_ament_variables(package, context), ("CMAKE_PROJECT_INCLUDE", str(include)))
    cache_text = initial_cache.initial_cache(context, manifest, entries)
    included = [quoted(str(path)) for path, _ in parts if path.suffix == ".cmake"]
    files = (
        (cache, cache_text),
        (manifest, initial_cache.manifest_variables(package.manifest)),
        (include, render("cmake/project.cmake.j2", parts=included)),
        *parts,
    )
    arguments, env = _with_path_maps(context)
    configure = (
        cmake,
        # Pass -S and -B, because CMake takes a source folder with a CMakeCache.txt for a build folder.
        *("-S", str(context.source(package)), "-B", str(build), "-C", str(cache)),
        *_generator(context, arguments, only_make=package.name in context.only_make),
        *arguments,
        f"-DCMAKE_INSTALL_PREFIX={context.layout.prefix(package.name)}",
    )
    # This step is skipped if none of these has changed; CMake itself tracks the other files.
    inputs = (*configure, *(flags for _, flags in env), cache_text, *(text for _, text in parts))
    digest = hashlib.sha256("\0".join(inputs).encode(errors="surrogateescape")).hexdigest()
    steps = [Step(StepKind.CONFIGURE, configure, build, env, record=(folder / CONFIGURED_FILE, digest))]
    # The runner sets the number of jobs.
    load = () if context.load_limit is None else ("--", f"-l{context.load_limit:g}")
    if context.target:
        argv: tuple[str, ...] = (cmake, "--build", str(build), "--target", context.target, *load)
        if context.skip_target:
            argv = ("sh", "-c", _IF_TARGET_EXISTS, context.target, *argv)
        steps.append(Step(StepKind.BUILD_TARGET, argv, build, target=context.target))
    launchers = (word for addition in reversed(additions) for word in addition.build_launcher)
    first = ("--clean-first",) if context.clean_first else ()
    steps.append(Step(StepKind.BUILD, (*launchers, cmake, "--build", str(build), *first, *load), build))
    # CMake skips a file whose time differs by less than a second from the installed one, even if its content
    # differs: a second build within a second would not be installed.
    env = (("CMAKE_INSTALL_ALWAYS", "1"),)
    if context.links(package):
        env += (("CMAKE_INSTALL_MODE", "ABS_SYMLINK_OR_COPY"),)
    steps.append(Step(StepKind.INSTALL, (cmake, "--install", str(build)), build, env))
    return Recipe(tuple(steps), files)


_IF_TARGET_EXISTS = r"""targets=$("$1" --build "$3" --target help) || exit
printf '%s\n' "$targets" | sed -n 's/^\.\.\. \([^ ]*\).*/\1/p; s/: .*//p' | grep -qxF -- "$0" || exit 0
exec "$@"
"""
"""Builds one target if ninja's or make's list of targets contains it."""


def _with_path_maps(context: BuildContext) -> tuple[tuple[str, ...], Pairs]:
    """Return arguments and environment variables that pass the path maps to compilers.

    CMake takes initial flags from the environment, unless an argument sets them.
    """
    parsed = tuple(cmake_arguments(context.cmake_args))
    word_lists, env = [list(argument.words) for argument in parsed], []
    setting = {
        each.definition[0]: words for each, words in zip(parsed, word_lists, strict=True) if each.definition
    }
    for language, maps in context.path_maps:
        if words := setting.get(f"CMAKE_{language}_FLAGS"):
            words[-1] += f" {maps}"
        else:
            variable = FLAGS[language]
            flags = dict(context.flags).get(language, "")
            env.append((variable, f"{flags} {maps}".strip()))
    return tuple(chain.from_iterable(word_lists)), tuple(env)


FLAGS = {"C": "CFLAGS", "CXX": "CXXFLAGS"}
"""The variable from which CMake takes the initial flags of a language."""


def unfit_generator(package: Package, context: BuildContext) -> Problem | None:
    """Return a problem if the package cannot be built with the generator chosen by the user, or None."""
    name = context.environment_generator or ""
    for argument in cmake_arguments(context.of(package).cmake_args):
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
