"""What forge tracks of the packages of a build, gathered from its records and tools for the comparison."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

import forge
from forge.audit.comparison import SOURCES, Disk, Tracked, findings, report
from forge.audit.untracked import LINKED, MERGED, Machine
from forge.digests import NAMES_IN, source_folders
from forge.externals import cmake_root
from forge.frozen import frozen
from forge.prefixes import find_underlays
from forge.settings import own_cache
from forge.source_names import is_source, is_source_folder
from forge.tools import program_of

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from forge.audit.comparison import Finding
    from forge.audit.tracing import Audit
    from forge.model import BuildPlan, Pairs, Record, Task
    from forge.recipes.kitchen import Kitchen
    from forge.records import Records

_PATHS_OF_PYTHON = """import json, sys, sysconfig
prefixes = {sys.prefix, sys.base_prefix}
found = [p for p in sys.path if p.endswith("-packages") or any(p.startswith(f"{x}/") for x in prefixes)]
print(json.dumps([[*prefixes, *found, *sysconfig.get_paths().values()], sys.path]))
"""
_SYSTEM = frozenset({"/", "/usr", "/usr/local", "/usr/bin", "/usr/local/bin", "/bin"})


@frozen
class Surroundings:
    """What all packages of a build share: tools with what belongs to them, and forge's own folders."""

    folders: Mapping[str, str]
    files: frozenset[str]
    owners: Mapping[str, str]
    beside_links: frozenset[str]
    """Folders of sources to which installed links lead."""
    machine: Machine


def audited(
    audit: Audit, plan: BuildPlan, kitchen: Kitchen, records: Records, variables: Mapping[str, str]
) -> tuple[tuple[str, ...], bool]:
    """Return the report of an audit, and whether everything is explained; failed packages are left out."""
    known = records.journal.records
    shared = _surroundings(kitchen, known, variables)
    disk = Disk(os.path.realpath, first_missing, os.path.isdir)
    found: list[Finding] = []
    done = [name for name in plan.tasks if name in audit.steps and known[name].complete]
    for name in done:
        tracked = tracked_of(plan.tasks[name], known[name], kitchen, shared)
        made: frozenset[str] = frozenset()
        for step, accesses in audit.steps[name]:
            made |= accesses.made
            found += findings(name, step, accesses.after(made), tracked, (shared.machine, disk))
    return report(found, len(done)), not found


def tracked_of(task: Task, record: Record, kitchen: Kitchen, shared: Surroundings) -> Tracked:
    """Return what forge tracks of a package that was built."""
    layout = kitchen.layout
    source = str(kitchen.root / task.package.path)
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
    names = {path.removesuffix(NAMES_IN) for path in record.externals if path.endswith(NAMES_IN)}
    files = shared.files | linked | frozenset((*record.externals, *_programs(record.parts.tools)))
    ways = {str(folder) for path in (*folders, *prefixes, *files) for folder in Path(path).parents}
    declared = frozenset((task.name, *task.needs))
    return Tracked(
        folders,
        _Files(files, shared.owners, declared),
        frozenset(names),
        prefixes,
        frozenset(ways),
        shared.owners,
        counts_as_source,
    )


@frozen
class _Files:
    """Files that are recorded, and those that some packages installed."""

    recorded: frozenset[str]
    owners: Mapping[str, str]
    declared: frozenset[str]

    def __contains__(self, path: object) -> bool:
        return path in self.recorded or self.owners.get(str(path)) in self.declared


def counts_as_source(folder: str, path: str) -> bool:
    """Tell if a path below a folder of sources, or the folder, counts as a source."""
    while path != folder:
        above, _, name = path.rpartition("/")

        def beside(other: str, above: str = above) -> bool:
            return os.path.lexists(f"{above}/{other}")

        if not (is_source(name, beside) and is_source_folder(name, beside)):
            return False
        path = above
    return True


def first_missing(path: str) -> str:
    """Return the first part of a path that is not there; '' when all are there now."""
    if os.path.lexists(path):
        return ""
    parent = os.path.dirname(path)  # noqa: PTH120  (thousands: no Path for each)
    return path if os.path.isdir(parent) else first_missing(parent)  # noqa: PTH112


def _surroundings(
    kitchen: Kitchen, records: Mapping[str, Record], variables: Mapping[str, str]
) -> Surroundings:
    folders = dict(_own_folders(kitchen, variables))
    imports: set[str] = set()
    for python in {str(kitchen.python), sys.executable}:
        own, searched = _folders_of_python(python)
        folders |= dict.fromkeys(own, "the interpreter")
        imports.update(searched)
    for name, identity in kitchen.tools:
        if name.partition(" ")[0] in {"cc", "c++"}:
            folders |= dict.fromkeys(_folders_of_compiler(program_of(identity)), "the compiler")
    owners: dict[str, str] = {}
    beside_links: set[str] = set()
    for name, record in records.items():
        for path in record.files:
            owners[path] = name
            if kitchen.layout.symlink and os.path.islink(path):  # noqa: PTH114
                real = os.path.realpath(path)
                owners.setdefault(real, name)
                beside_links.add(os.path.dirname(real))  # noqa: PTH120
    searched_by_name = {folder for folder in variables.get("PATH", "").split(os.pathsep) if folder}
    searched_by_name |= {
        f"{prefix}/bin" for prefix in find_underlays(variables, kitchen.layout.install).prefixes
    }
    machine = Machine(
        str(Path.home()), tempfile.gettempdir(), frozenset(searched_by_name), frozenset(imports)
    )
    return Surroundings(folders, _programs(kitchen.tools), owners, frozenset(beside_links), machine)


def _programs(tools: Pairs) -> frozenset[str]:
    """Return the paths of programs that are told apart, with what links of these names lead to."""
    found = {program_of(identity) for _, identity in tools if identity.startswith("/")}
    return frozenset((*found, *map(os.path.realpath, found)))


def _own_folders(kitchen: Kitchen, variables: Mapping[str, str]) -> Iterator[tuple[str, str]]:
    """Yield the folders that belong to forge."""
    home = Path(forge.__file__).parent
    yield str(home), "forge"
    for beside in ("templates", "_ros_forge.py"):
        yield str(home.parent / beside), "forge"
    cache_of_user = own_cache(variables)
    if cache_of_user:
        yield str(cache_of_user), "forge"
    for folder in kitchen.layout.build.glob("*forge_*"):
        yield str(folder), "forge"


@cache
def _folders_of_python(python: str) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return where an interpreter and what is installed for it live, and where it looks for modules.

    A folder that somebody added by a .pth file is a checkout, and no part of the interpreter.
    """
    own, searched = json.loads(_answer((python, "-E", "-c", _PATHS_OF_PYTHON)) or "[[], []]")
    return tuple(path for path in own if path not in _SYSTEM), tuple(searched)


@cache
def _folders_of_compiler(compiler: str) -> tuple[str, ...]:
    """Return where a compiler keeps its own programs, headers and libraries."""
    questions = ("-print-prog-name=cc1plus", "-print-prog-name=cc1", "-print-libgcc-file-name")
    found = [os.path.dirname(_answer((compiler, question))) for question in questions]  # noqa: PTH120
    found.append(_answer((compiler, "-print-resource-dir")))
    return tuple(os.path.realpath(path) for path in found if path.startswith("/") and path not in _SYSTEM)


def _answer(argv: tuple[str, ...]) -> str:
    done = subprocess.run(argv, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False)
    return done.stdout.strip() if done.returncode == 0 else ""
