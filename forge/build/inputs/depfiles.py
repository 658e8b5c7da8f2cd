"""Find the external files that a build read, and the folders that it searched.

Sources of the package and installed files of its dependencies are tracked anyway. This module finds
everything else: headers of the system and underlays reported by compilers, libraries and programs in build
rules, files of a monorepo that CMake code or install rules reach through '..', and include folders, where a
new header may shadow one that was read. Such a folder is listed as 'FOLDER/.': its file names are the input.
CMake's own modules are left out, since CMake is tracked as a tool.
"""

from __future__ import annotations

import itertools
import os
import re
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from forge.base.files import text_or_nothing
from forge.base.layout import SCRATCH_DIR
from forge.build.inputs.fingerprints import DIR_LISTING_SUFFIX, source_files, source_folders
from forge.build.inputs.native_graph import read_native_graph

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from forge.build.inputs.native_graph import NativeGraph

_text = partial(text_or_nothing, errors="surrogateescape")
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
"""The number of files above which an external folder is not tracked as a whole."""
READ_BY_BACKEND = "read_by_backend"
WRITTEN_BY_BACKEND = "written_by_backend"


def external_inputs(
    build: Path, source: Path, inside: Sequence[Path], untracked_names: Sequence[Path] = ()
) -> tuple[str, ...]:
    """Return the absolute paths, sorted, that the last build below `build` read outside of `inside`.

    `source` is the package's folder. File names in folders below `untracked_names` are not tracked.
    An unreadable log counts as empty: the native tool's own rules still apply.
    """
    own = tuple(f"{path}{os.sep}" for path in inside)
    cmakes = cmake_root(build)
    graph = read_native_graph(build)
    found = {*graph.known(), *graph.read_by_cmake, *_programs(build, graph)}
    found.update(_read_by_backend(build, inside))
    found.update(_libraries(build, graph))
    for path in (*_installed_from(build), *_named_outside(source, graph)):
        if not path.startswith(own):
            found.update(_files_of(path, inside))
    outside = {path for path in found if not path.startswith(own)}
    excluded = (*own, *(f"{path}{os.sep}" for path in untracked_names))
    outside |= {path for path in _searched(graph, outside) if not f"{path}/".startswith(excluded)}
    return tuple(sorted(path for path in outside if not (cmakes and path.startswith(cmakes))))


def read_below(build: Path, folder: Path) -> frozenset[str]:
    """Return the files below a folder that are inputs of the native build."""
    return frozenset(path for path in read_native_graph(build).known() if path.startswith(f"{folder}/"))


def cmake_root(build: Path) -> str:
    """Return the folder of CMake's own modules, ending with '/', from the CMake cache, or ''."""
    match = _CMAKE_ROOT.search(_text(build / "CMakeCache.txt"))
    return f"{match.group(1)}/" if match else ""


def _programs(build: Path, graph: NativeGraph) -> Iterator[str]:
    """Yield the files that CMake has found, and those in the package's custom commands."""
    for path in _FOUND.findall(_text(build / "CMakeCache.txt")):
        if os.path.isfile(path):
            yield path
    for edge in graph.edges:
        if edge.outputs_known:
            continue
        for word in _WORD.findall(edge.text):
            path = os.path.normpath(re.sub(r"[\\$](.)", r"\1", word))
            if os.path.isfile(path):
                yield path


def written_by_backend(build: Path) -> Iterator[str]:
    """Yield the source files that a Python build backend wrote, or the Cargo.lock that cargo wrote."""
    return _listed(build, WRITTEN_BY_BACKEND)


def _libraries(build: Path, graph: NativeGraph) -> Iterator[str]:
    """Yield the libraries linked as -lNAME: in the folders of the command, else in the compilers' defaults.

    Libraries linked into every program are excluded; they belong to the compiler.
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
            candidates = (f"{folder}/{file}" for folder in (*named, *(folders or ())) for file in files)
            yield from filter(os.path.isfile, candidates)


def _searched_by_linkers(build: Path) -> tuple[str, ...]:
    """Return the default library folders of the compilers used in a build folder."""
    texts = map(_text, build.glob("CMakeFiles/[0-9]*/CMake*Compiler.cmake"))
    found = (
        folder
        for text in texts
        for directories in _IMPLICIT.findall(text)
        for folder in directories.split(";")
    )
    return tuple(dict.fromkeys(folder for folder in found if folder.startswith("/")))


def _read_by_backend(build: Path, inside: Sequence[Path]) -> Iterator[str]:
    """Yield what the build backend of a Python package or cargo read; a folder includes all its files."""
    for path in _listed(build, READ_BY_BACKEND):
        is_folder = not path.endswith(DIR_LISTING_SUFFIX) and os.path.isdir(path)
        yield from _files_of(path, inside) if is_folder else (path,)


def _listed(build: Path, name: str) -> Iterator[str]:
    """Yield the paths of a list; other lines are comments."""
    lines = _text(build / SCRATCH_DIR / name).split("\n")
    yield from (line for line in lines if line.startswith("/"))


def _installed_from(build: Path) -> Iterator[str]:
    """Yield the absolute paths that install rules copy; a folder includes all its files."""
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

    This finds files of the surrounding repository used by file(READ), execute_process, add_custom_command and
    ExternalProject_Add.
    """
    home = f"{source}/"
    for path in graph.read_by_cmake:
        if not path.startswith(home) or not path.endswith((".cmake", "CMakeLists.txt")):
            continue
        here = os.path.dirname(path)
        text = _HERE.sub(
            lambda match, here=here: here if "CURRENT" in match.group(1) else str(source),  # type: ignore[misc]
            _COMMENT.sub("", _text(Path(path))),
        )
        for word in _OUTSIDE.findall(text):
            named = os.path.normpath(os.path.join(here, word))
            if not f"{named}/".startswith(home) and not home.startswith(f"{named}/"):
                yield named


def _matched(pattern: str) -> Iterator[str]:
    """Yield the folders whose file names affect a pattern of file(GLOB) or file(GLOB_RECURSE)."""
    fixed = _GLOB.split(pattern, maxsplit=1)[0].rpartition("/")[0]
    folders = itertools.islice(source_folders(fixed), _TREE_LIMIT) if os.path.isdir(fixed) else ()
    yield from (f"{folder}{DIR_LISTING_SUFFIX}" for folder, _ in folders)


def _files_of(path: str, inside: Iterable[Path]) -> Iterator[str]:
    """Yield a file, or all files and folders below a folder, unless it contains the workspace."""
    if any(f"{folder}/".startswith(_GLOB.split(f"{path}/", maxsplit=1)[0]) for folder in inside):
        return
    if _GLOB.search(path):
        yield from _matched(path)
        return
    if not os.path.isdir(path):
        yield path
        return
    files = []
    for name in source_files(path):
        files.append(name)
        if len(files) > _TREE_LIMIT:
            return
    yield from files
    yield from (f"{folder}{DIR_LISTING_SUFFIX}" for folder, _ in source_folders(path))


def _searched(graph: NativeGraph, outside: Iterable[str]) -> Iterator[str]:
    """Yield the folders that compilers and linkers searched."""
    searched = {
        os.path.normpath(re.sub(r"[\\$](.)", r"\1", word))
        for edge in graph.edges
        for word in _SEARCHED.findall(edge.text)
        if word.startswith("/")
    }
    below = {os.path.dirname(path) for path in outside}
    relative = {
        folder[len(top) + 1 :] for top in searched for folder in below if folder.startswith(f"{top}/")
    }
    for top in searched:
        for folder in ("", *relative):
            path = f"{top}/{folder}" if folder else top
            if os.path.isdir(path):
                yield f"{path}{DIR_LISTING_SUFFIX}"
        if not os.path.isdir(top):
            above = os.path.dirname(top)
            if os.path.isdir(above):
                yield f"{above}{DIR_LISTING_SUFFIX}"
