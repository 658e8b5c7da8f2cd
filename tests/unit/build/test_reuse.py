"""How much of a build folder is reused, decided from what changed."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import pytest

from forge.build.inputs.input_manifest import Changes
from forge.build.inputs.native_graph import Edge, NativeGraph
from forge.build.reuse import Reuse, decide, restorable_outputs, undeclared_readers

if TYPE_CHECKING:
    from collections.abc import Mapping

_LINK = "CXX_EXECUTABLE_LINKER__tool_Debug"
_HOOKS = "  POST_BUILD = :\n  PRE_LINK = :"
_COMPILE = "CXX_COMPILER__tool_Debug"

OBJECT = Edge(_COMPILE, ("/b/a.o",), ("/p/a.cpp",), "  INCLUDES = -I/p/early -I/p/include")
OTHER = Edge(_COMPILE, ("/b/other.o",), ("/p/other.cpp",))
LINK = Edge(_LINK, ("/b/tool",), ("/b/a.o", "/b/other.o", "/n/lib/libneed.a"), _HOOKS)
BY_NAME = Edge(_LINK, ("/b/by_name",), ("/b/other.o",), f"{_HOOKS}\n  LINK_LIBRARIES = -L/n/lib -lneed")
TABLE = __file__
"""What a command has made: a file that is there."""
COMMAND = Edge("CUSTOM_COMMAND", (TABLE,), (), "  COMMAND = sh /p/script.sh /p/table.txt > table.h")
GRAPH = NativeGraph(
    (OBJECT, OTHER, LINK),
    {"/b/a.o": ("/p/a.cpp", "/p/include/a.h", "/n/include/need.h"), "/b/other.o": ("/p/other.cpp",)},
    ("/p/CMakeLists.txt", "/p/made.h.in", "/n/share/need/needConfig.cmake", "/cmake/FindThreads.cmake"),
    "ninja",
)
FOUND = NativeGraph((OTHER, BY_NAME), {}, (), "ninja")
SCRIPTED = NativeGraph((replace(LINK, text=f"{_HOOKS}\n  FLAGS = -T/p/memory.ld"),), {}, (), "ninja")
MAKE = replace(GRAPH, tool="make")

NO_CHANGES = Changes()
NOTHING, PRODUCTS, EVERYTHING = Reuse.NOTHING, Reuse.PRODUCTS, Reuse.EVERYTHING


def modified(*paths: str) -> Changes:
    """Return changes of contents."""
    return Changes(modified=frozenset(paths))


def added(*paths: str) -> Changes:
    """Return files that came."""
    return Changes(added=frozenset(paths))


def removed(*paths: str) -> Changes:
    """Return files that went."""
    return Changes(removed=frozenset(paths))


@dataclass(frozen=True)
class Case:
    """What changed in the package and in its needs, what files say, and what is to be decided."""

    reuse: Reuse
    dropped: set[str] = field(default_factory=set)
    own: Changes = NO_CHANGES
    needed: Changes = NO_CHANGES
    texts: Mapping[str, str] = field(default_factory=dict)
    graph: NativeGraph = GRAPH


def with_edges(*edges: Edge) -> NativeGraph:
    """Return the graph with more edges."""
    return replace(GRAPH, edges=(*GRAPH.edges, *edges))


CASES = {
    "nothing": Case(EVERYTHING),
    "nothing, by make": Case(EVERYTHING, graph=MAKE),
    "a source": Case(EVERYTHING, {"/b/a.o"}, modified("/p/a.cpp")),
    "a source, by make": Case(EVERYTHING, {"/b/a.o"}, modified("/p/a.cpp"), graph=MAKE),
    "a header that a compiler reported": Case(EVERYTHING, {"/b/a.o"}, modified("/p/include/a.h")),
    "a header of a need": Case(EVERYTHING, {"/b/a.o"}, needed=modified("/n/include/need.h")),
    "a library of a need": Case(EVERYTHING, {"/b/tool"}, needed=modified("/n/lib/libneed.a")),
    "a library that one target lists and another finds by -l": Case(
        EVERYTHING, {"/b/tool", "/b/by_name"}, needed=modified("/n/lib/libneed.a"), graph=with_edges(BY_NAME)
    ),
    "a shared library that nobody lists, found by -l": Case(
        EVERYTHING,
        {"/b/by_name"},
        needed=modified("/n/lib/libneed.so.1.2"),
        graph=FOUND,
    ),
    "a library of which another's name is the beginning": Case(
        EVERYTHING,
        needed=modified("/n/lib/libneedle.a"),
        graph=FOUND,
    ),
    "a data file that nobody reads": Case(EVERYTHING, own=modified("/p/data.txt")),
    "a data file that an .incbin names": Case(
        EVERYTHING, {"/b/a.o"}, modified("/p/blob.bin"), texts={"/p/a.cpp": 'asm(".incbin \\"blob.bin\\"");'}
    ),
    "a data file that an .incbin in a header names": Case(
        EVERYTHING,
        {"/b/a.o"},
        modified("/p/blob.bin"),
        texts={"/p/include/a.h": 'asm(".incbin \\"blob.bin\\"");'},
    ),
    "a linker script that a command line names": Case(
        EVERYTHING,
        {"/b/tool"},
        modified("/p/memory.ld"),
        graph=SCRIPTED,
    ),
    "a file that one command declares and a source takes in by .incbin": Case(
        EVERYTHING,
        {"/b/out.txt", "/b/other.o"},
        modified("/p/blob.bin"),
        texts={"/p/other.cpp": 'asm(".incbin \\"blob.bin\\"");'},
        graph=with_edges(
            Edge("CUSTOM_COMMAND", ("/b/out.txt",), ("/p/blob.bin",), "/rosidl_adapter/rosidl_adapter")
        ),
    ),
    "a new header": Case(PRODUCTS, own=added("/p/early/new.h")),
    "a new header before one that is included": Case(
        PRODUCTS, {"/b/a.o"}, added("/p/early/a.h"), texts={"/p/a.cpp": '#include "a.h"\n'}
    ),
    "a new header that __has_include asks for": Case(
        PRODUCTS, {"/b/a.o"}, added("/p/early/maybe.h"), texts={"/p/include/a.h": '__has_include("maybe.h")'}
    ),
    "a header that is gone and was included": Case(
        PRODUCTS, {"/b/a.o"}, removed("/p/include/a.h"), texts={"/p/a.cpp": '#include "a.h"\n'}
    ),
    "a header that is gone, which another source only asked for": Case(
        PRODUCTS,
        {"/b/a.o", "/b/other.o"},
        removed("/p/include/a.h"),
        texts={"/p/other.cpp": "#if __has_include(<a.h>)\n"},
    ),
    "a new header of a need": Case(
        PRODUCTS, {"/b/a.o"}, needed=added("/n/first/need.h"), texts={"/p/a.cpp": "#include <need.h>\n"}
    ),
    "a new source": Case(PRODUCTS, own=added("/p/new.cpp")),
    "a new source, by make": Case(NOTHING, own=added("/p/new.cpp"), graph=MAKE),
    "a new folder": Case(PRODUCTS, own=added("/p/folder/")),
    "what CMake read": Case(PRODUCTS, own=modified("/p/CMakeLists.txt")),
    "what CMake read, by make": Case(NOTHING, own=modified("/p/CMakeLists.txt"), graph=MAKE),
    "the template of configure_file": Case(PRODUCTS, own=modified("/p/made.h.in")),
    "the config file of a need": Case(PRODUCTS, needed=modified("/n/share/need/needConfig.cmake")),
    "a pkg-config file of a need": Case(PRODUCTS, needed=modified("/n/lib/pkgconfig/need.pc")),
    "a file where CMake code reads files": Case(
        PRODUCTS, own=modified("/p/VERSION"), texts={"/p/CMakeLists.txt": "file(STRINGS VERSION version)\n"}
    ),
    "a file where CMake code runs programs": Case(
        PRODUCTS, own=modified("/p/say.sh"), texts={"/p/CMakeLists.txt": "execute_process(COMMAND sh say.sh)"}
    ),
    "a header of a need that a find module of CMake's reads": Case(
        PRODUCTS,
        {"/b/a.o"},
        needed=modified("/n/include/need.h"),
        graph=replace(GRAPH, read_by_cmake=("/p/CMakeLists.txt", "/cmake/FindNeed.cmake")),
    ),
    "a file that a command of the package may read": Case(
        PRODUCTS, {TABLE}, modified("/p/table.txt"), graph=with_edges(COMMAND)
    ),
    "a header that a command of the package may read, too": Case(
        PRODUCTS, {TABLE, "/b/a.o"}, modified("/p/include/a.h"), graph=with_edges(COMMAND)
    ),
    "a source that no command of the package names": Case(
        EVERYTHING, {"/b/a.o"}, modified("/p/a.cpp"), graph=with_edges(COMMAND)
    ),
    "a source that a script of the package names": Case(
        PRODUCTS,
        {TABLE, "/b/a.o"},
        modified("/p/a.cpp"),
        texts={"/p/script.sh": 'grep -c "" a.cpp\n'},
        graph=with_edges(COMMAND),
    ),
    "a precompiled header": Case(
        EVERYTHING, {"/b/a.o", "/b/other.o", "/b/tool"}, needed=modified("/n/include/all.h.gch")
    ),
    "anything where the order of compilation depends on contents": Case(
        NOTHING, own=modified("/p/a.cpp"), graph=replace(GRAPH, has_dyndeps=True)
    ),
    "anything in a folder that no tool knows": Case(NOTHING, own=modified("/p/a.cpp"), graph=NativeGraph()),
}


@pytest.mark.parametrize("name", CASES)
def test_it_is_decided_by_what_changed(name: str) -> None:
    case = CASES[name]
    texts = {"/p/CMakeLists.txt": "project(p)\n", **case.texts}
    found = decide(
        case.graph,
        case.own,
        case.needed,
        lambda path: texts.get(path, "").encode(),
        lambda path: path.startswith("/cmake/"),
    )
    assert found.reuse is case.reuse
    assert case.dropped <= found.dropped, "what was made from it must go"
    if case.reuse is EVERYTHING:
        assert found.dropped == case.dropped, "and nothing else"


def test_only_objects_that_were_not_dropped_are_restored() -> None:
    assert restorable_outputs(GRAPH, frozenset({"/b/a.o"})) == ("/b/other.o", "/b/tool")


def test_what_a_command_of_the_package_made_stays_away_with_all_that_is_made_from_it() -> None:
    reported = {**GRAPH.reported, "/b/a.o": ("/p/a.cpp", TABLE)}
    graph = replace(with_edges(COMMAND), reported=reported)
    assert restorable_outputs(graph, frozenset()) == ("/b/other.o",)


def test_a_target_with_a_command_after_its_link_is_linked_again() -> None:
    hooked = replace(LINK, text="  POST_BUILD = cp tool /p/tool\n  PRE_LINK = :")
    assert restorable_outputs(NativeGraph((OBJECT, hooked), {}, (), "ninja"), frozenset()) == ("/b/a.o",)


def test_sources_that_name_a_changed_file_are_found_without_a_report() -> None:
    changes = modified("/b/blob.bin")
    texts = {"/p/a.cpp": b"blob.bin"}
    assert undeclared_readers(GRAPH, changes, lambda path: texts.get(path, b"")) == {"/b/a.o"}
