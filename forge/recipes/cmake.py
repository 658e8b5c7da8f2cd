"""CMake packages, with ament or without: configure when something changed, build, install; pure."""

from __future__ import annotations

import hashlib
import re
from typing import TYPE_CHECKING

from forge.model import Step
from forge.recipes import handover
from forge.recipes.kitchen import Recipe

if TYPE_CHECKING:
    from pathlib import Path

    from forge.model import Package
    from forge.recipes.kitchen import Kitchen

RECORD = "configured"
"""The file beside the handover that says how the build folder was last configured."""


def plain_recipe(package: Package, kitchen: Kitchen) -> Recipe:
    """Return the steps for a package that knows nothing of ament."""
    return _recipe(package, kitchen, kitchen.cmake_args)


def ament_recipe(package: Package, kitchen: Kitchen) -> Recipe:
    """Return the steps for an ament_cmake package; ament's own option tells it of symlinks."""
    links = "1" if _links(package, kitchen) else "0"
    arguments = (*kitchen.cmake_args, f"-DAMENT_CMAKE_SYMLINK_INSTALL={links}", *kitchen.ament_cmake_args)
    return _recipe(package, kitchen, arguments)


def handover_folder(build_dir: Path) -> Path:
    """Return where forge puts what it hands to CMake."""
    return build_dir / "handover"


def _recipe(package: Package, kitchen: Kitchen, arguments: tuple[str, ...]) -> Recipe:
    build = kitchen.layout.build_dir(package.name)
    folder = handover_folder(build)
    manifest = folder / "manifest.cmake"
    files = (
        (folder / "handover.cmake", handover.handover(kitchen, manifest)),
        (manifest, handover.manifest_variables(package.manifest)),
    )
    configure = _configure(package, kitchen, arguments, files[0][1])
    environment = (("CMAKE_INSTALL_MODE", "ABS_SYMLINK_OR_COPY"),) if _links(package, kitchen) else ()
    cmake = str(kitchen.cmake)
    build_step = Step("build", (cmake, "--build", str(build), *_jobs(kitchen)), build)
    install_step = Step("install", (cmake, "--install", str(build)), build, environment)
    return Recipe((*configure, build_step, install_step), files)


def _configure(
    package: Package, kitchen: Kitchen, arguments: tuple[str, ...], handed_over: str
) -> tuple[Step, ...]:
    """Return the configure step, or nothing when the folder was configured in just this way.

    What the CMakeLists.txt read is the build tool's to watch: it runs CMake again by itself.
    """
    build = kitchen.layout.build_dir(package.name)
    generator, record = kitchen.configured.get(package.name, ("", ""))
    argv = (
        str(kitchen.cmake),
        str(kitchen.root / package.path),
        "-C",
        str(handover_folder(build) / "handover.cmake"),
        *_generator(kitchen, arguments, generator),
        *arguments,
        f"-DCMAKE_INSTALL_PREFIX={kitchen.layout.prefix(package.name)}",
    )
    # The generator is left out: the second run finds it in the cache and does not name it.
    said = (*argv[:4], *arguments, argv[-1], handed_over)
    digest = hashlib.sha256("\0".join(said).encode()).hexdigest()
    if record == digest and not kitchen.force_configure:
        return ()
    return (Step("cmake", argv, build, record=(handover_folder(build) / RECORD, digest)),)


def _generator(kitchen: Kitchen, arguments: tuple[str, ...], current: str) -> tuple[str, ...]:
    """Choose Ninja for a new build folder, unless the user said otherwise."""
    chosen = current or kitchen.environment_generator or any(a.startswith("-G") for a in arguments)
    if chosen or kitchen.ninja is None:
        return ()
    return ("-G", "Ninja", f"-DCMAKE_MAKE_PROGRAM={kitchen.ninja}")


def _jobs(kitchen: Kitchen) -> tuple[str, ...]:
    return ("--", f"-j{kitchen.jobs}", f"-l{kitchen.jobs}") if kitchen.jobs else ()


def _links(package: Package, kitchen: Kitchen) -> bool:
    """Tell if files are linked into the prefix; never those of forge itself, which an upgrade moves."""
    return kitchen.layout.symlink and not package.embedded


def jobs_given(make_flags: str) -> bool:
    """Tell if MAKEFLAGS already limits the jobs, so that forge must not.

    make itself writes one-letter flags as a first word without a dash: 'kj8 -- V=1'.
    """
    return re.search(r"^[a-zA-Z]*[jl]\d*(\s|$)|(^|\s)-(j|l|-jobs|-load-average)", make_flags) is not None
