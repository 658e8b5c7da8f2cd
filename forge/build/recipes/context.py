"""The parameters and results of recipes, and the extensions of the recipes of CMake packages.

An extension is a module or another object with the fields of RecipeExtension, announced as an entry point of
the group 'forge.recipes'. forge's own extensions are always used, those of other distributions only if
`--recipes` names them.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import replace
from functools import cache
from itertools import chain
from pathlib import Path
from typing import Any

from forge.base.cmake_syntax import cmake_arguments
from forge.base.distributions import OLDEST
from forge.base.errors import HostError, Problem
from forge.base.extensions import OWN, RECIPES, call, checked, find
from forge.base.frozen import Pairs, frozen
from forge.base.layout import PACKAGE, Layout
from forge.base.text import digest
from forge.build.tasks import Step, StepKind
from forge.build.up_to_date import MANIFEST, RECIPE, UMASK
from forge.toolchain.cmake_variables import BUILD_TESTING, defined
from forge.workspace.model import DependencyKind, Package


@frozen
class BuildContext:
    """The tools and options that all packages of one build share.

    `python` is the workspace's interpreter, `site_packages` its module folder relative to a prefix. `wheels`
    is the argv prefix that builds a Python package, `generator` the one that CMake runs for each interface
    package, `tools` are the identities of the tools by name.
    """

    root: Path
    layout: Layout
    python: Path
    site_packages: str
    wheels: tuple[str, ...]
    generator: tuple[str, ...]
    rosdistro: str = OLDEST
    """The ROS distribution whose interfaces the embedded packages contain."""
    tools: Pairs = ()
    cmake: Path | None = None
    ninja: Path | None = None
    make: Path | None = None
    only_make: frozenset[str] = frozenset()
    """Packages that Ninja cannot build."""
    load_limit: float | None = None
    cmake_args: tuple[str, ...] = ()
    ament_cmake_args: tuple[str, ...] = ()
    """Arguments of packages with ament, which `of` adds to `cmake_args`."""
    launcher: Path | None = None
    """The compiler launcher, for example ccache."""
    recipes: tuple[str, ...] = ()
    """The names of the extensions of recipes."""
    embedded: frozenset[str] = frozenset()
    """The names of embedded packages in this workspace if they differ from those of a distribution."""
    test_results: Path | None = None
    """The folder for the results of ament tests, instead of the build folders."""
    umask: int = 0
    force_configure: bool = False
    clean_cache: bool = False
    clean_first: bool = False
    target: str | None = None
    skip_target: bool = False
    """Skip the target in packages that do not have it."""
    environment_generator: str | None = None
    path_maps: Pairs = ()
    """For each CMake language, the flags that keep workspace paths out of compiled files."""
    cargo_args: tuple[str, ...] = ()
    toolchains: Pairs = ()
    """For build types of plugins, an option that identifies their toolchain."""
    no_test_dependencies: bool = False
    """Do not build the tests of packages with dependencies that only tests need."""
    flags: Pairs = ()
    """For each of these languages, the flags set by the environment."""

    def source(self, package: Package) -> Path:
        return self.root / package.path

    def links(self, package: Package) -> bool:
        """Return whether files are symlinked into the prefix; not for embedded ones, which upgrades move."""
        return self.layout.symlink and not package.embedded

    def of(self, package: Package) -> BuildContext:
        """Return the context for one package: `cmake_args` are all CMake arguments of the package.

        Embedded packages compile nothing, so options that only affect compilation are removed for them.
        """
        if package.embedded:
            word_lists = (
                argument.words
                for argument in cmake_arguments(self.cmake_args)
                if not (argument.definition and re.fullmatch(_COMPILING, argument.definition[0]))
            )
            arguments = tuple(chain.from_iterable(word_lists))
            return replace(self, cmake_args=arguments, ament_cmake_args=(), test_results=None, path_maps=())
        arguments = (*self.cmake_args, *package.option_values("cmake-args"))
        if package.build_type == "ament_cmake":
            arguments += (*self.ament_cmake_args, *package.option_values("ament-cmake-args"))
        # Other packages lack the option, so that it does not rebuild them.
        if self.no_test_dependencies and package.only_tested_with and BUILD_TESTING not in defined(arguments):
            arguments += (f"-D{BUILD_TESTING}=OFF",)
        if not package.settings and arguments == self.cmake_args:
            return self
        return replace(
            self,
            cmake_args=arguments,
            ament_cmake_args=(),
            target=self.target or next(iter(package.option_values("cmake-target")), None),
            skip_target=self.skip_target or bool(package.settings.get("cmake-target-skip-unavailable")),
        )


@frozen
class Recipe:
    """The steps of one package, and the files that forge writes or removes before the first one.

    `clean` are the results of earlier tests to remove before the first step of a test run; names may be glob
    patterns.
    """

    steps: tuple[Step, ...] = ()
    files: tuple[tuple[Path, str], ...] = ()
    clean: tuple[Path, ...] = ()
    kept: tuple[str, ...] = ()
    """Names in the build folder that are kept for later builds: the build tool tracks their inputs."""


@frozen
class Addition:
    """Additions of a recipe extension to the recipe of a package."""

    files: tuple[tuple[Path, str], ...] = ()
    """Files that forge writes before the first step, usually into `scratch_folder`.

    CMake includes those named *.cmake at the end of project(), and runs again if one of them changes.
    """
    build_launcher: tuple[str, ...] = ()
    """The argv prefix of the step that builds."""


def install_tree(package: Package, context: BuildContext, staged: Path) -> Step:
    """Return the step that installs all files below `staged`, a folder with the layout of the prefix.

    Build systems that stage (`DESTDIR`) need it in a merged install folder, where forge must know which files
    belong to which package.
    """
    build, prefix = context.layout.build_dir(package.name), context.layout.prefix(package.name)
    program = (sys.executable, "-S", "-E", str(PACKAGE / "build/recipes/install_tree.py"))
    argv = (*program, str(staged), str(prefix), str(build / "install_manifest.txt"))
    return Step(StepKind.INSTALL, argv, build)


_COMPILING = (
    r"BUILD_TESTING|CMAKE_(BUILD_TYPE|EXPORT_COMPILE_COMMANDS|VERBOSE_MAKEFILE|COLOR_(DIAGNOSTICS|MAKEFILE)"
    r"|(C|CXX|CUDA|Fortran)_(COMPILER|COMPILER_LAUNCHER|FLAGS|FLAGS_[A-Z]+|STANDARD|STANDARD_REQUIRED|EXTENSIONS)"
    r"|(EXE|SHARED|MODULE|STATIC)_LINKER_FLAGS(_[A-Z]+)?|POSITION_INDEPENDENT_CODE|INTERPROCEDURAL_OPTIMIZATION"
    r"|POLICY_DEFAULT_CMP0069"
    r"|UNITY_BUILD|LINKER_TYPE|BUILD_RPATH|INSTALL_RPATH|INSTALL_RPATH_USE_LINK_PATH)"
)
"""CMake variables that only affect compiling, linking, tests, or the messages of the build."""


def common_options(package: Package, context: BuildContext) -> tuple[str, ...]:
    """Return the options shared by all build types.

    The first ones are those of COMMON_OPTIONS; the last is the evaluated manifest.
    """
    layout = context.layout
    return (
        layout.word,
        str(context.root / package.path),
        str(layout.build_dir(package.name)),
        str(layout.prefix(package.name)),
        str(context.python),
        context.site_packages,
        *(("--symlink-install",) if context.links(package) else ()),
        *((f"{UMASK}{context.umask:03o}",) if context.umask else ()),
        *(option for name, option in context.toolchains if name == package.build_type),
        *(() if package.embedded else (f"{MANIFEST} {_manifest(package)}",)),
    )


def _manifest(package: Package) -> str:
    """Return a digest of the manifest after evaluating conditions, groups and external settings."""
    manifest = package.manifest
    parts = [package.type, *package.hooks, "", *manifest.groups, "", *manifest.group_dependencies, ""]
    for dependency in manifest.dependencies:
        parts += (dependency.name, _kinds(dependency.kinds), *map("".join, dependency.versions))
    return digest(*parts)


@cache
def _kinds(kinds: frozenset[DependencyKind]) -> str:
    return " ".join(sorted(kind.value for kind in kinds))


@frozen
class RecipeExtension:
    """The interface of a recipe extension. Only `running` starts programs and writes files."""

    options: Callable[[Package, BuildContext], tuple[str, ...]]
    """Returns further inputs of a package, which is built again when one of them changes."""
    addition: Callable[[Package, BuildContext], Addition]
    """Returns the additions to the recipe of a package."""
    running: Callable[
        [Sequence[Package], BuildContext, Mapping[str, str], Pairs], AbstractContextManager[Mapping[str, str]]
    ]
    """Returns a context that is open while these packages are built; it yields variables for their steps.

    Variables whose names begin with FORGE_ are valid during this build only: printed commands and
    environment.sh leave them out. The mapping is the environment of the build, and the pairs are the inputs
    of every compilation. Not called for an audit, which observes each step.
    """


def active_extensions(context: BuildContext) -> Iterator[RecipeExtension]:
    """Yield the extensions of a build; raises ForgeError if one does not exist or cannot be loaded."""
    return map(_extension, context.recipes)


@cache
def _extension(name: str) -> RecipeExtension:
    module = find(RECIPES, name, "recipe", ("options", "addition", "running"))
    if module is None:
        hint = f"install it beside forge, source its workspace, or remove '{name}' from '--recipes'"
        raise HostError(Problem(f"no installed distribution provides the recipe '{name}'", hint=hint))
    if name in OWN[RECIPES]:
        return RecipeExtension(module.options, module.addition, module.running)
    return _checked(f"{RECIPE}'{name}'", module)


def _checked(what: str, module: Any) -> RecipeExtension:
    """Turn exceptions and wrong results of another distribution's extension into ForgeErrors."""
    from forge.build.inputs.fingerprints import code_digest

    options = checked(what, module.options, tuple)

    @contextmanager
    def running(*arguments: object) -> Iterator[Mapping[str, str]]:
        with ExitStack() as stack:
            yield call(what, lambda: stack.enter_context(module.running(*arguments)))

    return RecipeExtension(
        lambda *arguments: (*options(*arguments), f"{what} {code_digest(module)}"),
        checked(what, module.addition, Addition),
        running,
    )
