"""Questions of a build about its environment: variables, programs, packages, modules, kinds of files.

Questions are texts, so that records can keep them with the answers: '$NAME', 'program NAME', 'library NAME',
'package NAME', 'FORGE_PROCESSOR', 'modules FOLDER:FOLDER NAME,NAME', 'kind PATH' and 'output PATH'.
"""

from __future__ import annotations

import contextlib
import os
import re
import stat
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import cache, cached_property

from forge.base.files import names_in, open_regular, text_or_nothing
from forge.base.frozen import Pairs
from forge.base.text import digest
from forge.engine.variables import is_tracked, mentioned
from forge.toolchain.programs import ConfigSearch, ProgramLookup, prefixes_of_path

_SYSTEM = ("/usr/local", "/usr", "", "/opt")
_OF_PACKAGES = re.compile(r"/?|/(lib\w*|share)(/[\w-]+-linux-\w+)?(/cmake|/CMake)?")
VARIABLE, PROGRAM, LIBRARY, PACKAGE_FOUND, MODULES = "$", "program ", "library ", "package ", "modules "
KIND, OUTPUT = "kind ", "output "
"""The beginnings of questions."""
PROCESSOR = "FORGE_PROCESSOR"
"""The question of builds that compile for the host processor, or read its description."""
CPU_INFO = "/proc/cpuinfo"
_MORE_FOLDERS = ".pth"
"""The suffix of files that add folders to Python's search path."""
_TRAITS = frozenset(
    {
        *("vendor_id", "cpu family", "model", "model name", "stepping", "cache size", "flags"),
        *("CPU implementer", "CPU architecture", "CPU variant", "CPU part", "Features"),
        *("isa", "uarch", "machine", "cpu", "features", "CPU Family", "Model Name"),
    }
)
"""Relevant lines of CPU_INFO on several architectures; other lines vary over time or between cores."""


class World:
    """The environment of one run of forge; lookups are cached."""

    def __init__(self, variables: Mapping[str, str]) -> None:
        """`variables` is the environment of builds, below that of dependencies."""
        self.variables = variables
        self._lookup = ProgramLookup(variables)
        self._configs = ConfigSearch()
        self._modules = ModuleSearch()
        paths = (variables.get(name, "") for name in ("CMAKE_PREFIX_PATH", "AMENT_PREFIX_PATH"))
        underlays = filter(None, os.pathsep.join(paths).split(os.pathsep))
        self._prefixes = tuple(dict.fromkeys((*underlays, *prefixes_of_path(self._lookup.folders), *_SYSTEM)))
        self._answers: dict[str, str] = {}
        folders = self._lookup.folders
        self.path = frozenset((*folders, *map(os.path.realpath, folders)))
        """The folders of PATH."""
        self.scripts = Scripts()

    @cached_property
    def all_of_path(self) -> frozenset[str]:
        """The existing folders of PATH, as spelled there."""
        return frozenset(filter(os.path.isdir, self._lookup.folders))

    def value(self, name: str) -> str:
        """Return the value of a variable, '' if it is not set."""
        return self.variables.get(name, "")

    def searched_for_packages(self, folder: str) -> bool:
        """Return True if CMake lists a folder to find packages, which are tracked by their names."""
        below = (folder[len(prefix) :] for prefix in self._prefixes if folder.startswith(prefix))
        return any(map(_OF_PACKAGES.fullmatch, below))

    def answers(self, questions: Iterable[str]) -> Pairs:
        """Return the sorted questions with their answers."""
        return tuple((question, self.answer(question)) for question in sorted(questions))

    def answer(self, question: str) -> str:
        """Return the digest of a value, the path of a program or the folder of a package; '' for none."""
        if question.startswith(OUTPUT):  # this build may create it
            return "there" if os.path.lexists(question.removeprefix(OUTPUT)) else ""
        if question not in self._answers:
            self._answers[question] = self._ask(question)
        return self._answers[question]

    def _ask(self, question: str) -> str:
        if question.startswith(VARIABLE):
            value = self.variables.get(question[1:])
            return "" if value is None else digest(value)  # a value may be a secret
        if question == PROCESSOR:
            return processor(text_or_nothing(CPU_INFO))
        if question.startswith(PROGRAM):
            name = question.removeprefix(PROGRAM)
            identity = self._lookup.identity(name) if name in self._lookup.names else ""
            return identity.rsplit(" ", 2)[0]
        if question.startswith(LIBRARY):
            return self._library_folders.get(question.removeprefix(LIBRARY), "")
        if question.startswith(MODULES):
            path, _, names = question.removeprefix(MODULES).rpartition(" ")
            folders = tuple(path.split(os.pathsep))
            places = [self._modules.found(folders, name) for name in names.split(",")]
            # Use positions instead of paths, so that the answer is the same in workspaces elsewhere.
            where = [[f"{_position(place, folders)} {file}" for place, file in each] for each in places]
            return digest("\n".join(map(os.pathsep.join, (*where, *map(self._modules.more, folders)))))
        if question.startswith(KIND):
            return _kind(question.removeprefix(KIND))
        name = question.removeprefix(PACKAGE_FOUND)
        return next(filter(None, (self._configs.folder(prefix, name) for prefix in self._prefixes)), "")

    @cached_property
    def _library_folders(self) -> Mapping[str, str]:
        """The folder of LD_LIBRARY_PATH in which the dynamic linker finds each name first."""
        folders: dict[str, str] = {}
        for folder in filter(None, self.value("LD_LIBRARY_PATH").split(os.pathsep)):
            with contextlib.suppress(OSError):
                for name in os.listdir(folder):
                    folders.setdefault(name, folder)
        return folders


class Scripts:
    """The contents of scripts. Many packages read the same ones: each state of a file is read once."""

    def __init__(self) -> None:
        self._variables: dict[tuple[object, ...], frozenset[str]] = {}
        self._native: dict[tuple[object, ...], bool] = {}

    def variables(self, path: str, program: str) -> frozenset[str]:
        """Return the variables that a script of a program names; see `mentioned`."""
        state = (program, *_state(path))
        if state not in self._variables:
            self._variables[state] = mentioned(_script(path), program)
        return self._variables[state]

    def named_in(self, paths: Iterable[str]) -> frozenset[str]:
        """Return the variables that scripts of any programs name; large files are no scripts."""
        small = (path for path in paths if os.path.isfile(path) and os.path.getsize(path) <= _MAX_SCRIPT)
        return frozenset[str]().union(
            *(self.variables(path, "cmake" if path.endswith(OF_CMAKE) else "") for path in small)
        )

    def is_native(self, path: str, is_for_this_processor: Callable[[str], bool]) -> bool:
        """Return whether a script has options for the host processor."""
        state = (is_for_this_processor, *_state(path))
        if state not in self._native:
            self._native[state] = is_for_this_processor(_script(path))
        return self._native[state]


_MAX_SCRIPT = 1 << 20
OF_CMAKE = ("/CMakeLists.txt", ".cmake")


def _state(path: str) -> tuple[object, ...]:
    with contextlib.suppress(OSError):
        status = os.stat(path)
        return path, status.st_ino, status.st_size, status.st_mtime_ns
    return (path,)


def _script(path: str) -> str:
    """Return the content of a text file, or nothing for binary data, which may be large."""
    try:
        with open(path, "rb", opener=open_regular) as file:
            text = file.read(4096)
            return "" if b"\0" in text else (text + file.read()).decode(errors="replace")
    except OSError:
        return ""


def _position(place: str, folders: tuple[str, ...]) -> str:
    """Return a folder as the number of the enclosing one of `folders`, and the path inside it."""
    for number, folder in enumerate(folders):
        if folder and f"{place}/".startswith(f"{folder}/"):
            return f"{number}{place[len(folder) :]}"
    return place


def processor(cpu_info: str) -> str:
    """Return a digest of processor model and features."""
    lines = {line.strip() for line in cpu_info.splitlines() if line.partition(":")[0].strip() in _TRAITS}
    return digest(*sorted(lines))


class ModuleSearch:
    """Searches modules like Python; listings of folders are cached."""

    def __init__(self) -> None:
        self._names: dict[str, dict[str, list[str]]] = {}
        self._files: dict[tuple[str, str], str | None] = {}
        # Names of submodules repeat those of their packages.
        self.found = cache(self._look_for)

    def places(self, folders: Iterable[str], name: str) -> tuple[str, ...]:
        """Return the folders that have a module: several, if it is a namespace without code."""
        return tuple(place for place, _ in self.found(tuple(folders), name))

    def _look_for(self, folders: tuple[str, ...], name: str) -> tuple[tuple[str, str], ...]:
        """Return the folders that have a module, each with the name of the file; '' for a namespace."""
        parent, _, name = name.rpartition(".")
        if parent:
            folders = tuple(
                f"{place}/{parent.rpartition('.')[2]}" for place, _ in self.found(folders, parent)
            )
        locations = []
        for folder in folders:
            file = self._file(folder, name)
            if file is not None:
                locations.append((folder, file))
            if file:
                break
        return tuple(locations)

    def more(self, folder: str) -> tuple[str, ...]:
        """Return the names of the files in a folder that add folders to Python's search path."""
        return tuple(sorted(self._listed(folder)[_MORE_FOLDERS]))

    def _file(self, folder: str, name: str) -> str | None:
        """Return the file in a folder that Python imports as a module, '' for a possible namespace."""
        entries = self._listed(folder).get(name)
        if not entries:
            return None
        if (folder, name) not in self._files:
            files = (self._kind(f"{folder}/{entry}", entry[len(name) + 1 :]) for entry in entries)
            self._files[folder, name] = max(
                (file for file in files if file is not None), key=_precedence, default=None
            )
        return self._files[folder, name]

    @staticmethod
    def _kind(path: str, suffix: str) -> str | None:
        if suffix.endswith(("py", "pyc", "so")):
            return suffix
        if suffix or not os.path.isdir(path):
            return None
        return "/" if is_package(path) else ""

    def _listed(self, folder: str) -> dict[str, list[str]]:
        """Return the file names in a folder by the module that they could be imported as."""
        if folder not in self._names:
            names: dict[str, list[str]] = {_MORE_FOLDERS: []}
            for entry in names_in(folder):
                stem = _MORE_FOLDERS if entry.endswith(_MORE_FOLDERS) else entry.partition(".")[0]
                names.setdefault(stem, []).append(entry)
            self._names[folder] = names
        return self._names[folder]


def _precedence(file: str) -> tuple[int, str]:
    """Sort the candidate files of a module by the order in which Python looks for them."""
    kinds = ("", "pyc", "py", "so", "/")
    return kinds.index(next(kind for kind in reversed(kinds) if file.endswith(kind))), file


def is_package(folder: str) -> bool:
    """Return whether a folder is a Python package, not a namespace."""
    return any(os.path.exists(f"{folder}/__init__.{suffix}") for suffix in ("py", "pyc"))


def _kind(path: str) -> str:
    """Return kind and mode, the size of a file, and the target of a link, without times."""
    target = ""
    try:
        if os.path.islink(path):
            target = f"link {os.readlink(path)} "
        status = os.stat(path)
    except OSError:
        return target
    mode = f"{stat.S_IMODE(status.st_mode):o}"
    if stat.S_ISREG(status.st_mode):
        return f"{target}file {mode} {status.st_size}"
    return f"{target}{f'folder {mode}' if stat.S_ISDIR(status.st_mode) else 'special'}"


def about_modules(found: Iterable[tuple[tuple[str, ...], str]]) -> Iterator[str]:
    """Yield the questions about modules that Python looked for in some folders."""
    names: dict[tuple[str, ...], list[str]] = {}
    for folders, name in sorted(found):
        names.setdefault(folders, []).append(name)
    return (
        f"{MODULES}{os.pathsep.join(folders)} {','.join(each)}" for folders, each in names.items() if folders
    )


def about_variables(names: Iterable[str], named: Iterable[str] = ()) -> Iterator[str]:
    """Yield the questions about variables that were requested, or `named` in scripts, if they are inputs."""
    yield from (f"{VARIABLE}{name}" for name in names if is_tracked(name))
    yield from (f"{VARIABLE}{name}" for name in named if is_tracked(name, named=True))
