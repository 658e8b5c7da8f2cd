"""Collect the tracked inputs of the packages of a build from its records and tools."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from forge.base.env_vars import own_cache
from forge.base.frozen import frozen
from forge.base.layout import BACKUP_DIR, PACKAGE, own_folders
from forge.build.audit.comparison import SOURCES, Disk, Tracked, findings, report
from forge.build.audit.ignored_inputs import LINKED, MERGED, Machine
from forge.build.inputs.depfiles import cmake_root
from forge.build.inputs.fingerprints import DIR_LISTING_SUFFIX, source_folders
from forge.environment.prefixes import find_underlays
from forge.toolchain.programs import program_of
from forge.workspace.source_names import is_environment, is_source, is_source_folder

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from forge.base.frozen import Pairs
    from forge.build.audit.comparison import Finding
    from forge.build.audit.tracing import Audit
    from forge.build.model import BuildRecord
    from forge.build.recipes.context import BuildContext
    from forge.build.state import BuildState
    from forge.build.tasks import BuildPlan, Task

_PATHS_OF_PYTHON = """import json, sys, sysconfig
prefixes = {sys.prefix, sys.base_prefix}
found = [p for p in sys.path if p.endswith("-packages") or any(p.startswith(f"{x}/") for x in prefixes)]
print(json.dumps([[*prefixes, *found, *sysconfig.get_paths().values()], sys.path]))
"""
_SYSTEM = frozenset({"/", "/usr", "/usr/local", "/usr/bin", "/usr/local/bin", "/bin"})


@frozen
class SharedInputs:
    """The tracked inputs shared by all packages: tools with their files, and forge's own folders."""

    folders: Mapping[str, str]
    files: frozenset[str]
    owners: Mapping[str, str]
    beside_links: frozenset[str]
    """Source folders that contain targets of installed links."""
    machine: Machine


def audit_report(
    audit: Audit, plan: BuildPlan, context: BuildContext, state: BuildState, variables: Mapping[str, str]
) -> tuple[tuple[str, ...], bool]:
    """Return the report of an audit, and True if there are no findings; failed packages are left out."""
    known = state.journal.records
    shared = _shared_inputs(context, known, variables)
    disk = Disk(os.path.realpath, first_missing, os.path.isdir)
    found: list[Finding] = []
    done = [name for name in plan.tasks if name in audit.steps and known[name].complete]
    for name in done:
        tracked = tracked_of(plan.tasks[name], known[name], context, shared)
        made: frozenset[str] = frozenset()
        for step, accesses in audit.steps[name]:
            made |= accesses.made
            found += findings(name, step, accesses.after(made), tracked, (shared.machine, disk))
    return report(found, len(done)), not found


def tracked_of(task: Task, record: BuildRecord, context: BuildContext, shared: SharedInputs) -> Tracked:
    """Return the tracked inputs of a package that was built."""
    layout = context.layout
    source = str(context.root / task.package.path)
    folders = {**shared.folders, str(task.build_dir): "its build folder"}
    linked: set[str] = set()
    for folder, targets in source_folders(source):
        folders[os.path.realpath(folder)] = SOURCES
        linked.update(targets)
    folders[source] = SOURCES
    root = cmake_root(task.build_dir).rstrip("/")
    if root:
        folders[root] = "CMake"
    prefixes = dict.fromkeys(shared.beside_links, LINKED.what)
    prefixes |= {str(layout.prefix(need)): "names in its needs' prefixes" for need in task.needs}
    if layout.merged:
        prefixes[str(layout.install)] = MERGED.what
    else:
        folders[str(layout.prefix(task.name))] = "its prefix"
    names = {
        path.removesuffix(DIR_LISTING_SUFFIX)
        for path in record.externals
        if path.endswith(DIR_LISTING_SUFFIX)
    }
    files = shared.files | linked | frozenset((*record.externals, *_programs(record.inputs.tools)))
    parents = {str(folder) for path in (*folders, *prefixes, *files) for folder in Path(path).parents}
    declared = frozenset((task.name, *task.needs))
    return Tracked(
        folders,
        _Files(files, shared.owners, declared),
        frozenset(names),
        prefixes,
        frozenset(parents),
        shared.owners,
        counts_as_source,
    )


@frozen
class _Files:
    """The recorded files, and the files installed by declared dependencies."""

    recorded: frozenset[str]
    owners: Mapping[str, str]
    declared: frozenset[str]

    def __contains__(self, path: object) -> bool:
        return path in self.recorded or self.owners.get(str(path)) in self.declared


def counts_as_source(folder: str, path: str) -> bool:
    """Return True if a path in a source folder, or the folder itself, is a source."""
    while path != folder:
        above, _, name = path.rpartition("/")

        def beside(other: str, above: str = above) -> bool:
            return os.path.lexists(f"{above}/{other}")

        installed = above != folder and is_environment(beside)
        if installed or not (is_source(name, beside) and is_source_folder(name, beside)):
            return False
        path = above
    return True


def first_missing(path: str) -> str:
    """Return the first missing part of a path, or '' if it exists."""
    if os.path.lexists(path):
        return ""
    parent = os.path.dirname(path)
    return path if os.path.isdir(parent) else first_missing(parent)


def _shared_inputs(
    context: BuildContext, records: Mapping[str, BuildRecord], variables: Mapping[str, str]
) -> SharedInputs:
    folders = dict(_own_folders(context, variables))
    imports: set[str] = set()
    for python in {str(context.python), sys.executable}:
        own, searched = _folders_of_python(python)
        folders |= dict.fromkeys(own, "the interpreter")
        imports.update(searched)
    for name, identity in context.tools:
        if name.partition(" ")[0] in {"cc", "c++"}:
            folders |= dict.fromkeys(_folders_of_compiler(program_of(identity)), "the compiler")
    owners: dict[str, str] = {}
    beside_links: set[str] = set()
    for name, record in records.items():
        for path in record.files:
            owners[path] = name
            if context.layout.symlink and os.path.islink(path):
                real = os.path.realpath(path)
                owners.setdefault(real, name)
                beside_links.add(os.path.dirname(real))
    searched_by_name = {folder for folder in variables.get("PATH", "").split(os.pathsep) if folder}
    searched_by_name |= {
        f"{prefix}/bin" for prefix in find_underlays(variables, context.layout.install).prefixes
    }
    machine = Machine(
        str(Path.home()), tempfile.gettempdir(), frozenset(searched_by_name), frozenset(imports)
    )
    return SharedInputs(folders, _programs(context.tools), owners, frozenset(beside_links), machine)


def _programs(tools: Pairs) -> frozenset[str]:
    """Return the paths of tracked programs, and the targets of links at these paths."""
    found = {program_of(identity) for _, identity in tools if identity.startswith("/")}
    return frozenset((*found, *map(os.path.realpath, found)))


def _own_folders(context: BuildContext, variables: Mapping[str, str]) -> Iterator[tuple[str, str]]:
    """Yield the folders that belong to forge."""
    for folder in (*own_folders(), PACKAGE.parent / "_ros_forge.py"):
        yield str(folder), "forge"
    cache_of_user = own_cache(variables)
    if cache_of_user:
        yield str(cache_of_user), "forge"
    for folder in context.layout.build.glob("*forge_*"):
        yield str(folder), "forge"
    yield str(context.layout.install / BACKUP_DIR), "forge"


@cache
def _folders_of_python(python: str) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the folders of an interpreter and its installed packages, and its module search path.

    A folder added by a .pth file is a checkout and not part of the interpreter.
    """
    own, searched = json.loads(_answer((python, "-E", "-c", _PATHS_OF_PYTHON)) or "[[], []]")
    return tuple(path for path in own if path not in _SYSTEM), tuple(searched)


@cache
def _folders_of_compiler(compiler: str) -> tuple[str, ...]:
    """Return the folders of a compiler's own programs, headers and libraries."""
    questions = ("-print-prog-name=cc1plus", "-print-prog-name=cc1", "-print-libgcc-file-name")
    found = [os.path.dirname(_answer((compiler, question))) for question in questions]
    found.append(_answer((compiler, "-print-resource-dir")))
    return tuple(os.path.realpath(path) for path in found if path.startswith("/") and path not in _SYSTEM)


def _answer(argv: tuple[str, ...]) -> str:
    done = subprocess.run(argv, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False)
    return done.stdout.strip() if done.returncode == 0 else ""
