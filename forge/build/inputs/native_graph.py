"""Inputs that tools report in addition to those observed: ninja in its files, compilers in depfiles, cargo.

Compilers report the headers that they read in depfiles, which ninja moves into its binary log .ninja_deps
(format versions 3 and 4).
"""

from __future__ import annotations

import os
import re
import struct
from collections import defaultdict
from dataclasses import field
from functools import lru_cache, partial
from pathlib import Path
from typing import TYPE_CHECKING

from forge.base.files import text_or_nothing
from forge.base.frozen import frozen
from forge.base.layout import SCRATCH_DIR
from forge.build.inputs.fingerprints import DIR_LISTING_SUFFIX, source_files, source_folders

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Mapping, Sequence

    from forge.engine.observation import Process

_text = partial(text_or_nothing, errors="surrogateescape")
_READ_BY_CMAKE = re.compile(r'^  "([^"]+)"$', re.MULTILINE)
_SIGNATURE = b"# ninjadeps\n"
_CMAKE_ROOT = re.compile(r"^CMAKE_ROOT:INTERNAL=(.+)$", re.MULTILINE)
_STAMP_WORDS = {3: 2, 4: 3}
"""The number of words between an output's id and its inputs, by version of the log."""

_TOKEN = re.compile(r"(?:\$\{\w+\}|\$.|[^\s$:|])+|\|\|?@?|:")
_ESCAPE = re.compile(r"\$([ :$])")
_WORKDIR = "${cmake_ninja_workdir}"
_COMPILES = re.compile(r"(C|CXX|ASM\w*|CUDA|HIP|OBJC|OBJCXX|ISPC|RC)_COMPILER_")
_LINKS_DYNAMICALLY = re.compile(r"\w+_(SHARED_LIBRARY|SHARED_MODULE|MODULE_LIBRARY|EXECUTABLE)_LINKER_")
_COMMAND = re.compile(r"^  COMMAND = (.*)$", re.MULTILINE)
_LINKED = re.compile(r"^  LINK_(?:FLAGS|LIBRARIES|PATH) = (.*)$", re.MULTILINE)
_DEPFILE = re.compile(r"^  depfile = (.*)$", re.MULTILINE)
_MAKE_WORD = re.compile(r"(?:\\.|[^\\\s])+")


@frozen
class Edge:
    """A command of the native tool, with absolute paths; `text` is the tool's description of it.

    Inputs that only have to exist before it runs are in `after`.
    """

    rule: str
    outputs: tuple[str, ...]
    inputs: tuple[str, ...] = ()
    text: str = ""
    after: tuple[str, ...] = ()

    @property
    def compiles(self) -> bool:
        return bool(_COMPILES.match(self.rule))

    @property
    def links_dynamically(self) -> bool:
        """Return whether the command links a program or a shared library, and runs nothing else."""
        runs_nothing = all(f"{hook} = :" in self.text for hook in ("POST_BUILD", "PRE_LINK"))
        return bool(_LINKS_DYNAMICALLY.match(self.rule)) and runs_nothing


@frozen
class NativeGraph:
    """The edges of the build graph, the reported inputs by output, and the files that CMake read."""

    edges: tuple[Edge, ...] = ()
    reported: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    read_by_cmake: tuple[str, ...] = ()
    tool: str = ""
    """'ninja', or '' for an unconfigured folder and for other tools, whose graphs are not available."""
    has_dyndeps: bool = False
    """Whether C++ modules or Fortran make the order of compilation depend on contents."""
    aliases: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    """The inputs of rules without a command, by their outputs."""

    def inputs_of(self, edge: Edge) -> tuple[str, ...]:
        """Return all known inputs of an edge, including reported ones."""
        return (*edge.inputs, *(path for output in edge.outputs for path in self.reported.get(output, ())))

    def users(self) -> Mapping[str, list[Edge]]:
        by_input: dict[str, list[Edge]] = defaultdict(list)
        for edge in self.edges:
            for path in self.inputs_of(edge):
                by_input[path].append(edge)
        return by_input

    def with_made_from(self, paths: Collection[str]) -> frozenset[str]:
        """Return paths and all outputs that are made from them, directly or not."""
        users, found, waiting = self.users(), {*paths}, [*paths]
        while waiting:
            outputs = {output for edge in users.get(waiting.pop(), ()) for output in edge.outputs}
            waiting += outputs - found
            found |= outputs
        return frozenset(found)

    def known(self) -> frozenset[str]:
        return frozenset(path for edge in self.edges for path in self.inputs_of(edge))

    def searched_by_linkers(self) -> Iterator[str]:
        """Yield where linkers look for libraries that are named with '-l', up to the first that exists."""
        for arguments in {" ".join(_LINKED.findall(edge.text)) for edge in self.edges}:
            words = arguments.split()
            folders = [os.path.realpath(word[2:]) for word in words if word.startswith("-L/")]
            for name in (word[2:] for word in words if word.startswith("-l")):
                names = (name[1:],) if name.startswith(":") else (f"lib{name}.so", f"lib{name}.a")
                for path in (f"{folder}/{each}" for folder in folders for each in names):
                    yield path
                    if Path(path).exists():
                        break


class EdgeFinder:
    """Finds the edge that a process below ninja runs."""

    def __init__(self, graph: NativeGraph) -> None:
        self._by_output = {output: edge for edge in graph.edges for output in edge.outputs}
        self._by_command = {
            _ESCAPE.sub(r"\1", match[1]): edge
            for edge in graph.edges
            if (match := _COMMAND.search(edge.text)) is not None
        }

    def __call__(self, process: Process, written: frozenset[str]) -> Edge | None:
        """Return the edge of a process that wrote some files; None if it is unknown."""
        edge = self._by_command.get(process.command)
        return edge or next((self._by_output[path] for path in written if path in self._by_output), None)


def read_native_graph(folder: Path, build: Path | None = None) -> NativeGraph:
    """Return the native tool's graph of a build folder, empty if unreadable or for several configurations.

    `build` is the original path of a folder that has been moved.
    """
    original, rules = build or folder, _text(folder / "build.ninja")
    several = (folder / "CMakeFiles" / "common.ninja").is_file()
    if not rules or several or not (folder / "CMakeFiles" / "rules.ninja").is_file():
        listed = _text(folder / "CMakeFiles" / "Makefile.cmake").partition("\n  )\n")[0]
        paths = (_absolute(original, path) for path in _READ_BY_CMAKE.findall(listed))
        return NativeGraph(read_by_cmake=tuple(paths))
    edges: list[Edge] = []
    read: tuple[str, ...] = ()
    aliases: dict[str, tuple[str, ...]] = {}
    for edge in _ninja_edges(str(original), rules):
        if edge.rule == "RERUN_CMAKE":
            read = edge.inputs
        elif edge.rule == "phony":
            aliases.update(dict.fromkeys(edge.outputs, edge.inputs))
        elif edge.rule not in _WITHOUT_FILES and edge.outputs:
            edges.append(edge)
    reported = dict(_ninja_reports(folder, original))
    for edge in edges:
        if edge.outputs[0] not in reported and (depfile := _DEPFILE.search(edge.text)):
            where = _absolute(original, _ESCAPE.sub(r"\1", depfile[1])).replace(str(original), str(folder), 1)
            _, _, words = _text(Path(where)).replace("\\\n", " ").partition(": ")
            reported[edge.outputs[0]] = tuple(
                _absolute(original, re.sub(r"\\(.)", r"\1", word))
                for word in _MAKE_WORD.findall(words.replace("$$", "$"))
            )
    return NativeGraph(tuple(edges), reported, read, "ninja", " dyndep = " in rules, aliases)


def cmake_edge(build: Path) -> Edge:
    """Return the edge of build.ninja that reruns CMake, or an empty one, without reading the whole graph."""
    rules = _text(build / "build.ninja").replace("$\n", "")
    # CMake 4.4 adds cmake_install.cmake to the outputs.
    match = re.search(r"^build (build\.ninja(?: .*)?: RERUN_CMAKE .*)", rules, re.MULTILINE)
    return _edge(build, match[1], "") if match else Edge("", ())


def unneeded_outputs(build: Path) -> frozenset[str]:
    """Return the outputs that the default targets of a build folder do not need, not even to be in order."""
    rules = _text(build / "build.ninja")
    edges = _ninja_edges(str(build), rules)
    makers = {output: edge for edge in edges for output in edge.outputs}
    defaults = re.findall(r"^default (.*)$", rules.replace("$\n", ""), re.MULTILINE)
    waiting = [path for line in defaults for path in _edge(build, line, "").outputs]
    needed = set[Edge]()
    while waiting:
        edge = makers.get(waiting.pop())
        if edge and edge not in needed:
            needed.add(edge)
            waiting += (*edge.inputs, *edge.after)
    unneeded = (edge for edge in edges if defaults and edge not in needed)
    return frozenset(output for edge in unneeded for output in edge.outputs)


_WITHOUT_FILES = frozenset({"phony", "CLEAN", "HELP", "VERIFY_GLOBS", "RERUN_CMAKE"})


@lru_cache(maxsize=4)  # several steps of a build read the same file
def _ninja_edges(build: str, rules: str) -> tuple[Edge, ...]:
    """Return the build statements of a build.ninja, with their bindings as text."""
    head = ""
    text: list[str] = []
    edges: list[Edge] = []
    for line in rules.replace("$\n", "").splitlines():
        if line.startswith("build "):
            if head:
                edges.append(_edge(build, head, "\n".join(text)))
            head, text = line[6:], []
        elif head and line.startswith("  "):
            text.append(line)
    if head:
        edges.append(_edge(build, head, "\n".join(text)))
    return tuple(edges)


def _edge(build: str | Path, head: str, text: str) -> Edge:
    outputs: list[str] = []
    inputs: list[str] = []
    after: list[str] = []
    rule, side = "", outputs
    for word in _TOKEN.findall(head):
        if word == ":" and side is outputs:
            side = inputs
        elif word in {"||", "|@"}:
            side = after
        elif word == "|":
            continue
        elif side is inputs and not rule:
            rule = word
        elif not word.startswith(_WORKDIR):
            side.append(_absolute(build, _ESCAPE.sub(r"\1", word) if "$" in word else word))
    return Edge(rule, tuple(outputs), tuple(inputs), text, tuple(after))


def _ninja_reports(folder: Path, build: Path) -> Iterator[tuple[str, tuple[str, ...]]]:
    """Yield each output of ninja's dependency log with its inputs, the newest record last."""
    try:
        log = (folder / ".ninja_deps").read_bytes()
    except OSError:
        return
    at = len(_SIGNATURE) + 4
    if not log.startswith(_SIGNATURE) or len(log) < at:
        return
    skipped = _STAMP_WORDS.get(struct.unpack_from("<i", log, len(_SIGNATURE))[0])
    if skipped is None:
        return
    paths: list[str] = []
    while at + 4 <= len(log):
        (word,) = struct.unpack_from("<I", log, at)
        size = word & 0x7FFFFFFF
        body = log[at + 4 : at + 4 + size]
        at += 4 + size
        if len(body) < size:
            break
        if not word & 0x80000000:
            paths.append(_absolute(build, body[:-4].rstrip(b"\0").decode(errors="surrogateescape")))
            continue
        words = struct.unpack(f"<{size // 4}I", body[: size // 4 * 4])
        if words and words[0] < len(paths):
            yield paths[words[0]], tuple(paths[number] for number in words[skipped:] if number < len(paths))


def _absolute(build: str | Path, path: str) -> str:
    return os.path.normpath(os.path.join(build, path))  # noqa: PTH118  (thousands: no Path for each)


def reported_inputs(build: Path, graph: NativeGraph, inside: Sequence[Path]) -> frozenset[str]:
    """Return the files outside of `inside` that the last build reportedly read, and its questions.

    `graph` is that of the native tool. CMake's own modules are left out: CMake is tracked as a tool.
    """
    own = tuple(f"{path}{os.sep}" for path in inside)
    cmakes = cmake_root(build)
    paths = {*graph.known(), *graph.read_by_cmake}
    for path in _listed(build, "read_by_backend"):  # the inputs of cargo
        if not Path(path).is_dir():
            paths.add(path)
        elif not any(f"{folder}/".startswith(f"{path}/") for folder in inside):
            paths.update(source_files(path), (f"{each}{DIR_LISTING_SUFFIX}" for each in source_folders(path)))
    return frozenset(
        path for path in paths if not path.startswith(own) and not (cmakes and path.startswith(cmakes))
    )


def cmake_root(build: Path) -> str:
    """Return the folder of CMake's own modules, ending with '/', from the CMake cache, or ''."""
    match = _CMAKE_ROOT.search(_text(build / "CMakeCache.txt"))
    return f"{match.group(1)}/" if match else ""


def written_by_backend(build: Path) -> Iterator[str]:
    """Yield the Cargo.lock that cargo wrote."""
    return _listed(build, "written_by_backend")


def _listed(build: Path, name: str) -> Iterator[str]:
    return filter(None, _text(build / SCRATCH_DIR / name).split("\n"))
