"""Records of the files that CMake and each native command read and wrote in a build folder.

The relevant folders are the package's sources, its build folder and the prefixes of the workspace. For the
rest of the machine, only data that later builds compare is kept.
"""

from __future__ import annotations

import contextlib
import os
import re
import tempfile
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import replace
from functools import cache
from itertools import accumulate, chain
from pathlib import Path

from forge.engine.accesses import Accesses, ObservedCommands
from forge.engine.observation import Observation, ObservedStep, Process, observe
from forge.engine.variables import copies_environment, has_few_modules, mentioned, of_interpreter
from forge.engine.world import (
    CPU_INFO,
    KIND,
    LIBRARY,
    OUTPUT,
    PROCESSOR,
    PROGRAM,
    ModuleSearch,
    Scripts,
    World,
    about_modules,
    about_variables,
)
from forge.workspace.source_names import ENVIRONMENT_MARKS, is_source, is_source_folder


def commands_of(
    step: ObservedStep,
    roots: Mapping[int, str],
    outputs_of: Callable[[Process, frozenset[str]], tuple[str, ...]],
    folders: Folders,
) -> ObservedCommands:
    """Return the commands in a log; `roots` maps the process of each step to its kind.

    `outputs_of` returns the outputs of the edge that a process below ninja runs, given the files that the
    process wrote; it returns none if the edge is unknown.
    """
    configure: Accesses | None = None
    edges: dict[str, Accesses] = {}
    missing: set[str] = set()
    starters = (process for process in step.processes if process.parent is None or process.is_ninja)
    folders.tools = frozenset(program for process in starters for program in process.programs)
    others = {*step.processes}

    def look(processes: Iterable[Process], blind: tuple[str, ...] = ()) -> Observation:
        seen = observe(processes, blind)
        return replace(seen, missing=seen.missing.union(folders.missing_modules(seen)))

    def as_read(seen: Observation, programs: Observation) -> Observation:
        # Commands may check the time of a file, as git does to detect changes.
        return replace(seen, read=seen.read | programs.found)

    for process in step.processes:
        kind = roots.get(process.pid) if process.parent is None else None
        if kind == "cmake":
            family = process.family()
            others.difference_update(family)
            # CMake itself only checks whether files exist.
            own = [each for each in family if each.programs and Path(each.programs[-1]).name == "cmake"]
            seen = as_read(look(family, step.blind), look(each for each in family if each not in own))
            accesses = folders.accesses(seen, family)
            configure = replace(accesses, searched=folders.paths(seen.missing))
            missing |= configure.searched
    later = _LaterWrites(step)
    makers: dict[str, str] = {}
    removed: dict[str, frozenset[str]] = {}
    for process in step.edges():
        family = process.family()
        seen = look(family, step.blind)
        accesses = folders.accesses(as_read(seen, seen), family)
        outputs = outputs_of(process, accesses.written)
        if outputs:
            others.difference_update(family)
            # Outputs that the command itself did not write were written by a server.
            others_outputs = {*outputs} - {path.rstrip("/") for path in accesses.written}
            blind = accesses.blind or any(map(os.path.lexists, others_outputs))
            early = folders.paths(later.after(family)) - accesses.written
            edges[outputs[0]] = replace(accesses, found=frozenset(), blind=blind, early=early)
            missing |= folders.paths(seen.missing)
            makers.update(dict.fromkeys(seen.written, outputs[0]))
            removed[outputs[0]] = seen.removed
    for output, paths in removed.items():
        undone = {makers[path] for path in paths if path in makers} - {output}
        unmade = folders.paths(paths - makers.keys())
        edges[output] = replace(edges[output], undone=frozenset(undone), removed=unmade)
    copying = {each for each in others if each.parent is None and roots.get(each.pid) == "install"}
    started = [each for each in others if each.parent and folders.tools.isdisjoint(each.programs[-1:])]
    seen = as_read(look(others, step.blind), look(started))
    rest = folders.accesses(seen, others, copying)
    installing = observe(chain.from_iterable(each.family() for each in copying))
    left = frozenset(path for path in installing.written if path in rest.written and folders.is_built(path))
    return ObservedCommands(configure, edges, frozenset(missing), rest, left=left)


class _LaterWrites:
    """The files that the commands of a step wrote, and the times of the writes."""

    def __init__(self, step: ObservedStep) -> None:
        self._first: dict[str, int] = {}
        self._names: dict[str, list[str]] = {}
        for process in step.processes:
            for order, kind, path in process.records:
                if kind in "WD" and order < self._first.get(path, order + 1):
                    self._first[path] = order
        for path in self._first:
            self._names.setdefault(os.path.dirname(path), []).append(path)

    def after(self, processes: Iterable[Process]) -> Iterator[str]:
        """Yield paths written after processes had looked for them in vain or listed their folder."""
        for process in processes:
            for order, kind, path in process.records:
                if kind == "N" and self._first.get(path, 0) > order:
                    yield path
                elif kind == "L":
                    yield from (each for each in self._names.get(path, ()) if self._first[each] > order)


class Folders:
    """The relevant folders, with and without resolved links, and the irrelevant ones."""

    def __init__(
        self,
        build: Path,
        others: Iterable[Path],
        known: Iterable[str] = (),
        world: World | None = None,
        private: Path | None = None,
        sources: frozenset[str] = frozenset(),
        source: Path | None = None,
        workspace: Path | None = None,
        began: int = 0,
    ) -> None:
        """Keep paths below the build folder or `others`; paths below `known` are tracked otherwise.

        Files that forge's commands write below `private`, forge's own cache, are not outputs. `sources` are
        files that compilers take as source code. Files of `source`, one of the `others`, that do not count as
        sources are treated like files elsewhere. Scripts of packages may lie anywhere in the `workspace`. The
        steps `began` at this time, in nanoseconds, 0 if unknown.
        """
        self._began = began
        self._workspace = f"{workspace}/" if workspace else "\0"
        self._private = f"{private}/" if private else "\0"
        self._build = f"{build}/"
        self._source = f"{source}/" if source else ""
        self._known = (*known, *_VOLATILE)
        self._path = world.path if world else frozenset[str]()
        self._temporary = tempfile.gettempdir()
        self._unwatched = self._path | {self._temporary}
        self._sources = sources
        self._searched = world.searched_for_packages if world else lambda _: False
        self._all_of_path = world.all_of_path if world else frozenset({""})
        self._scripts = world.scripts if world else Scripts()
        self.tools: frozenset[str] = frozenset()
        """The programs of the steps themselves, which are tracked as tools wherever they are installed."""
        folders = (str(build), *map(str, others))
        spelled = {f"{os.path.realpath(folder)}/": f"{folder}/" for folder in folders}
        self._spelled = dict(sorted(spelled.items(), key=lambda pair: -len(pair[0])))
        self._places: dict[str, tuple[str, str, dict[str, str]]] = {}
        """By folder: the enclosing one of these folders, the path in it, and its entries by name."""
        self._folders: dict[str, str] = {"": "", "/": "/"}
        self._modules = ModuleSearch()
        self._metadata: dict[str, tuple[str, ...]] = {}
        # Commands of one package access mostly the same paths: each path is checked once.
        self.path = cache(self._look_for_path)
        """Returns a path below one of the folders, spelled with the folder's name, or None."""
        self._is_read_file = cache(self._look_at_file)
        self._is_missing = cache(self._look_for)
        self._is_native = cache(self._look_for_native)
        self._is_found = cache(self._look_at_kind)
        self._is_no_source = cache(self._look_beside)
        self._is_script = cache(self._look_for_script)
        self._is_foreign_script = cache(self._look_for_foreign_script)
        self._mentioned = cache(self._scripts.variables)

    def _look_for_path(self, path: str) -> str | None:
        root, below = self._place(path)
        return f"{root}{below}" if below else root[:-1] or None

    def _place(self, path: str) -> tuple[str, str]:
        """Return the enclosing folder of a path, ending with '/', and the path in it; '' if there is none."""
        folder, _, name = path.rpartition("/")
        place = self._places.get(folder)
        if place is None:
            real = f"{self._real(folder)}/"
            places = (
                (spelled, real[len(resolved) :])
                for resolved, spelled in self._spelled.items()
                if real.startswith(resolved)
            )
            roots = {
                resolved[len(real) : -1]: spelled
                for resolved, spelled in self._spelled.items()
                if resolved.startswith(real)
            }
            place = self._places[folder] = (*next(places, ("", "")), roots)
        root, below, roots = place
        if name in roots:
            return roots[name], ""
        return (root, below + name) if root else ("", "")

    def _real(self, folder: str) -> str:
        """Return the real path of a folder; each component is checked once."""
        if folder not in self._folders:
            parent, _, name = folder.rpartition("/")
            path = f"{self._real(parent)}/{name}"
            self._folders[folder] = os.path.realpath(path) if os.path.islink(path) else path
        return self._folders[folder]

    def is_built(self, path: str) -> bool:
        """Return whether a path is below the build folder."""
        return path.startswith(self._build)

    def paths(self, paths: Iterable[str]) -> frozenset[str]:
        """Return the paths below one of the folders."""
        return frozenset(filter(None, map(self.path, paths)))

    def accesses(
        self, seen: Observation, processes: Iterable[Process] = (), copying: Collection[Process] = ()
    ) -> Accesses:
        """Return the relevant accesses of some processes.

        Processes in `copying` only copy the files that they read.
        """
        processes = tuple(processes)
        outputs = [path for path in seen.written if os.path.lexists(path) and not CACHED_BYTECODE.match(path)]
        outputs += [
            f"{path}/" for path in seen.folders if os.path.isdir(path) and not path.endswith("/__pycache__")
        ]
        outputs = [path for path in outputs if not path.startswith(self._private)]
        written = self.paths(outputs)
        scanned = frozenset(path for process in processes for path in self._scanned(process))
        read = seen.read - seen.written | set(filter(self._is_untouched, seen.read & seen.written))
        external = {
            *self._external_files(read - scanned),
            *self._external_files(path for path in seen.loaded if not path.startswith(_SYSTEM_LIBRARIES)),
            *filter(self._is_missing, seen.missing),
            *self._listed(processes),
        }
        only_found = (path for path in seen.found if path not in external or os.path.islink(path))
        kinds = [f"{KIND}{path}" for path in only_found if self._is_found(path)]
        kinds += (f"{KIND}{path}" for path in seen.missing if self._leads_nowhere(path))
        used = (path.rpartition("/") for path in chain(seen.missing, seen.found, seen.executed, read))
        asked = {f"{PROGRAM}{name}" for folder, _, name in used if folder in self._path}
        asked.update(f"{LIBRARY}{os.path.basename(path)}" for path in seen.loaded)
        asked.update(f"{OUTPUT}{path}" for path in outputs if self._is_in_another_package(path))
        # For modules elsewhere, the location in which Python finds them is compared.
        modules = {
            (tuple(entry for entry in entries if self._is_external(f"{entry}/")), name)
            for entries, name in seen.modules
        }
        # Installed files are copied without regard to their content.
        compiling = [process for process in processes if process not in copying]
        named = frozenset[str]().union(*map(self._mentioned_by, compiling))
        by_ledger: dict[bool, set[str]] = {True: set(), False: set()}
        for process in processes if seen.ledgers else ():
            keeps = any(kind == "J" for _, kind, _ in process.records)
            by_ledger[keeps].update(path for _, kind, path in process.records if kind == "W")
        ledgers = [
            (digest, self.path(path)) for digest, _, path in (each.partition(" ") for each in seen.ledgers)
        ]
        return Accesses(
            read=self.paths(seen.read | seen.executed | seen.loaded),
            found=self.paths(seen.found),
            listed=self.paths(seen.listed),
            searched=frozenset(path.rpartition("/")[0] for path in self.paths(seen.missing)),
            written=written,
            external=frozenset(external),
            asked=frozenset(
                (*asked, *about_variables(seen.variables, named), *about_modules(modules), *kinds)
            )
            | self.about_processor(compiling),
            kept=written & self.paths(by_ledger[True] - by_ledger[False]) if seen.ledgers else frozenset(),
            ledgers=frozenset(f"{digest} {path}" for digest, path in ledgers),
            outside=len(written) < len(outputs) or any(not path.startswith(self._build) for path in written),
            blind=bool(seen.blind),
        )

    def _is_in_another_package(self, path: str) -> bool:
        """Return whether a file is among the sources of another package, which may use it.

        A file between the packages, such as the log of a compiler wrapper, may come and go, and so may files
        in hidden folders, such as those of git and caches.
        """
        below = path.removeprefix(self._workspace)
        if below == path or path[-1] == "/" or "/." in f"/{below}" or self.path(path) is not None:
            return False
        folders = accumulate(below.split("/")[:-1], "{}/{}".format)
        return any(os.path.lexists(f"{self._workspace}{folder}/package.xml") for folder in folders)

    def _is_untouched(self, path: str) -> bool:
        """Return whether a file that was opened for writing was only read, such as a database."""
        try:
            status = os.stat(path)
        except OSError:
            return False
        return max(status.st_mtime_ns, status.st_ctime_ns) < self._began

    def missing_modules(self, seen: Observation) -> Iterator[str]:
        """Yield the files in relevant folders that Python would have imported in preference."""
        for entries, name in seen.modules:
            places = self._modules.places(entries, name)
            for entry in entries:
                if places and entry == places[0]:
                    break
                if self.path(f"{entry}/") is not None:
                    path = f"{entry}/{name.replace('.', '/')}"
                    yield from (path, f"{path}.py")

    def _is_external(self, path: str) -> bool:
        if path.startswith(self._known):
            return False
        root, below = self._place(path)
        return not root or (root == self._source and self._is_no_source(below.rstrip("/")))

    def _look_beside(self, path: str) -> bool:
        """Return whether a path below the sources is not part of the sources, such as a file of git."""
        parent, _, name = path.rpartition("/")
        if not name or (parent and self._is_no_source(parent)):
            return bool(name)
        folder = f"{self._source}{parent}"

        def is_beside(other: str) -> bool:
            return os.path.lexists(f"{folder}/{other}")

        may_be_folder = os.path.isdir(f"{folder}/{name}") or not is_beside(name)
        may_be_file = not os.path.isdir(f"{folder}/{name}")
        return (may_be_folder and not is_source_folder(name, is_beside)) or (
            may_be_file and not is_source(name, is_beside)
        )

    def _external_files(self, paths: Iterable[str]) -> Iterator[str]:
        """Yield the files outside these folders; Python bytecode caches stand for their sources."""
        for path in paths:
            if "/__pycache__/" in path:
                path = CACHED_BYTECODE.sub(r"\1/\2.py", path)
            if self._is_read_file(path):
                yield path

    def _scanned(self, process: Process) -> Iterator[str]:
        """Yield the metadata of Python distributions that a process read from all of them.

        Such a process searches for plugins, which it then imports; a query for one distribution reads only
        its metadata.
        """
        read: dict[str, dict[str, set[str]]] = {}
        for _, kind, path in process.records:
            if kind == "R" and "-info" in path and (match := _METADATA.match(path)):
                folders = read.setdefault(match["file"], {})
                folders.setdefault(match["folder"], set()).add(path)
        for file, folders in read.items():
            names = {_distribution(path) for paths in folders.values() for path in paths}
            for folder, paths in folders.items():
                others = self._distributions(folder, file)
                if len(others) > 1 and others <= names:
                    yield from paths

    def _distributions(self, folder: str, file: str) -> frozenset[str]:
        """Return the names of the distributions in a folder whose metadata has a file."""
        if folder not in self._metadata:
            with contextlib.suppress(OSError):
                entries = (f"{folder}/{name}" for name in os.listdir(folder))
                self._metadata[folder] = tuple(path for path in entries if _METADATA.match(path))
        paths = self._metadata.get(folder, ())
        return frozenset(_distribution(path) for path in paths if os.path.isfile(f"{path}{file}"))

    def _look_at_file(self, path: str) -> bool:
        if _is_cached_bytecode(path) or not self._is_external(path) or not os.path.isfile(path):
            return False
        return not (os.access(path, os.X_OK) and os.path.realpath(path) in self.tools)

    def _look_for(self, path: str) -> bool:
        """Return whether an external path is still missing; programs are looked up in PATH instead."""
        if not self._is_external(path) or os.path.dirname(path) in self._unwatched:
            return False
        return not (_is_cached_bytecode(path) or _is_metadata(path) or os.path.lexists(path))

    def _look_at_kind(self, path: str) -> bool:
        """Return whether an external path exists and its kind may matter; programs are looked up by name."""
        if not self._is_external(path) or os.path.dirname(path) in self._path:
            return False
        if _is_cached_bytecode(path) or _is_metadata(path):
            return False
        is_above = any(root.startswith(f"{path}/") for pair in self._spelled.items() for root in pair)
        return not is_above and os.path.lexists(path)

    def _leads_nowhere(self, path: str) -> bool:
        """Return whether a path looked for in vain is a link whose target may be created."""
        is_source = bool(self._source) and path.startswith(self._source)
        return os.path.islink(path) and (is_source or self._is_found(path))

    def _listed(self, processes: Iterable[Process]) -> Iterator[str]:
        """Yield the folders elsewhere whose names were read, except by CMake in search of packages.

        The temporary folder is excluded: gcc's link-time optimization uses a makefile in it, and make lists
        the folders of makefiles.
        """
        for process in processes:
            # To find a library, CMake before 3.28 lists all folders of PATH, which contain none.
            all_listed = {path for _, kind, path in process.records if kind == "L"}
            is_cmake = os.path.basename(next(iter(process.programs[-1:]), "")) == "cmake"
            searched = self._path if is_cmake and self._all_of_path <= all_listed else frozenset[str]()
            for path in all_listed - searched:
                if path == self._temporary or not self._is_external(f"{path}/"):
                    continue
                if self._searched(path) or _is_cached_bytecode(path):
                    continue
                if os.path.isdir(path):
                    yield f"{path}/."

    def about_processor(self, processes: Iterable[Process]) -> frozenset[str]:
        """Return the question about the processor if processes may have compiled for it or queried it.

        Compilers query the processor directly, which cannot be observed. The option for this is in a command,
        or in a file that is read, such as ninja's rules, a response file, or a script.
        """
        is_asked = any(
            is_for_this_processor(process.command)
            # CMake reads this file whenever it starts.
            or any(
                kind == "R"
                and (
                    self._is_native(path)
                    or (path == CPU_INFO and self.tools.isdisjoint(process.programs[-1:]))
                )
                for _, kind, path in process.records
            )
            for process in processes
        )
        return frozenset({PROCESSOR} if is_asked else ())

    def _look_for_native(self, path: str) -> bool:
        if path in self._sources or path.startswith(self._known):
            return False
        is_native = _has_native_flag if self.path(path) is None else is_for_this_processor
        return self._scripts.is_native(path, is_native)

    def _mentioned_by(self, process: Process) -> frozenset[str]:
        """Return the variables that a process may have read from a copy of its environment."""
        name_sets = [mentioned(process.command)] if any(map(copies_environment, process.programs)) else []
        name_sets += map(of_interpreter, process.programs)
        for number, kind, path in process.records:
            program = process.program_at(number) if kind == "R" else ""
            if not program or not copies_environment(program):
                continue
            # Modules of Python and CMake elsewhere name many variables that do not matter.
            if self._is_script(path) or (has_few_modules(program) and self._is_foreign_script(path)):
                name_sets.append(self._mentioned(path, program))
        return frozenset[str]().union(*name_sets)

    def _look_for_script(self, path: str) -> bool:
        """Return whether a file belongs to a package, not to a Python environment in the workspace."""
        if self.path(path) is not None:
            return not path.endswith(_OF_CMAKE)
        return path.startswith(self._workspace) and not _is_in_environment(path, self._workspace)

    def _look_for_foreign_script(self, path: str) -> bool:
        """Return whether a file lies outside the workspace, like a compiler wrapper of the user."""
        is_elsewhere = self._is_external(path) and not path.startswith((self._workspace, *_OF_SYSTEM))
        return is_elsewhere and not _is_in_environment(path, "/")


def _is_in_environment(path: str, above: str) -> bool:
    """Return whether a file belongs to a Python environment below a folder."""
    folder = os.path.dirname(path)
    while f"{folder}/".startswith(above) and folder != "/":
        if any(os.path.lexists(f"{folder}/{mark}") for mark in ENVIRONMENT_MARKS):
            return True
        folder = os.path.dirname(folder)
    return False


def is_for_this_processor(text: str) -> bool:
    """Return True if options, or a file that may contain some, name the host processor.

    Comments do not count.
    """
    if not any(word in text for word in _NATIVE_WORDS):
        return False
    beginnings = (
        text[text.rfind("\n", 0, match.start()) + 1 : match.start()] for match in _NATIVE.finditer(text)
    )
    return not all(beginning.lstrip().startswith(("#", "//")) for beginning in beginnings)


def _has_native_flag(text: str) -> bool:
    """Return whether an external script, such as a Python module, has an option that names the processor."""
    return _NATIVE_FLAG.search(text) is not None


def _is_cached_bytecode(path: str) -> bool:
    """Return whether a path is a Python bytecode cache; bytecode beside modules is code without source."""
    return path.endswith("/__pycache__") or ("/__pycache__/" in path and path.endswith(".pyc"))


def _is_metadata(path: str) -> bool:
    return "-info" in path and _METADATA.match(path) is not None


def _distribution(path: str) -> str:
    """Return the name of the distribution that metadata belongs to, as Python compares it."""
    match = _METADATA.match(path)
    return re.sub("[-_.]+", "-", match["name"].lower()) if match else ""


_OF_CMAKE = ("/CMakeCache.txt", "Compiler.cmake", "/CMakeSystem.cmake")
"""Large files that CMake writes and reads in each build folder."""
_METADATA = re.compile(r"(?P<folder>.*)/(?P<name>[^/-]+)(-[^/]*)?\.(dist|egg)-info(?P<file>/.*)?$")
_SYSTEM_LIBRARIES = ("/lib", "/usr/lib")
"""System libraries, which the dynamic linker finds without a search path.

They change with the system's tools.
"""
_OF_SYSTEM = ("/bin/", "/etc/", "/lib", "/opt/", "/usr/bin/", "/usr/lib", "/usr/share/", "/dev/")
"""Scripts for all kinds of users and sessions."""
_NATIVE_WORDS = ("native", "-xHost", CPU_INFO)
_NATIVE = re.compile(rf"\bnative\b|-xHost\b|{CPU_INFO}")
"""Compiler options for the host processor, and the file from which scripts read its model."""
_NATIVE_FLAG = re.compile(r"-m(?:arch|tune|cpu)=native|target-cpu=native|-xHost\b|/proc/cpuinfo")
_VOLATILE = ("/proc/", "/sys/")
"""Virtual files of the kernel."""
CACHED_BYTECODE = re.compile(r"^(.*)/__pycache__/([^/.]+)\.[^/]*\.pyc$")
