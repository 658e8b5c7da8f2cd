"""The audit of a build: inputs of commands that neither a build rule nor a manifest declares.

The steps are observed in any case; the audit compares the files that their processes read with the build
graph and the dependencies of the package.
"""

from __future__ import annotations

import os
import re
import sys
from functools import cache
from pathlib import Path
from posixpath import basename, dirname, isfile
from typing import TYPE_CHECKING

from forge.base.env_vars import own_cache
from forge.base.errors import HostError, Problem, SelectionError
from forge.base.frozen import frozen
from forge.base.layout import BACKUP_DIR, OWN_CACHE_DIR, PACKAGE, Layout, own_folders
from forge.base.text import counted
from forge.build.inputs.native_graph import Edge, EdgeFinder, cmake_root
from forge.build.tasks import StepKind
from forge.engine.commands import CACHED_BYTECODE
from forge.engine.observer import compile_library
from forge.environment.prefixes import find_underlays
from forge.toolchain.compiler_launchers import selected_launcher

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from forge.build.inputs.native_graph import NativeGraph
    from forge.build.model import BuildRecord
    from forge.build.observed_writes import ObservedSteps
    from forge.build.recipes.context import BuildContext
    from forge.build.tasks import Task
    from forge.cli.build_options import BuildOptions
    from forge.engine.observation import Process
    from forge.workspace.model import Package

_MAKE = frozenset({"make", "gmake"})
_SYSTEM = ("bin", "dev", "etc", "lib", "lib32", "lib64", "libx32", "proc", "run", "sbin", "sys", "usr")
_NO_INPUTS = re.compile(r"/(\.git|\.hg|\.svn|__pycache__|[^/]+\.(dist|egg)-info)(/|$)|\.pth$")
"""Version control, bytecode, and metadata that Python reads for every distribution it finds."""
_OF_CMAKE = re.compile(
    r"(.*/)?CMakeFiles/|CMakeCache\.txt$|\.forge/|(.*/)?cmake_install\.cmake$|build\.ninja$"
)
"""Files in a build folder that CMake and forge write for themselves."""
_TARGET = re.compile(r"CMakeFiles/([^/]+)\.dir\b")
_LINKS = re.compile(r"\w+_(STATIC_LIBRARY|SHARED_LIBRARY|SHARED_MODULE|MODULE_LIBRARY|EXECUTABLE)_LINKER_")
_PARTS = 5
"""The number of leading parts of a path in an underlay that are searched for the name of its package."""
_MAX_LISTED = 3
"""The maximum number of files of one folder that are listed; beyond it, only their number is reported."""


def check(options: BuildOptions) -> None:
    """Raise SelectionError for options that exclude an audit."""
    without_audit = {
        "--watch": options.watch,
        f"--executor {options.execution.executor}": not options.execution.is_local,
        "a package cache (--cache, --remote-cache)": options.cache.wanted,
        "--compiler-launcher": selected_launcher(options.cmake.compiler_launcher),
        "--target": options.folders.target,
        "--no-observer": options.no_observer,
    }
    if any(without_audit.values()):
        words = ", ".join(word for word, given in without_audit.items() if given)
        message = f"--audit cannot be combined with {words}: all steps must be observed on this machine"
        hint = "remove these options, including those in forge.toml and the environment"
        raise SelectionError(Problem(message, hint=hint))


def require_observer(layout: Layout, variables: Mapping[str, str]) -> None:
    """Raise HostError if steps cannot be observed on this machine."""
    if compile_library(own_cache(variables) or layout.build / OWN_CACHE_DIR, variables) is None:
        message = "'--audit' cannot observe programs here: its library could not be compiled"
        hint = "install a C compiler, for example with `apt install gcc` or `dnf install gcc` (Linux only)"
        raise HostError(Problem(message, hint=hint))


@frozen
class Finding:
    """A file that a package read without declaring it, the reader, and the line to add.

    In `what` and `hint`, `{path}` represents the file.
    """

    what: str
    path: str
    hint: str


class Audit:
    """Collects the reads of the packages of a build; each thread adds only its own package."""

    def __init__(
        self,
        context: BuildContext,
        packages: Mapping[str, Package],
        records: Mapping[str, BuildRecord],
        variables: Mapping[str, str],
    ) -> None:
        """Audit packages among all `packages` of the workspace; `records` are the records of the journal."""
        self._layout = context.layout
        self.is_merged = context.layout.merged
        self._records = records
        self._sources = {
            os.path.realpath(context.root / package.path): name
            for name, package in packages.items()
            if not package.embedded
        }
        self._packages = frozenset(packages)
        self._names = frozenset(self._sources.values())
        self._install, self._build = map(os.path.realpath, (self._layout.install, self._layout.build))
        underlays = find_underlays(variables, self._layout.install)
        roots = {os.path.realpath(path) for path in (*underlays.prefixes, *underlays.chain)}
        self._underlays = tuple(sorted(roots - {"/", "/usr", "/usr/local"}))
        self._tools = tuple(f"{folder.rstrip('/')}/" for folder in _tools(context, variables))
        self.findings: dict[str, list[Finding]] = {}
        self.unobserved: dict[str, tuple[str, ...]] = {}

    def collect(self, task: Task, steps: ObservedSteps, graph: NativeGraph) -> None:
        """Compare the files that the steps of a package read with the declared ones."""
        package = _Package(self, task, graph, dict(self._records))
        finder = EdgeFinder(graph)
        for process in steps.observed.processes:
            kind = steps.kinds.get(process.pid, "") if process.parent is None else ""
            family = process.family()
            if kind == StepKind.CONFIGURE.value:
                package.compare(family, graph.read_by_cmake, "cmake", _CONFIGURES)
            elif kind and kind not in {StepKind.BUILD.value, StepKind.BUILD_TARGET.value}:
                package.compare(family)  # install rules and Python packages declare their inputs
            # Only ninja reports the inputs that its rules declare.
            elif graph.tool and process.parent and _runs_rules(process.parent) and not _runs_rules(process):
                written = frozenset(word for each in family for _, kind, word in each.records if kind == "W")
                if edge := finder(process, written):
                    output = os.path.relpath(edge.outputs[0], task.build_dir)
                    package.compare(family, edge, f"'{output}'", _hint(edge, output))
                else:
                    package.compare(family, graph.known(), "", _UNKNOWN)
        unseen = dict.fromkeys(steps.observed.blind)
        for process in steps.observed.processes:
            unseen |= {word: None for _, kind, word in process.records if kind == "B"}
        self.unobserved[task.name] = tuple(
            word if " " in word else f"a call of {word}() cannot be observed" for word in unseen
        )
        self.findings[task.name] = list(package.found.values())

    def report(self, done: Iterable[str]) -> tuple[tuple[str, ...], bool]:
        """Return the lines for the packages that were built, and True if everything was declared."""
        names = [name for name in done if name in self.findings]
        lines = [line for name in names for line in _lines(name, self.findings[name])]
        lines += (
            f"{name}: {what}; its inputs are unknown" for name in names for what in self.unobserved[name]
        )
        incomplete = [name for name in names if self.findings[name]]
        unobserved_count = sum(bool(self.unobserved[name]) for name in names)
        if incomplete:
            number = sum(len(self.findings[name]) for name in incomplete)
            reads = "reads" if len(incomplete) == 1 else "read"
            of_them = (
                f"{len(incomplete)} of {counted(len(names), 'package')} {reads} {counted(number, 'file')}"
            )
            summary = f"audit: {of_them} without declaring {'it' if number == 1 else 'them'}"
        else:
            summary = f"audit: {counted(len(names), 'package')}, no undeclared inputs"
        lines.append(
            summary + (f"; {unobserved_count} could not be observed completely" if unobserved_count else "")
        )
        return tuple(lines), not incomplete

    def provider(self, path: str, owners: Mapping[str, str]) -> tuple[str, str]:
        """Return the package that a real path belongs to, and its kind of location.

        'install', 'underlay', 'source' ... The package is '' if the path belongs to none. It is 'tool' for
        files that are not inputs.
        """
        if path.startswith(f"{self._install}/"):
            name = owners.get(path, "")
            if not self._layout.merged:
                name = path[len(self._install) + 1 :].partition("/")[0]
            return (name, "install") if name in self._packages else ("", "tool")
        if path.startswith(f"{self._build}/"):
            name = path[len(self._build) + 1 :].partition("/")[0]
            return (name, "build") if name in self._packages else ("", "tool")
        for prefix in self._underlays:
            if path.startswith(f"{prefix}/"):
                name = self._in_underlay(Path(prefix).name, path[len(prefix) + 1 :].split("/"))
                return (name, "underlay") if name else ("", "tool")
        folder = path
        while folder != "/":
            folder = dirname(folder)
            if folder in self._sources:
                return self._sources[folder], "source"
        return ("", "tool") if f"{path}/".startswith(self._tools) else ("", "file")

    def _in_underlay(self, prefix: str, parts: list[str]) -> str:
        """Return the package of this workspace that also provides an underlay's file, or ''."""
        library = re.match(r"lib(\w+?)(__\w+)?\.(so|a)\b", parts[-1])
        candidates = (prefix, *parts[:_PARTS], library[1] if library else "")
        return next((name for name in candidates if name in self._names), "")


class _Package:
    """The comparison for one package."""

    def __init__(
        self, audit: Audit, task: Task, graph: NativeGraph, records: Mapping[str, BuildRecord]
    ) -> None:
        self._audit, self._task, self._graph = audit, task, graph
        self._build = os.path.realpath(task.build_dir)
        self._declared = {task.name, *task.needs}
        install = records.items() if audit.is_merged else ()
        self._owners = {
            _canonical(path): name
            for name, record in sorted(install, key=lambda item: item[0] in self._declared)
            for path in record.files
        }
        self._made = {output: edge for edge in graph.edges for output in edge.outputs}
        self._cmake = f"{cmake_root(task.build_dir).rstrip('/')}/"
        self._providers: dict[str, tuple[str, str]] = {}
        self.found: dict[str, Finding] = {}

    def compare(
        self,
        processes: Iterable[Process],
        declares: Edge | Iterable[str] | None = None,
        product: str = "",
        hint: str = "",
    ) -> None:
        """Compare the files that a command read with those that its edge, or the given files, declare.

        Without either, only the dependencies of the package count.
        """
        declared: frozenset[str] | None = None
        for program, path in self._reads(processes):
            if declares is None or (product in {"", "cmake"} and path.startswith(f"{self._build}/")):
                continue
            if declared is None:
                paths = self._inputs(declares) if isinstance(declares, Edge) else declares
                declared = frozenset(map(os.path.realpath, paths))
            if os.path.realpath(path) not in declared:
                what = f"'{program}' read {_PATH}" + (f" for {product}" if product else "")
                self.found.setdefault(path, Finding(what, path, hint))

    def _inputs(self, edge: Edge) -> frozenset[str]:
        """Return the direct and indirect inputs of an edge, and its outputs."""
        pending = [*edge.outputs, *self._graph.inputs_of(edge)]
        paths = set(pending)
        while pending:
            path = pending.pop()
            before = self._made.get(path)
            inputs = self._graph.inputs_of(before) if before else self._graph.aliases.get(path, ())
            pending += [each for each in inputs if each not in paths]
            paths.update(inputs)
        return frozenset(paths)

    def _reads(self, processes: Iterable[Process]) -> Iterator[tuple[str, str]]:
        """Yield the program and the canonical path of each read that a rule should declare.

        A file of a package that the manifest does not declare is always a finding, even if a rule declares
        it.
        """
        processes = tuple(processes)
        written = {word for each in processes for _, kind, word in each.records if kind == "W"}
        for process in processes:
            program = basename(process.programs[-1]) if process.programs else "a program"
            read = (word for _, kind, word in process.records if kind == "R")
            for path in dict.fromkeys((*process.programs, *read)):
                if path in written or not isfile(path):
                    continue
                path = _canonical(CACHED_BYTECODE.sub(r"\1/\2.py", path))
                if path not in self._providers:
                    self._providers[path] = self._audit.provider(path, self._owners)
                name, place = self._providers[path]
                if place == "tool" or path.startswith(self._cmake) or _NO_INPUTS.search(path):
                    continue
                if place == "underlay":
                    self._of_underlay(program, path, name)
                elif name and name not in self._declared:
                    hint = f"add <depend>{name}</depend> to package.xml"
                    what = f"'{program}' read {_PATH} of package '{name}'"
                    self.found[path] = Finding(what, path, hint)
                elif place != "install" and not (
                    path.startswith(f"{self._build}/") and _OF_CMAKE.match(path[len(self._build) + 1 :])
                ):
                    yield program, path

    def _of_underlay(self, program: str, path: str, name: str) -> None:
        if name == self._task.name:
            hint = f"put the include folders of '{name}' first: target_include_directories(... BEFORE ...)"
        elif name in self._declared:
            hint = f"let the include folders and libraries of '{name}' precede those of the underlay"
        else:
            hint = f"add <depend>{name}</depend> to package.xml"
        what = f"'{program}' read {_PATH} of an underlay, but this workspace builds '{name}'"
        self.found[path] = Finding(what, path, hint)


_PATH = "{path}"
_CONFIGURES = (
    f"add 'set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS {_PATH})' to CMakeLists.txt"
)
_UNKNOWN = f"add 'DEPENDS {_PATH}' to the add_custom_command() that reads it"


def _hint(edge: Edge, output: str) -> str:
    """Return the line that declares an input of a command."""
    if edge.compiles:
        source = edge.inputs[0] if edge.inputs else "SOURCE"
        return f"add 'set_property(SOURCE {source} APPEND PROPERTY OBJECT_DEPENDS {_PATH})'"
    if _LINKS.match(edge.rule):
        target = _TARGET.search("\n".join((edge.text, *edge.inputs)))
        name = target[1] if target else output
        return f"add 'set_property(TARGET {name} APPEND PROPERTY LINK_DEPENDS {_PATH})'"
    return f"add 'DEPENDS {_PATH}' to the add_custom_command() that makes '{output}'"


def _runs_rules(process: Process) -> bool:
    return process.is_ninja or (bool(process.programs) and basename(process.programs[-1]) in _MAKE)


def _lines(package: str, findings: Iterable[Finding]) -> Iterator[str]:
    """Yield the lines for the findings of a package, by reader and folder, each with the line to add."""
    groups: dict[tuple[str, str, str], list[str]] = {}
    for each in findings:
        groups.setdefault((each.what, each.hint, dirname(each.path)), []).append(each.path)
    for (what, hint, folder), paths in sorted(groups.items(), key=lambda item: item[1]):
        paths.sort()
        if len(paths) > _MAX_LISTED:
            shown = [f"{len(paths)} files in {folder}, such as {basename(paths[0])},"]
        else:
            shown = paths
        yield from (f"{package}: {what.replace(_PATH, path)}" for path in shown)
        yield f"  hint: {hint.replace(_PATH, ' '.join(paths[:_MAX_LISTED]))}"


def _tools(context: BuildContext, variables: Mapping[str, str]) -> Iterator[str]:
    """Yield the folders whose files are programs of this machine, not inputs that a package declares."""
    yield from (f"/{name}" for name in _SYSTEM)
    yield from map(
        str, (*own_folders(), PACKAGE, PACKAGE.parent / "_ros_forge.py", context.layout.install / BACKUP_DIR)
    )
    python = context.python.resolve()
    interpreters = (str(context.python.parent.parent), str(python.parent.parent))
    home = Path.home()
    yield from {sys.prefix, sys.base_prefix, *interpreters} - {"/", str(home)}
    for entry in filter(None, variables.get("PATH", "").split(os.pathsep)):
        folder = Path(entry)
        prefix = folder.parent if folder.name in {"bin", "sbin"} else folder
        if len(prefix.parts) > 1 and prefix not in {home, context.root}:
            yield str(prefix)
    yield from (str(path) for path in home.glob(".*") if not context.root.is_relative_to(path))


_folder = cache(os.path.realpath)


def _canonical(path: str) -> str:
    """Return a path whose folder contains no links."""
    folder, _, name = path.rpartition("/")
    return f"{_folder(folder or '/').rstrip('/')}/{name}"
