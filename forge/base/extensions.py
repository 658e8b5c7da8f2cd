"""Plugins: extensions of forge by itself and by other distributions, announced as entry points.

The core finds a plugin by the group and the name of its entry point and never imports one by module name.
Finding the entry points of other distributions reads the metadata of all installed ones, which takes longer
than most builds. So this is done only for names that are neither in the core nor in `OWN`.
docs/how-to/plugins.md describes the groups.
"""

from __future__ import annotations

import sys
from functools import cache
from importlib import import_module
from typing import TYPE_CHECKING, Any, TypeVar

from forge.base.errors import ForgeError, HostError, Location, Problem
from forge.base.layout import PACKAGE, docs_url

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from importlib.metadata import EntryPoint

COMMANDS = "forge.commands"
FORMATS = "forge.interfaces.formats"
SERIALIZERS = "forge.interfaces.serializers"
TARGETS = "forge.interfaces.targets"
VERBS = "forge.interfaces.verbs"
PKG_VERBS = "forge.pkg.verbs"
BUILD_TYPES = "forge.build_types"
EXECUTORS = "forge.executors"
STORES = "forge.stores"
REPORTERS = "forge.reporters"
RECIPES = "forge.recipes"
TOOLCHAINS = "forge.toolchains"
UNDERLAYS = "forge.underlays"
CACHES = "forge.caches"
OPTIONS = "forge.options"
HINTS = "forge.hints"
SUGGESTIONS = "forge.suggestions"

OWN: Mapping[str, Mapping[str, str]] = {
    COMMANDS: {
        "add": "forge.plugins.fetch.add",
        "bundle": "forge.plugins.bundle.command",
        "cache": "forge.plugins.package_cache.command",
        "clean": "forge.plugins.clean.command",
        "completion": "forge.plugins.completion.command",
        "deps": "forge.plugins.system_deps.command",
        "doctor": "forge.plugins.doctor.command",
        "env": "forge.plugins.shell.env",
        "extensions": "forge.plugins.extensions.command",
        "fetch": "forge.plugins.fetch.command",
        "graph": "forge.plugins.charts.command",
        "ignore": "forge.plugins.ignore.command",
        "info": "forge.plugins.info.command",
        "init": "forge.plugins.init.command",
        "lsp": "forge.plugins.lsp.command",
        "mixin": "forge.plugins.mixins.command",
        "shell": "forge.plugins.shell.shell",
        "test-result": "forge.plugins.test_results.command",
    },
    FORMATS: {"idl": "forge.plugins.idl.parsing"},
    SERIALIZERS: {"python": "forge.plugins.python_cdr.target"},
    TARGETS: {
        "arrow": "forge.plugins.arrow.target",
        "c": "forge.plugins.c_target.target",
        "docs": "forge.plugins.interface_pages.markdown",
        "jsonschema": "forge.plugins.json_schema.target",
        "protobuf": "forge.plugins.protobuf.target",
        "typescript": "forge.plugins.typescript.target",
    },
    VERBS: {
        "diff": "forge.plugins.interface_versions.diff",
        "docs": "forge.plugins.interface_pages.command",
        "fix": "forge.plugins.interface_versions.fix",
        "hash": "forge.plugins.interface_queries.hash",
        "proto": "forge.plugins.interface_queries.proto",
        "schema": "forge.plugins.interface_queries.schema",
    },
    PKG_VERBS: {"create": "forge.plugins.create.command"},
    TOOLCHAINS: {"cross": "forge.plugins.cross.toolchain"},
    BUILD_TYPES: {
        "ament_cargo": "forge.plugins.cargo.build_type",
        "cargo": "forge.plugins.cargo.build_type",
        "python": "forge.plugins.pyproject.build_type",
    },
    STORES: {
        "fsspec": "forge.plugins.remote_cache.fsspec_backend",
        "http": "forge.plugins.remote_cache.http_backend",
        "https": "forge.plugins.remote_cache.http_backend",
    },
    EXECUTORS: {"dask": "forge.plugins.dask.executor"},
    UNDERLAYS: {"forge.lock": "forge.plugins.fetch.underlay"},
    CACHES: {"ros": "forge.plugins.fetch.cache"},
    OPTIONS: {
        "advice-cmake-arguments": "forge.plugins.advice.cmake_arguments",
        "advice-executables": "forge.plugins.advice.executables",
        "advice-preflight": "forge.plugins.advice.preflight",
        "advice-surroundings": "forge.plugins.advice.surroundings",
        "advice-system-python": "forge.plugins.advice.system_python",
        "audit": "forge.plugins.audit.audit",
        "cache": "forge.plugins.package_cache.opening",
        "cached": "forge.plugins.cached_tests.cached",
        "changes": "forge.plugins.explain.changes",
        "compile_commands": "forge.plugins.compile_commands.merging",
        "compiler-launcher": "forge.plugins.compiler_launchers.statistics",
        "explain": "forge.plugins.explain.explain",
        "gcc-heap": "forge.plugins.gcc_heap.heap",
        "ignored-packages": "forge.plugins.ignore.ignoring",
        "library-abi": "forge.plugins.library_abi.relinking",
        "missing-packages": "forge.plugins.failure_hints.missing",
        "failed-tests": "forge.plugins.single_tests.failures",
        "first-error": "forge.plugins.failure_hints.first_error",
        "mixin": "forge.plugins.mixins.mixins",
        "outdated-tests": "forge.plugins.explain.outdated",
        "package-memory": "forge.plugins.package_memory.measuring",
        "packages-select-build-failed": "forge.plugins.last_results.results",
        "packages-select-changed": "forge.plugins.git_changes.changes",
        "partial-install": "forge.plugins.partial_installs.install_scripts",
        "python-pitfalls": "forge.plugins.pyproject.pitfalls",
        "restored-tests": "forge.plugins.package_cache.restored_tests",
        "retest-until-pass": "forge.plugins.flaky_tests.retests",
        "single-tests": "forge.plugins.single_tests.selection",
        "strict": "forge.plugins.lint.lint",
        "test-domains": "forge.plugins.test_domains.domains",
        "toolchain-cache": "forge.plugins.compiler_probe.probe",
        "warnings": "forge.plugins.warnings.warnings",
        "watch": "forge.plugins.watch.watch",
    },
    RECIPES: {"fast_rosidl": "forge.plugins.fast_rosidl.recipe"},
    HINTS: {"failures": "forge.plugins.failure_hints.hints"},
    SUGGESTIONS: {"words": "forge.plugins.suggestions.suggestions"},
    REPORTERS: {
        "coverage": "forge.plugins.coverage.reporter",
        "event_log": "forge.plugins.colcon_logs.reporter",
        "github": "forge.plugins.ci.github",
        "gitlab": "forge.plugins.ci.gitlab",
        "status": "forge.plugins.charts.status",
        "timings": "forge.plugins.charts.reporter",
    },
}
"""The plugins in forge/plugins/: modules by group and name, as in the entry points of pyproject.toml."""

PACKAGE_FILES: Mapping[str, str] = {"setup.py": "python", "pyproject.toml": "python", "Cargo.toml": "cargo"}
"""Files that make a folder a package without package.xml, and the build types of plugins that read them."""

_EXTRAS = {"remote_cache": "remote", "system_deps": "rosdep"} | {
    name: name for name in ("arrow", "cross", "dask", "fetch", "lsp", "protobuf")
}
"""The extra with the dependencies of a plugin, if it has any."""

_Result = TypeVar("_Result")


def find(group: str, name: str, kind: str, functions: tuple[str, ...] = ()) -> Any:
    """Return the plugin `name` of a group, None for an unknown name; `kind` names it in messages.

    Raises ForgeError if it is not installed, cannot be loaded, or lacks one of `functions`.
    """
    if name not in OWN.get(group, ()):
        entry = entry_points(group).get(name)
        return None if entry is None else load(entry, kind, functions)
    if problem := absent(group, name, kind):
        raise HostError(problem)
    return import_module(OWN[group][name])


@cache
def is_installed(group: str, name: str) -> bool:
    """Return whether one of forge's own plugins is installed, without importing it."""
    return (PACKAGE / OWN[group][name].partition(".")[2].replace(".", "/")).with_suffix(".py").is_file()


def installed(group: str) -> list[str]:
    return [name for name in OWN.get(group, ()) if is_installed(group, name)]


def own_plugin(group: str, name: str) -> Any | None:
    """Return one of forge's own plugins, None if it is not installed."""
    return import_module(OWN[group][name]) if is_installed(group, name) else None


def absent(group: str, name: str, kind: str) -> Problem | None:
    """Return a remedy if `name` is one of forge's own plugins that is not installed."""
    if name not in OWN.get(group, ()) or is_installed(group, name):
        return None
    plugin = OWN[group][name].split(".")[2]
    extra = f" with the extra '{_EXTRAS[plugin]}'" if plugin in _EXTRAS else ""
    message = f"the {kind} '{name}' needs the plugin '{plugin}', which is not installed"
    # No command: on a package index, another project may own the name of forge's distribution.
    page = docs_url("how-to/upgrading.md#extras")
    return Problem(message, hint=f"reinstall forge{extra}; see {page}")


def entry_points(group: str) -> Mapping[str, EntryPoint]:
    """Return the entry points of other distributions by name; of several, the first on sys.path."""
    return _entry_points(group, tuple(sys.path))


@cache
def _entry_points(group: str, _search_path: tuple[str, ...]) -> Mapping[str, EntryPoint]:
    from importlib.metadata import entry_points as search

    own = OWN.get(group, {})
    entries: dict[str, EntryPoint] = {}
    for entry in search(group=group):
        if own.get(entry.name) != entry.value:
            entries.setdefault(entry.name, entry)
    return dict(sorted(entries.items()))


def load(entry: EntryPoint, kind: str, functions: tuple[str, ...]) -> Any:
    """Return the object of an entry point; raises ForgeError if it lacks one of `functions`."""
    try:
        extension = entry.load()
    except Exception as error:
        raise ForgeError(_unusable(entry, kind, f"{type(error).__name__}: {error}")) from error
    missing = next((name for name in functions if not callable(getattr(extension, name, None))), None)
    if missing is not None:
        raise ForgeError(_unusable(entry, kind, f"it has no function '{missing}'"))
    return extension


def call(what: str, function: Callable[..., _Result], *arguments: object) -> _Result:
    """Call a function of a plugin; if it raises, raise ForgeError with `what` failed and where."""
    try:
        return function(*arguments)
    except ForgeError:
        raise
    except Exception as error:
        import traceback

        frame = traceback.extract_tb(error.__traceback__)[-1]
        message = f"{what} failed: {type(error).__name__}: {error}"
        hint = "this is an error in the extension: report it to its authors"
        raise ForgeError(Problem(message, Location(frame.filename, frame.lineno), hint)) from error


def checked(what: str, function: Callable[..., _Result], wanted: type[_Result]) -> Callable[..., _Result]:
    """Return a function of a plugin that raises ForgeError for exceptions and results of other types."""

    def run(*arguments: object) -> _Result:
        result = call(what, function, *arguments)
        if not isinstance(result, wanted):
            message = f"{what} returned {type(result).__name__} instead of a {wanted.__name__}"
            raise ForgeError(Problem(message))
        return result

    return run


def first_answer(group: str, kind: str, function: str, *arguments: object) -> str:
    """Return the first answer but '' of the plugins of a group; forge's own plugins are asked first."""
    for name in (*installed(group), *entry_points(group)):
        ask: Callable[..., str] = getattr(find(group, name, kind, (function,)), function)
        if name not in OWN[group]:
            ask = checked(f"the {kind} '{name}'", ask, str)
        if answer := ask(*arguments):
            return answer
    return ""


def distribution_of(entry: EntryPoint) -> str:
    return f"{entry.dist.name} {entry.dist.version}" if entry.dist else "an unknown distribution"


def _unusable(entry: EntryPoint, kind: str, reason: str) -> Problem:
    hint = (
        f"fix or remove '{distribution_of(entry)}', which has this entry point of the group '{entry.group}'"
    )
    return Problem(f"the {kind} '{entry.name}' cannot be loaded from '{entry.value}': {reason}", hint=hint)
