"""CMake packages, with ament or without: configure when something changed, build, install; pure."""

from __future__ import annotations

import hashlib
import re
from typing import TYPE_CHECKING

from forge.errors import Problem
from forge.model import CONFIGURE, Step
from forge.recipes.kitchen import Recipe, places

if TYPE_CHECKING:
    from pathlib import Path

    from forge.model import Package, Pairs
    from forge.recipes.kitchen import Kitchen

RECORD = "configured"
"""The file beside the handover that says how the build folder was last configured."""


def plain_recipe(package: Package, kitchen: Kitchen) -> Recipe:
    """Return the steps for a package that knows nothing of ament."""
    return _recipe(package, kitchen, kitchen.cmake_args)


def plain_options(package: Package, kitchen: Kitchen) -> tuple[str, ...]:
    """Return the words whose change means another configure."""
    # Not the maps themselves: these follow from the places, and are spelled as the places are.
    mapped = ("path maps",) if kitchen.path_maps else ()
    return (*places(package, kitchen), *kitchen.cmake_args, *mapped)


def ament_recipe(package: Package, kitchen: Kitchen) -> Recipe:
    """Return the steps for an ament_cmake package; ament's own option tells it of symlinks."""
    links = ("AMENT_CMAKE_SYMLINK_INSTALL", "1" if _links(package, kitchen) else "0")
    arguments = (*kitchen.cmake_args, *kitchen.ament_cmake_args)
    return _recipe(package, kitchen, arguments, (links, *_test_results(kitchen)))


def ament_options(package: Package, kitchen: Kitchen) -> tuple[str, ...]:
    """Return the words whose change means another configure."""
    told = (value for _, value in _test_results(kitchen))
    return (*plain_options(package, kitchen), *told, *kitchen.ament_cmake_args)


def common_arguments(kitchen: Kitchen) -> tuple[str, ...]:
    """Return what is said to CMake for every new build folder."""
    return (*_generator(kitchen, kitchen.cmake_args), *kitchen.cmake_args)


def handover_folder(build_dir: Path) -> Path:
    """Return where forge puts what it hands to CMake."""
    return build_dir / "handover"


def _recipe(package: Package, kitchen: Kitchen, arguments: tuple[str, ...], ament: Pairs = ()) -> Recipe:
    build = kitchen.layout.build_dir(package.name)
    from forge.recipes import handover  # noqa: PLC0415  (a fresh package needs no templates)

    folder = handover_folder(build)
    manifest = folder / "manifest.cmake"
    files = (
        (folder / "handover.cmake", handover.handover(kitchen, manifest, ament)),
        (manifest, handover.manifest_variables(package.manifest)),
    )
    configure = _configure(package, kitchen, arguments, files[0][1])
    cmake = str(kitchen.cmake)
    first = ("--clean-first",) if kitchen.clean_first else ()
    build_step = Step("build", (cmake, "--build", str(build), *first, *_jobs(kitchen)), build)
    install_step = Step("install", (cmake, "--install", str(build)), build, _how_to_install(package, kitchen))
    return Recipe((configure, *_target(build, kitchen), build_step, install_step), files)


def _target(build: Path, kitchen: Kitchen) -> tuple[Step, ...]:
    """Return the step that builds what the user asks for and a build of everything may leave out."""
    if not kitchen.target:
        return ()
    argv = (str(kitchen.cmake), "--build", str(build), "--target", kitchen.target, *_jobs(kitchen))
    if kitchen.skip_target:
        argv = ("sh", "-c", _IF_THERE, kitchen.target, *argv)
    return (Step(f"build target '{kitchen.target}'", argv, build),)


_IF_THERE = r"""targets=$("$1" --build "$3" --target help) || exit
printf '%s\n' "$targets" | sed -n 's/^\.\.\. \([^ ]*\).*/\1/p; s/: .*//p' | grep -qxF -- "$0" || exit 0
exec "$@"
"""
"""Starts a build of one target, unless ninja's or make's list of targets is without it."""


def _configure(package: Package, kitchen: Kitchen, arguments: tuple[str, ...], handed_over: str) -> Step:
    """Return the configure step, which leaves a folder alone that was configured in just this way."""
    build = kitchen.layout.build_dir(package.name)
    arguments, env = _with_path_maps(arguments, kitchen)
    argv = (
        str(kitchen.cmake),
        # By these words, since CMake takes a source folder with a CMakeCache.txt in it for a build folder.
        *("-S", str(kitchen.root / package.path), "-B", str(build)),
        "-C",
        str(handover_folder(build) / "handover.cmake"),
        *_generator(kitchen, arguments, only_make=package.name in kitchen.only_make),
        *arguments,
        f"-DCMAKE_INSTALL_PREFIX={kitchen.layout.prefix(package.name)}",
    )
    said = (*argv, *(flags for _, flags in env), handed_over)
    digest = hashlib.sha256("\0".join(said).encode(errors="surrogateescape")).hexdigest()
    return Step(CONFIGURE, argv, build, env, record=(handover_folder(build) / RECORD, digest))


def _with_path_maps(arguments: tuple[str, ...], kitchen: Kitchen) -> tuple[tuple[str, ...], Pairs]:
    """Return the arguments and variables by which compilers learn of the path maps.

    CMake takes the first flags of a language from the environment, unless an argument sets them.
    """
    found, env = list(arguments), []
    for language, maps in kitchen.path_maps:
        setting = re.compile(rf"-DCMAKE_{language}_FLAGS(:\w+)?=")
        set_by = [index for index, argument in enumerate(found) if setting.match(argument)]
        if set_by:
            found[set_by[-1]] += f" {maps}"
        else:
            variable = FLAGS[language]
            given = dict(kitchen.flags).get(language, "")
            env.append((variable, f"{given} {maps}".strip()))
    return tuple(found), tuple(env)


FLAGS = {"C": "CFLAGS", "CXX": "CXXFLAGS"}
"""The variable from which CMake takes the first flags of a language."""


def unfit_generator(package: Package, kitchen: Kitchen) -> Problem | None:
    """Return why a package cannot be built with the generator that the user wants, or None."""
    kitchen = kitchen.of(package)
    arguments = kitchen.cmake_args
    if package.build_type == "ament_cmake":
        arguments += kitchen.ament_cmake_args
    name = kitchen.environment_generator or ""
    for word, following in zip(arguments, (*arguments, "")[1:], strict=True):
        if word.startswith("-G"):
            name = (word[2:] or following).strip()
    if name not in _SEVERAL_CONFIGURATIONS:
        return None
    message = f"'{package.name}' cannot be built with '{name}': forge installs one configuration at a time"
    return Problem(message, hint="use '-G Ninja', and '--cmake-args -DCMAKE_BUILD_TYPE=Release' or another")


_SEVERAL_CONFIGURATIONS = frozenset({"Ninja Multi-Config", "Xcode"})
"""Generators that choose between Debug and Release when a package is built, and not when it is configured."""


def _generator(kitchen: Kitchen, arguments: tuple[str, ...], *, only_make: bool = False) -> tuple[str, ...]:
    """Choose Ninja, unless the user says otherwise."""
    if any(argument.startswith("-G") for argument in arguments):
        return ()
    if kitchen.environment_generator or kitchen.ninja is None:
        return ()
    if only_make and kitchen.make:
        return ("-G", "Unix Makefiles")
    return ("-G", "Ninja", f"-DCMAKE_MAKE_PROGRAM={kitchen.ninja}")


def _jobs(kitchen: Kitchen) -> tuple[str, ...]:
    """Return how the build tool is limited; of how many jobs there may be the runner tells it in its turn."""
    return () if kitchen.load_limit is None else ("--", f"-l{kitchen.load_limit:g}")


def _how_to_install(package: Package, kitchen: Kitchen) -> tuple[tuple[str, str], ...]:
    """Return what `cmake --install` reads from its environment.

    By itself it skips a file whose time differs by less than a second from the installed one's, though it
    may say something else: what is built twice within a second would not be installed.
    """
    always = (("CMAKE_INSTALL_ALWAYS", "1"),)
    return (*always, ("CMAKE_INSTALL_MODE", "ABS_SYMLINK_OR_COPY")) if _links(package, kitchen) else always


def _test_results(kitchen: Kitchen) -> Pairs:
    return (("AMENT_TEST_RESULTS_DIR", str(kitchen.test_results)),) if kitchen.test_results else ()


def _links(package: Package, kitchen: Kitchen) -> bool:
    """Tell if files are linked into the prefix; never those of forge itself, which an upgrade moves."""
    return kitchen.layout.symlink and not package.embedded
