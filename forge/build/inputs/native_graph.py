"""Read the build graph of a build folder from files of ninja or make, and what compilers reported.

CMake writes build.ninja, or a build.make for each target. Compilers report the headers that they read in
depfiles; ninja moves those into its binary log .ninja_deps (format versions 3 and 4), make leaves them.
"""

from __future__ import annotations

import os
import re
import struct
from collections import defaultdict
from dataclasses import field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from forge.base.files import text_or_nothing
from forge.base.frozen import frozen

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

_text = partial(text_or_nothing, errors="surrogateescape")
_SIGNATURE = b"# ninjadeps\n"
_STAMP_WORDS = {3: 2, 4: 3}
"""The number of words between an output's id and its inputs, by version of the log."""

_TOKEN = re.compile(r"(?:\$\{\w+\}|\$.|[^\s$:|])+|\|\|?@?|:")
_ESCAPE = re.compile(r"\$([ :$])")
_WORKDIR = "${cmake_ninja_workdir}"
_COMPILES = re.compile(r"(C|CXX|ASM\w*|CUDA|HIP|OBJC|OBJCXX|ISPC|RC)_COMPILER_")
_LINKS = re.compile(r"\w+_(STATIC_LIBRARY|SHARED_LIBRARY|SHARED_MODULE|MODULE_LIBRARY|EXECUTABLE)_LINKER_")
_LINKS_DYNAMICALLY = re.compile(r"\w+_(SHARED_LIBRARY|SHARED_MODULE|MODULE_LIBRARY|EXECUTABLE)_LINKER_")
_GENERATORS = re.compile(r"/rosidl_(adapter|cmake|generator_\w+|typesupport_\w+)/")
"""Commands of rosidl, which declare each file that they read and each that they write."""
_FORGE_GENERATOR = re.compile(r"/worker_client\.py interface generate @")
"""Writes a depfile of all that it read; what it writes is known to itself alone."""

_READ_BY_CMAKE = re.compile(r'^  "([^"]+)"$', re.MULTILINE)
_MAKE_EDGE = re.compile(r"^([^#.%\s][^:=\n]*):(?: (\S.*)|)\n((?:\t.*\n)*)", re.MULTILINE)
_MAKE_LINKING = re.compile(
    r"\t@?(cd .+? && )?\$\(CMAKE_COMMAND\) "
    r"(-E cmake_(echo_color|link_script|symlink_\w+)|-P \S+cmake_clean_target)"
)
_MAKE_OWN = re.compile(r"\.dir/(flags\.make|build\.make|link\.txt|compiler_depend\.\w+)$")
"""Files of CMake's own that its rules list beside a command's inputs."""
_MAKE_COMPILES, _MAKE_LINKS = "C_COMPILER_", "LINKER"
_MAKE_WORD = re.compile(r"(?:\\.|[^\\\s])+")


@frozen
class Edge:
    """A command of the native tool. Paths are absolute; `text` is what the tool says of the command."""

    rule: str
    outputs: tuple[str, ...]
    inputs: tuple[str, ...]
    text: str = ""

    @property
    def compiles(self) -> bool:
        """Return True if the command compiles one file."""
        return bool(_COMPILES.match(self.rule))

    @property
    def links(self) -> bool:
        """Return True if the command makes a library or a program, whatever else it runs."""
        return self.rule == _MAKE_LINKS or bool(_LINKS.match(self.rule))

    @property
    def links_dynamically(self) -> bool:
        """Tell if the command links a program or a shared library, and runs nothing else."""
        return bool(_LINKS_DYNAMICALLY.match(self.rule)) and self.outputs_known

    @property
    def inputs_known(self) -> bool:
        """Tell if the native tool knows all that the command reads.

        Compilers report what they read; linkers read what CMake lists; rosidl's generators and forge's own
        declare their inputs. Any other add_custom_command, an ExternalProject or a POST_BUILD step may read
        what it declares nowhere.
        """
        return self.outputs_known or bool(_FORGE_GENERATOR.search(self.text))

    @property
    def outputs_known(self) -> bool:
        """Return True if the native tool knows all inputs and outputs of the command."""
        if self.compiles:
            return True
        if self.rule == _MAKE_LINKS:
            return True
        if _LINKS.match(self.rule):
            return all(f"{hook} = :" in self.text for hook in ("POST_BUILD", "PRE_LINK"))
        return self.rule == "CUSTOM_COMMAND" and bool(_GENERATORS.search(self.text))


@frozen
class NativeGraph:
    """The edges of the build graph, the reported inputs by output, and the files that CMake read."""

    edges: tuple[Edge, ...] = ()
    reported: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    read_by_cmake: tuple[str, ...] = ()
    tool: str = ""
    """'ninja' or 'make'; '' for an unconfigured folder."""
    has_dyndeps: bool = False
    """Whether C++ modules or Fortran make the order of compilation depend on contents."""
    written_by_cmake: tuple[str, ...] = ()
    aliases: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    """The inputs of rules without a command, by their outputs."""

    def inputs_of(self, edge: Edge) -> tuple[str, ...]:
        """Return all known inputs of an edge, including reported ones."""
        return (*edge.inputs, *(path for output in edge.outputs for path in self.reported.get(output, ())))

    def users(self) -> Mapping[str, list[Edge]]:
        """Return the edges that have a path as an input, by the path."""
        found: dict[str, list[Edge]] = defaultdict(list)
        for edge in self.edges:
            for path in self.inputs_of(edge):
                found[path].append(edge)
        return found

    def known(self) -> frozenset[str]:
        """Return every path that is an input of some edge."""
        return frozenset(path for edge in self.edges for path in self.inputs_of(edge))

    def compiled_sources(self) -> frozenset[str]:
        """Return the files that are compiled, without the headers that they include."""
        return frozenset(path for edge in self.edges if edge.compiles for path in edge.inputs[:1])

    def reported_by_compilers(self) -> frozenset[str]:
        """Return the files that compilers reported as read: sources and headers."""
        return frozenset(path for edge in self.edges if edge.compiles for path in self.inputs_of(edge))

    def opaque(self) -> tuple[Edge, ...]:
        """Return the commands with outputs that may have undeclared inputs."""
        return tuple(
            edge for edge in self.edges if not edge.inputs_known and any(map(os.path.lexists, edge.outputs))
        )


def read_native_graph(folder: Path, build: Path | None = None) -> NativeGraph:
    """Return what the native tool knows of a build folder; an unreadable log counts as no reports.

    `build` is where the folder stood when it was configured, if it has been moved. One that was configured
    for several configurations at once counts as unknown.
    """
    rules = _text(folder / "build.ninja")
    several = (folder / "CMakeFiles" / "common.ninja").is_file()
    if rules and not several and (folder / "CMakeFiles" / "rules.ninja").is_file():
        return _ninja_graph(folder, build or folder, rules)
    if (folder / "CMakeFiles" / "Makefile.cmake").is_file():
        return _make_graph(folder, build or folder)
    return NativeGraph()


def cmake_edge(build: Path) -> Edge:
    """Return the edge of build.ninja that reruns CMake, or an empty one, without reading the whole graph."""
    rules = _text(build / "build.ninja").replace("$\n", "")
    # CMake 4.4 adds cmake_install.cmake to the outputs.
    found = re.search(r"^build (build\.ninja(?: .*)?: RERUN_CMAKE .*)", rules, re.MULTILINE)
    return _edge(build, found[1], "") if found else Edge("", (), (), "")


def _ninja_graph(folder: Path, build: Path, rules: str) -> NativeGraph:
    edges: list[Edge] = []
    read: tuple[str, ...] = ()
    written: tuple[str, ...] = ()
    aliases: dict[str, tuple[str, ...]] = {}
    for edge in _ninja_edges(build, rules):
        if edge.rule == "RERUN_CMAKE":
            read, written = edge.inputs, edge.outputs
        elif edge.rule == "phony":
            aliases.update(dict.fromkeys(edge.outputs, edge.inputs))
        elif edge.rule not in _WITHOUT_FILES and edge.outputs:
            edges.append(edge)
    reported = dict(_ninja_reports(folder, build))
    for edge in edges:
        depfile = _binding(edge.text, "depfile")
        if depfile and edge.outputs[0] not in reported:
            where = _absolute(build, depfile).replace(str(build), str(folder), 1)
            reported[edge.outputs[0]] = tuple(_depfile(build, Path(where)))
    return NativeGraph(tuple(edges), reported, read, "ninja", " dyndep = " in rules, written, aliases)


_WITHOUT_FILES = frozenset({"phony", "CLEAN", "HELP", "VERIFY_GLOBS", "RERUN_CMAKE"})


def _ninja_edges(build: Path, rules: str) -> Iterator[Edge]:
    """Yield the build statements of a build.ninja, with their bindings as text."""
    head = ""
    text: list[str] = []
    for line in rules.replace("$\n", "").splitlines():
        if line.startswith("build "):
            if head:
                yield _edge(build, head, "\n".join(text))
            head, text = line[6:], []
        elif head and line.startswith("  "):
            text.append(line)
    if head:
        yield _edge(build, head, "\n".join(text))


def _edge(build: Path, head: str, text: str) -> Edge:
    outputs: list[str] = []
    inputs: list[str] = []
    rule, side, order_only = "", outputs, False
    for word in _TOKEN.findall(head):
        if word == ":" and side is outputs:
            side = inputs
        elif word in {"||", "|@"}:
            order_only = True
        elif word == "|":
            continue
        elif side is inputs and not rule:
            rule = word
        elif not order_only and not word.startswith(_WORKDIR):
            side.append(_absolute(build, _ESCAPE.sub(r"\1", word)))
    return Edge(rule, tuple(outputs), tuple(inputs), text)


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


def _make_graph(top: Path, build: Path) -> NativeGraph:
    listed = _text(top / "CMakeFiles" / "Makefile.cmake").partition("\n  )\n")[0]
    edges: list[Edge] = []
    reported = {}
    for folder, _, files in os.walk(top):
        for name in files:
            path = Path(folder, name)
            if name == "build.make":
                edges += _make_edges(build, path)
            elif name.endswith(".o.d"):
                reported[str(path).replace(str(top), str(build), 1)[:-2]] = tuple(_depfile(build, path))
    read = tuple(_absolute(build, path) for path in _READ_BY_CMAKE.findall(listed))
    return NativeGraph(tuple(edges), reported, read, "make")


def _make_edges(build: Path, makefile: Path) -> Iterator[Edge]:
    """Yield one edge for each file that a makefile of CMake makes.

    A target's flags and its link command are in files beside the makefile. A rule that neither compiles nor
    only links is a command of the package's own.
    """
    flags, link = (_text(makefile.with_name(name)) for name in ("flags.make", "link.txt"))
    inputs: dict[str, list[str]] = {}
    recipes: dict[str, str] = {}
    for match in _MAKE_EDGE.finditer(_text(makefile)):
        target = _make_path(match[1].rstrip())
        paths = [_make_path(word) for word in _MAKE_WORD.findall(match[2] or "")]
        inputs.setdefault(target, []).extend(path for path in paths if not _MAKE_OWN.search(path))
        recipes[target] = recipes.get(target, "") + match[3]
    for target, paths in inputs.items():
        rule, text = _make_rule(target, recipes[target], flags, link)
        yield Edge(rule, (_absolute(build, target),), tuple(_absolute(build, path) for path in paths), text)


def _make_rule(target: str, recipe: str, flags: str, link: str) -> tuple[str, str]:
    """Return a name for what a recipe does, and what there is to know of its command."""
    if target.endswith(".o"):
        return _MAKE_COMPILES, recipe + flags
    lines = [line for line in recipe.splitlines() if line.strip()]
    if "cmake_link_script" in recipe and all(map(_MAKE_LINKING.match, lines)):
        return _MAKE_LINKS, recipe + link
    return "CUSTOM_COMMAND", recipe + link


def _make_path(word: str) -> str:
    return re.sub(r"\\(.)", r"\1", word.replace("$$", "$"))


def _depfile(build: Path, path: Path) -> Iterator[str]:
    """Yield the inputs that a depfile in make's syntax names."""
    _, _, words = _text(path).replace("\\\n", " ").partition(": ")
    for word in _MAKE_WORD.findall(words.replace("$$", "$")):
        yield _absolute(build, re.sub(r"\\(.)", r"\1", word))


def _binding(text: str, name: str) -> str:
    match = re.search(rf"^  {name} = (.*)$", text, re.MULTILINE)
    return _ESCAPE.sub(r"\1", match.group(1)) if match else ""


def _absolute(build: Path, path: str) -> str:
    return os.path.normpath(os.path.join(build, path))  # noqa: PTH118  (thousands: no Path for each)
