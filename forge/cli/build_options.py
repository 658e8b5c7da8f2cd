"""The options of `forge build`."""

from __future__ import annotations

import os

from forge.base.distributions import check_distribution, distribution_option
from forge.base.errors import HostError, Problem, SelectionError
from forge.base.extensions import OPTIONS, REPORTERS, absent, find
from forge.base.frozen import frozen
from forge.base.options import flag, option, options_of
from forge.base.text import listed
from forge.cache.options import CacheOptions
from forge.cli.options import FolderOptions, OptionSources
from forge.execution.executor import ExecutorOptions
from forge.execution.options import JobOptions
from forge.output.handlers import ReportOptions
from forge.output.reporters import Start
from forge.toolchain.compiler_launchers import LAUNCHERS, NONE
from forge.toolchain.targets import CrossOptions
from forge.workspace.selection import Query

_OUTPUT = ReportOptions.GROUP
_NO_EFFECT = "no effect, for compatibility with colcon"
_PAGE = "page"
_TIMINGS = (_PAGE, "headers", "live")


def _timings(text: str) -> str:
    for word in text.split(","):
        if word not in _TIMINGS:
            raise ValueError(f"unknown kind of timings '{word}': use {listed(_TIMINGS[1:])}")
    return text


@frozen
class CMakeOptions:
    GROUP = "CMake options"

    cmake_args: tuple[str, ...] = option(
        "arguments for CMake, for all packages; takes all arguments up to the next option of colcon",
        default=(),
        metavar="ARG",
    )
    ament_cmake_args: tuple[str, ...] = option(
        "arguments for CMake, for ament_cmake packages only", default=(), metavar="ARG"
    )
    compiler_launcher: str | None = option(
        "compiler cache or distributed compiler to run the C and C++ compilers through (default: none)",
        default_factory=lambda: os.environ.get("FORGE_COMPILER_LAUNCHER") or None,
        choices=(*LAUNCHERS, NONE),
    )
    no_toolchain_cache: bool = flag("let CMake detect compilers in each package")
    cmake_force_configure: bool = flag("run CMake's configure step in any case")
    cmake_clean_cache: bool = flag(
        "remove CMake's cache before configuring (implies --cmake-force-configure)"
    )
    cmake_clean_first: bool = flag("run the target 'clean' before building")
    cmake_target: str | None = option(
        "build this target before the default target; packages without it fail", metavar="TARGET"
    )
    cmake_target_skip_unavailable: bool = flag("ignore packages without the target of --cmake-target")
    no_fast_rosidl: bool = flag(
        "disable the rosidl accelerator: start each generator and script separately, and compile each "
        "generated source on its own",
    )
    recipes: tuple[str, ...] = option(
        "extend the steps of CMake packages by these plugins",
        default=(),
        metavar="NAME",
    )
    catkin_cmake_args: tuple[str, ...] = option(_NO_EFFECT, default=(), metavar="ARG")
    catkin_skip_building_tests: bool = flag(_NO_EFFECT)


@frozen
class BuildOptions:
    GROUP = "build options"

    query: Query = options_of(Query)
    sources: OptionSources = options_of(OptionSources)
    folders: FolderOptions = options_of(FolderOptions)
    origin: str = os.curdir
    """The folder in which the command was typed, relative to the workspace."""
    is_rebuild: bool = False
    """Whether this is a build of `--watch` after the first."""

    symlink_install: bool = flag("install symbolic links instead of copies where possible")
    continue_on_error: bool = flag("keep building packages that do not depend on a failed package")
    skip_keys: tuple[str, ...] = option(
        "do not warn of these missing dependencies", default=(), metavar="KEY", accumulates=True
    )
    force: bool = flag("rebuild the selected packages even if they are up to date")
    reset_underlays: bool = flag("forget underlays of earlier builds unless they are sourced now")
    python: str | None = option(
        "interpreter to build with and for (default: that of the active virtual environment, else that of "
        "the sourced underlay, else 'python3' on PATH)",
        metavar="PATH",
    )
    rosdistro: str | None = distribution_option()
    cargo_args: tuple[str, ...] = option(
        "arguments for `cargo build`, for all packages; takes all arguments up to the next option of colcon",
        default=(),
        metavar="ARG",
    )
    test_result_base: str | None = option(
        "folder for results of ament's tests (default: the build folders); pass the same folder to "
        "'forge test'",
        metavar="DIR",
    )
    explain: bool = flag(
        "explain why each package is built: the file, option, variable, tool or dependency that changed",
        group=_OUTPUT,
    )
    watch: bool = flag("build, then rebuild whenever a source file changes, until Ctrl-C", group=_OUTPUT)
    timings: str | None = option(
        "write an HTML report of build times and a trace file into the log folder; 'headers' adds the time "
        "that clang needs for each header, 'live' serves a page that shows the running build",
        nargs="?",
        const=_PAGE,
        parse=_timings,
        metavar="headers,live",
        group=_OUTPUT,
    )
    timings_compare: str | None = option(
        "like --timings, and compare with the build of this log folder (default: the previous build)",
        nargs="?",
        const="",
        metavar="LOG",
        group=_OUTPUT,
    )
    audit: bool = flag(
        "rebuild the selected packages from empty build folders, and report files they read without "
        "declaring them",
        group=_OUTPUT,
    )
    no_observer: bool = flag(
        "do not observe what the steps read and write: after any change of a package or its dependencies, it "
        "is built from an empty folder",
    )
    dry_run: bool = flag("print the build plan and all commands without running them", group=_OUTPUT)
    print_command: str | None = option(
        "print a command line that repeats the last step of a package", metavar="PKG", group=_OUTPUT
    )
    cmake: CMakeOptions = options_of(CMakeOptions)
    cross: CrossOptions = options_of(CrossOptions)
    cache: CacheOptions = options_of(CacheOptions)
    jobs: JobOptions = options_of(JobOptions)
    execution: ExecutorOptions = options_of(ExecutorOptions)
    report: ReportOptions = options_of(ReportOptions)

    @property
    def has_timings(self) -> bool:
        """Whether to report the times of this build."""
        return self.timings is not None or self.timings_compare is not None

    @property
    def reporters(self) -> dict[str, Start]:
        """Return the reporters of this build; raises ForgeError if one is missing."""
        if not self.has_timings:
            return self.report.reporters()
        timings = find(REPORTERS, "timings", "reporter").start_of(self)
        return {**self.report.reporters("timings"), "timings": timings}

    @property
    def forced_by(self) -> str:
        """Return the option that rebuilds packages even if they are up to date, '' if there is none."""
        if self.is_rebuild:
            return ""
        forcing = {
            "--audit": self.audit,
            "--force": self.force,
            "--cmake-force-configure": self.cmake.cmake_force_configure,
            "--cmake-clean-cache": self.cmake.cmake_clean_cache,
            "--cmake-clean-first": self.cmake.cmake_clean_first,
            "--cmake-target": bool(self.cmake.cmake_target),
        }
        return next((word for word, given in forcing.items() if given), "")

    def check(self) -> None:
        """Raise ForgeError for options that exclude each other, and for invalid values."""
        check_distribution(self.rosdistro)
        self.execution.check()
        self.cache.check()
        self.cross.check(self.folders.target)
        if self.folders.target and not self.execution.is_local:
            word = f"'--executor {self.execution.executor}'"
            hint = f"remove {word} or '--target'"
            message = f"--target cannot be combined with {word}: its compilers are on this machine"
            raise SelectionError(Problem(message, hint=hint))
        if self.audit:
            find(OPTIONS, "audit", "option").check(self)
        for word, value in (("--dry-run", self.dry_run), ("--print-command", self.print_command)):
            if self.watch and value:
                message = f"'--watch' cannot be combined with '{word}'"
                raise SelectionError(Problem(message, hint="remove one of them"))
        if self.explain and (problem := absent(OPTIONS, "explain", "option")):
            raise HostError(problem)
        _ = self.reporters, self.folders.level  # raises ForgeError for invalid values
        if self.has_timings:
            self.folders.require_logs()
