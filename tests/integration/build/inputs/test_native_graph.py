"""The build graph, read from build folders of CMake, ninja and make."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

from forge.build.inputs.native_graph import Edge, NativeGraph, cmake_edge, read_native_graph

pytestmark = pytest.mark.needs("cmake", "gcc", "ninja", "make")

_CMAKE = r"""cmake_minimum_required(VERSION 3.18)
project(shapes C)
file(READ notes.txt notes)
configure_file(made.h.in made.h)
add_library(plain STATIC plain.c "sub folder/blank name.c" "sub folder/größe.c" "sub folder/cash$flow.c")
target_include_directories(plain PRIVATE include "sub folder" ${CMAKE_CURRENT_BINARY_DIR})
add_custom_command(OUTPUT listed.h DEPENDS script.sh
  COMMAND sh ${CMAKE_CURRENT_SOURCE_DIR}/script.sh listed.h)
add_custom_command(OUTPUT unlisted.h COMMAND sh ${CMAKE_CURRENT_SOURCE_DIR}/script.sh unlisted.h)
add_executable(tool main.c listed.h unlisted.h)
target_include_directories(tool PRIVATE ${CMAKE_CURRENT_BINARY_DIR})
target_link_libraries(tool plain -L/usr/lib -lm)
add_executable(hooked main.c listed.h unlisted.h)
target_include_directories(hooked PRIVATE ${CMAKE_CURRENT_BINARY_DIR})
target_link_libraries(hooked plain)
add_custom_command(TARGET hooked POST_BUILD COMMAND sh ${CMAKE_CURRENT_SOURCE_DIR}/script.sh after.txt)
"""
_FILES = {
    "CMakeLists.txt": _CMAKE,
    "notes.txt": "1\n",
    "made.h.in": "#define MADE 1\n",
    "script.sh": 'echo "#define X 1" > "$1"\n',
    "include/plain.h": "int plain(void);\n",
    "plain.c": '#include "plain.h"\n#include "made.h"\nint plain(void) { return MADE; }\n',
    "sub folder/own name.h": "#define OWN 1\n",
    "sub folder/blank name.c": '#include "own name.h"\nint blank(void) { return OWN; }\n',
    "sub folder/größe.c": "int size(void) { return 1; }\n",
    "sub folder/cash$flow.c": "int cash(void) { return 1; }\n",
    "main.c": '#include "listed.h"\n#include "unlisted.h"\nint plain(void);\nint main() { plain(); }\n',
}


def configure(root: Path, files: dict[str, str], generator: str, *, build: bool = True) -> Path:
    """Write a project below a folder, configure it and perhaps build it; return the build folder."""
    for name, text in files.items():
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    folder = root.with_name(f"{root.name}.build")
    run("cmake", "-G", generator, "-S", str(root), "-B", str(folder))
    if build:
        run("cmake", "--build", str(folder))
    return folder


def run(*argv: str) -> None:
    """Run a program that must succeed."""
    ran = subprocess.run(argv, capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stdout + ran.stderr


@pytest.fixture(scope="module", params=["Ninja", "Unix Makefiles"])
def build(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a build folder of the project above, in a folder with a blank in its name."""
    return configure(tmp_path_factory.mktemp("native graph") / "our shapes", _FILES, request.param)


@pytest.fixture
def source(build: Path) -> Path:
    """Return the folder of its sources."""
    return build.with_suffix("")


@pytest.fixture
def graph(build: Path) -> NativeGraph:
    """Return what is read of it."""
    return read_native_graph(build)


def edge_of(graph: NativeGraph, output: Path) -> Edge:
    """Return the one edge that makes a file."""
    edges = {edge.text: edge for edge in graph.edges if str(output) in edge.outputs}
    assert edges, f"nothing makes {output} among {[edge.outputs for edge in graph.edges]}"
    return next(iter(edges.values()))


def test_sources_and_headers_of_an_object_are_known(graph: NativeGraph, build: Path, source: Path) -> None:
    edge = edge_of(graph, build / "CMakeFiles/plain.dir/plain.c.o")
    inputs = graph.inputs_of(edge)
    assert edge.compiles
    assert edge.inputs[0] == str(source / "plain.c")
    assert {str(source / "include/plain.h"), str(build / "made.h")} <= {*inputs}
    assert any(path.startswith("/usr/") for path in inputs), "system headers count"


@pytest.mark.parametrize("name", ["blank name.c", "größe.c", "cash$flow.c"])
def test_quoted_names_in_build_rules_are_unquoted(graph: NativeGraph, source: Path, name: str) -> None:
    assert str(source / "sub folder" / name) in graph.known()
    assert str(source / "sub folder" / name) in graph.compiled_sources()


def test_headers_with_spaces_in_their_names_are_known(graph: NativeGraph, source: Path) -> None:
    header = str(source / "sub folder/own name.h")
    edges = [edge for edge in graph.edges if header in graph.inputs_of(edge)]
    assert [edge.inputs[0] for edge in edges] == [str(source / "sub folder/blank name.c")]


def test_a_library_depends_on_its_objects(graph: NativeGraph, build: Path) -> None:
    edge = edge_of(graph, build / "libplain.a")
    assert edge.outputs_known
    assert str(build / "CMakeFiles/plain.dir/plain.c.o") in edge.inputs


def test_the_command_line_of_a_link_is_known(graph: NativeGraph, build: Path) -> None:
    edge = edge_of(graph, build / "tool")
    assert edge.outputs_known
    assert "-lm" in edge.text


def test_include_folders_of_compile_commands_are_known(graph: NativeGraph, build: Path, source: Path) -> None:
    text = edge_of(graph, build / "CMakeFiles/plain.dir/plain.c.o").text
    assert str(source).replace(" ", "") in text.replace("$ ", "").replace("\\ ", "").replace(" ", "")


def test_a_post_link_command_is_opaque(graph: NativeGraph, build: Path) -> None:
    edge = edge_of(graph, build / "hooked")
    assert not edge.inputs_known
    assert not edge.outputs_known


@pytest.mark.parametrize("name", ["listed.h", "unlisted.h"])
def test_custom_commands_are_opaque_with_or_without_declared_inputs(
    graph: NativeGraph, build: Path, name: str
) -> None:
    assert edge_of(graph, build / name) in graph.opaque()


def test_only_custom_commands_are_opaque(graph: NativeGraph, build: Path) -> None:
    outputs = {output for edge in graph.opaque() for output in edge.outputs}
    assert outputs == {str(build / name) for name in ("listed.h", "unlisted.h", "hooked")}


def test_a_command_that_never_ran_has_no_inputs(tmp_path: Path) -> None:
    folder = configure(tmp_path / "shapes", _FILES, "Ninja", build=False)
    assert read_native_graph(folder).opaque() == ()


def test_files_read_by_cmake_are_known(graph: NativeGraph, source: Path) -> None:
    assert {str(source / "CMakeLists.txt"), str(source / "made.h.in")} <= {*graph.read_by_cmake}
    assert str(source / "notes.txt") not in graph.read_by_cmake, "CMake keeps no account of file(READ)"


def test_files_read_by_cmake_are_found_without_reading_the_whole_graph(
    graph: NativeGraph, build: Path
) -> None:
    if graph.tool == "ninja":
        assert cmake_edge(build).inputs == graph.read_by_cmake
    else:
        assert cmake_edge(build).inputs == ()


def test_a_moved_build_folder_keeps_its_recorded_paths(build: Path, graph: NativeGraph) -> None:
    moved = build.with_name(".moved")
    shutil.copytree(build, moved)
    try:
        assert read_native_graph(moved, build) == graph
    finally:
        shutil.rmtree(moved)


def test_depfiles_of_custom_commands_count_before_and_after_ninja_reads_them(tmp_path: Path) -> None:
    text = r"""cmake_minimum_required(VERSION 3.21)
project(dep NONE)
add_custom_target(all_of_it ALL DEPENDS out.txt)
add_custom_command(OUTPUT out.txt DEPFILE out.d COMMAND sh ${CMAKE_CURRENT_SOURCE_DIR}/make.sh)
"""
    script = """here=$(dirname "$0")
cat "$here"/read*.txt > out.txt
echo "out.txt: $here/read:1.txt $here/read\\\\ 2.txt" > out.d
"""
    files = {"CMakeLists.txt": text, "make.sh": script, "read:1.txt": "1\n", "read 2.txt": "2\n"}
    folder = configure(tmp_path / "dep", files, "Ninja")
    assert {str(tmp_path / "dep" / name) for name in ("read:1.txt", "read 2.txt")} <= read_native_graph(
        folder
    ).known()


def test_colons_in_names_do_not_end_the_outputs(tmp_path: Path) -> None:
    text = r"""cmake_minimum_required(VERSION 3.18)
project(colon NONE)
add_custom_target(all_of_it ALL DEPENDS out.txt)
add_custom_command(OUTPUT out.txt DEPENDS "a:b $c.txt" COMMAND touch out.txt)
"""
    folder = configure(tmp_path / "colon", {"CMakeLists.txt": text, "a:b $c.txt": ""}, "Ninja")
    edge = edge_of(read_native_graph(folder), folder / "out.txt")
    assert edge.inputs == (str(tmp_path / "colon" / "a:b $c.txt"),)


def test_multi_configuration_builds_are_unknown(tmp_path: Path) -> None:
    files = {"CMakeLists.txt": "cmake_minimum_required(VERSION 3.18)\nproject(several NONE)\n"}
    folder = configure(tmp_path / "several", files, "Ninja Multi-Config")
    assert read_native_graph(folder).tool == ""


def test_unconfigured_build_folders_are_unknown(tmp_path: Path) -> None:
    assert read_native_graph(tmp_path).tool == ""
    assert read_native_graph(tmp_path / "missing").tool == ""


def test_dyndeps_are_detected(tmp_path: Path) -> None:
    folder = configure(tmp_path / "shapes", _FILES, "Ninja", build=False)
    assert not read_native_graph(folder).has_dyndeps
    rules = folder / "build.ninja"
    rules.write_text(
        rules.read_text(encoding="utf-8") + "\nbuild m.o: cc m.cpp\n  dyndep = CXX.dd\n", "utf-8"
    )
    assert read_native_graph(folder).has_dyndeps, "ninja is told of C++ modules so"


@pytest.mark.parametrize("damage", ["cut", "empty", "noise", "version"])
def test_a_damaged_ninja_log_raises_no_error(damage: str, tmp_path: Path) -> None:
    folder = configure(tmp_path / "shapes", _FILES, "Ninja")
    log = folder / ".ninja_deps"
    content, whole = log.read_bytes(), read_native_graph(folder)
    said = {
        "cut": content[: len(content) // 2 + 1],
        "empty": b"",
        "noise": content[:16] + bytes(range(256)) * 8,
        "version": content[:12] + b"\x63\0\0\0" + content[16:],
    }
    log.write_bytes(said[damage])
    left = read_native_graph(folder)
    assert left.edges == whole.edges
    assert left.reported.keys() <= whole.reported.keys()
