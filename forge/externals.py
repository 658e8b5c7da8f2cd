"""Which files outside of its own folders a build read, and in which folders it looked for files.

Sources of the package and files that its needs installed are inputs anyway. Everything else is found here:
system headers and underlays that compilers report, libraries and programs that build rules name, files of a
monorepo that CMake code or install rules reach by '..', and folders of an include path, where a new header
may come before one that was read. Such a folder is listed as 'FOLDER/.': its names are the input. CMake's own
modules are left out: they come and go with CMake, which counts as a tool.
"""

from __future__ import annotations

import itertools
import os
import re
from pathlib import Path
from typing import TYPE_CHECKING

from forge.build.native_graph import read_native_graph
from forge.digests import NAMES_IN, source_files, source_folders

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from forge.build.native_graph import NativeGraph

_CMAKE_ROOT = re.compile(r"^CMAKE_ROOT:INTERNAL=(.+)$", re.MULTILINE)
_FOUND = re.compile(r"^[^/#:]+:(?!INTERNAL)\w+=(/.+)$", re.MULTILINE)
_SEARCHED = re.compile(r"(?:^|\s)-(?:I|isystem|iquote|idirafter|L) ?((?:\$ |\\ |\\.|[^\s$\\])+)")
_SEARCHED_BY_LINK = re.compile(r"(?:^|\s)-L ?((?:\$ |\\ |\\.|[^\s$\\])+)")
_LINKED = re.compile(r"(?:^|\s)-l ?(:?[\w.+-]+)")
_OF_EVERY_PROGRAM = frozenset({"c", "dl", "gcc", "gcc_s", "m", "pthread", "rt", "stdc++"})
_IMPLICIT = re.compile(r"set\(CMAKE_\w+_IMPLICIT_LINK_DIRECTORIES \"([^\"]*)\"\)")
_WORD = re.compile(r"""(?:^|[\s"'=(])(/(?:\$ |\\ |\\.|[^\s"'$\\;)])+)""")
_INSTALLED = re.compile(r'file\(INSTALL DESTINATION [^\n]*?TYPE (\w+)[^\n]*? FILES((?:\s+"[^"\n]+")+)')
_QUOTED = re.compile(r'"([^"\n]+)"')
_COMMENT = re.compile(r"#\[\[.*?\]\]|#[^\n]*", re.DOTALL)
_HERE = re.compile(
    r"\$\{(CMAKE_CURRENT_SOURCE_DIR|CMAKE_CURRENT_LIST_DIR|CMAKE_SOURCE_DIR|PROJECT_SOURCE_DIR)\}"
)
_OUTSIDE = re.compile(r"""(?:^|[\s"(;=])((?:[^\s"();$]*/)?\.\.(?:/[^\s"();$]*)?)""")
_GLOB = re.compile(r"[^/]*[*?\[]")
_TREE_LIMIT = 20_000
"""Files of one folder outside of a package after which nobody can mean the whole of it."""
READ_BY_BACKEND = "read_by_backend"
WRITTEN_BY_BACKEND = "written_by_backend"


def external_inputs(
    build: Path, source: Path, inside: Sequence[Path], unlisted: Sequence[Path] = ()
) -> tuple[str, ...]:
    """Return the absolute paths, sorted, that the last build below `build` read outside of `inside`.

    `source` is the package's folder. Of folders below `unlisted` the names do not count. A log that cannot
    be read counts as no files: the compiler's own rules still hold.
    """
    own = tuple(f"{path}{os.sep}" for path in inside)
    cmakes = cmake_root(build)
    graph = read_native_graph(build)
    found = {*graph.known(), *graph.read_by_cmake, *_programs(build, graph), *_read_by_backend(build)}
    found.update(_libraries(build, graph))
    for path in (*_installed_from(build), *_named_outside(source, graph)):
        if not path.startswith(own):
            found.update(_whole(path, inside))
    outside = {path for path in found if not path.startswith(own)}
    without = (*own, *(f"{path}{os.sep}" for path in unlisted))
    outside |= {path for path in _searched(graph, outside) if not f"{path}/".startswith(without)}
    return tuple(sorted(path for path in outside if not (cmakes and path.startswith(cmakes))))


def read_below(build: Path, folder: Path) -> frozenset[str]:
    """Return the files below a folder that the native tool knows as inputs."""
    return frozenset(path for path in read_native_graph(build).known() if path.startswith(f"{folder}/"))


def cmake_root(build: Path) -> str:
    """Return where CMake keeps its own modules, with '/' at its end, by its cache; else ''."""
    match = _CMAKE_ROOT.search(_text(build / "CMakeCache.txt"))
    return f"{match.group(1)}/" if match else ""


def _programs(build: Path, graph: NativeGraph) -> Iterator[str]:
    """Yield the files that CMake found by name, and those that the package's own commands name."""
    for path in _FOUND.findall(_text(build / "CMakeCache.txt")):
        if os.path.isfile(path):  # noqa: PTH113
            yield path
    for edge in graph.edges:
        if edge.outputs_known:
            continue
        for word in _WORD.findall(edge.text):
            path = os.path.normpath(re.sub(r"[\\$](.)", r"\1", word))
            if os.path.isfile(path):  # noqa: PTH113
                yield path


def written_by_backend(build: Path) -> Iterator[str]:
    """Yield the sources of a Python package that its build backend reported to have written itself."""
    return _listed(build, WRITTEN_BY_BACKEND)


def _libraries(build: Path, graph: NativeGraph) -> Iterator[str]:
    """Yield the files that links ask for as -lNAME: in folders that they name, else where compilers look.

    What every program is linked with comes with the compiler.
    """
    texts = [edge.text for edge in graph.edges if "-l" in edge.text]
    if graph.tool == "make":
        texts += [text for path in build.rglob("link.txt") if "-l" in (text := _text(path))]
    folders: tuple[str, ...] | None = None
    for text in texts:
        names = [name for name in _LINKED.findall(text) if name not in _OF_EVERY_PROGRAM]
        if names and folders is None:
            folders = _searched_by_linkers(build)
        named = [os.path.normpath(folder) for folder in _SEARCHED_BY_LINK.findall(text) if folder[0] == "/"]
        for name in dict.fromkeys(names):
            files = (name[1:],) if name[0] == ":" else (f"lib{name}.so", f"lib{name}.a")
            places = (f"{folder}/{file}" for folder in (*named, *(folders or ())) for file in files)
            yield from filter(os.path.isfile, places)


def _searched_by_linkers(build: Path) -> tuple[str, ...]:
    """Return the folders in which the compilers of a build folder look for libraries by themselves."""
    texts = map(_text, build.glob("CMakeFiles/[0-9]*/CMake*Compiler.cmake"))
    found = (folder for text in texts for said in _IMPLICIT.findall(text) for folder in said.split(";"))
    return tuple(dict.fromkeys(folder for folder in found if folder.startswith("/")))


def _read_by_backend(build: Path) -> Iterator[str]:
    """Yield what the build backend of a Python package reported to have read."""
    return _listed(build, READ_BY_BACKEND)


def _listed(build: Path, name: str) -> Iterator[str]:
    """Yield the paths of a list; its other lines are remarks."""
    lines = _text(build / "handover" / name).split("\n")
    yield from (line for line in lines if line.startswith("/"))


def _installed_from(build: Path) -> Iterator[str]:
    """Yield the absolute paths that install rules copy from; a folder stands for all that it holds."""
    for script in _install_scripts(build):
        for _, files in _INSTALLED.findall(_text(script)):
            yield from (os.path.normpath(path) for path in _QUOTED.findall(files))


def _install_scripts(build: Path) -> Iterator[Path]:
    """Yield the install scripts of a build folder and of the folders that its CMakeLists.txt adds."""
    waiting = [build / "cmake_install.cmake"]
    seen = set()
    while waiting:
        script = waiting.pop()
        if script in seen or not script.is_file():
            continue
        seen.add(script)
        yield script
        waiting += [
            Path(path) for path in re.findall(r'include\("(/[^"]+/cmake_install\.cmake)"\)', _text(script))
        ]


def _named_outside(source: Path, graph: NativeGraph) -> Iterator[str]:
    """Yield the paths with '..' in the package's CMake code that lead out of its folder.

    So CMake code reaches the files of a repository that holds the package: file(READ), execute_process,
    add_custom_command, ExternalProject_Add.
    """
    home = f"{source}/"
    for path in graph.read_by_cmake:
        if not path.startswith(home) or not path.endswith((".cmake", "CMakeLists.txt")):
            continue
        here = os.path.dirname(path)  # noqa: PTH120
        text = _HERE.sub(
            lambda match, here=here: here if "CURRENT" in match.group(1) else str(source),  # type: ignore[misc]
            _COMMENT.sub("", _text(Path(path))),
        )
        for word in _OUTSIDE.findall(text):
            named = os.path.normpath(os.path.join(here, word))  # noqa: PTH118
            if not f"{named}/".startswith(home) and not home.startswith(f"{named}/"):
                yield named


def _matched(pattern: str) -> Iterator[str]:
    """Yield the folders whose names decide what a pattern of file(GLOB) or file(GLOB_RECURSE) finds."""
    fixed = _GLOB.split(pattern, maxsplit=1)[0].rpartition("/")[0]
    folders = itertools.islice(source_folders(fixed), _TREE_LIMIT) if os.path.isdir(fixed) else ()  # noqa: PTH112
    yield from (f"{folder}{NAMES_IN}" for folder, _ in folders)


def _whole(path: str, inside: Iterable[Path]) -> Iterator[str]:
    """Yield a file, or all files and folders below a folder; one that holds the workspace is not entered."""
    if any(f"{folder}/".startswith(_GLOB.split(f"{path}/", maxsplit=1)[0]) for folder in inside):
        return
    if _GLOB.search(path):
        yield from _matched(path)
        return
    if not os.path.isdir(path):  # noqa: PTH112
        yield path
        return
    files = []
    for name in source_files(path):
        files.append(name)
        if len(files) > _TREE_LIMIT:
            return
    yield from files
    yield from (f"{folder}{NAMES_IN}" for folder, _ in source_folders(path))


def _searched(graph: NativeGraph, outside: Iterable[str]) -> Iterator[str]:
    """Yield the folders in which compilers and linkers looked for files before they found those they read."""
    searched = {
        os.path.normpath(re.sub(r"[\\$](.)", r"\1", word))
        for edge in graph.edges
        for word in _SEARCHED.findall(edge.text)
        if word.startswith("/")
    }
    below = {os.path.dirname(path) for path in outside}  # noqa: PTH120
    relative = {
        folder[len(top) + 1 :] for top in searched for folder in below if folder.startswith(f"{top}/")
    }
    for top in searched:
        for folder in ("", *relative):
            path = f"{top}/{folder}" if folder else top
            if os.path.isdir(path):  # noqa: PTH112
                yield f"{path}{NAMES_IN}"
        if not os.path.isdir(top):  # noqa: PTH112
            above = os.path.dirname(top)  # noqa: PTH120
            if os.path.isdir(above):  # noqa: PTH112
                yield f"{above}{NAMES_IN}"


def _text(path: Path) -> str:
    """Return what a file says, or nothing when it is not there."""
    try:
        return path.read_text(encoding="utf-8", errors="surrogateescape")
    except OSError:
        return ""
