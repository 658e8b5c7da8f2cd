"""An incremental build equals a clean build, whatever input changed and however it is used."""

import os
import shutil
import subprocess
import time
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import pytest

from tests.conftest import Forge, Ran, Tree
from tests.evolving import look
from tests.packages import manifest_text

pytestmark = pytest.mark.needs("cmake", "gcc")

PROGRAM = "#ifndef V\n#define V 0\n#endif\nint value = V;\nint main(void) { return V; }\n"
BUILD = "add_executable(x x.c)\ninstall(TARGETS x DESTINATION bin)\n"
INCLUDES = '#include "v.h"\n' + PROGRAM
CALLS = "int foo(void);\nint main(void) { return foo(); }\n"


def packages(**bodies: str | tuple[str, str]) -> dict[str, str]:
    """Return plain CMake packages by name: the rest of their CMakeLists.txt, and what they depend on."""
    files = {}
    for name, body in bodies.items():
        text, needs = (body, "") if isinstance(body, str) else body
        depends = [f"<depend>{need}</depend>" for need in needs.split()]
        files[f"src/{name}/package.xml"] = manifest_text(name, *depends, build_type="cmake")
        head = f"cmake_minimum_required(VERSION 3.16)\nproject({name} C)\n"
        files[f"src/{name}/CMakeLists.txt"] = head + text
    return files


def write(name: str, text: str) -> Callable[[Path], object]:
    """Return an edit that writes a file, in a new folder if need be."""

    def edit(root: Path) -> None:
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")

    return edit


def swap(name: str, one: str, other: str) -> Callable[[Path], object]:
    def edit(root: Path) -> None:
        text = (root / name).read_text(encoding="utf-8")
        assert one in text
        (root / name).write_text(text.replace(one, other), encoding="utf-8")

    return edit


@dataclass(frozen=True, slots=True)
class Case:
    """A workspace and an edit; what is built after the edit must be what a clean build makes."""

    files: Mapping[str, str]
    edit: Callable[[Path], object]
    options: tuple[str, ...] = ()
    code: int = 0
    links: Mapping[str, str] = field(default_factory=dict)


HEADERS = "install(DIRECTORY include/ DESTINATION include)\n"
USES_D = 'include_directories("${CMAKE_SOURCE_DIR}/../../install/d/include")\n' + BUILD
GENERATES = """add_custom_command(OUTPUT v.h COMMAND sh ${CMAKE_CURRENT_SOURCE_DIR}/gen.sh > v.h)
add_executable(x x.c v.h)
target_include_directories(x PRIVATE ${CMAKE_CURRENT_BINARY_DIR})
install(TARGETS x DESTINATION bin)
"""
CASES = {
    # Defaults, files that CMake or the assembler reads, static libraries: see tests/evolving.py.
    "a script that execute_process runs": Case(
        {
            **packages(
                a="execute_process(COMMAND sh ${CMAKE_SOURCE_DIR}/v.sh OUTPUT_VARIABLE O)\n"
                "add_definitions(-DV=${O})\n" + BUILD
            ),
            "src/a/x.c": PROGRAM,
            "src/a/v.sh": "printf 1",
        },
        write("src/a/v.sh", "printf 2"),
    ),
    "a compiled file that CMake code reads too": Case(
        {
            **packages(
                a='file(STRINGS x.c L REGEX "define W")\nstring(LENGTH "${L}" N)\n'
                "add_definitions(-DV=${N})\n" + BUILD
            ),
            "src/a/x.c": "#define W 1\n" + PROGRAM,
        },
        write("src/a/x.c", "#define W 100\n" + PROGRAM),
    ),
    "a script of a custom command without DEPENDS": Case(
        {**packages(a=GENERATES), "src/a/x.c": INCLUDES, "src/a/gen.sh": 'echo "#define V 1"\n'},
        write("src/a/gen.sh", 'echo "#define V 2"\n'),
    ),
    "a linker script in the flags": Case(
        {
            **packages(
                a="add_library(x SHARED x.c)\n"
                'target_link_options(x PRIVATE "-Wl,--version-script=${CMAKE_SOURCE_DIR}/x.map")\n'
                "install(TARGETS x DESTINATION lib)\n"
            ),
            "src/a/x.c": "int one;\nint two;\n",
            "src/a/x.map": "{ global: one; local: *; };\n",
        },
        write("src/a/x.map", "{ global: two; local: *; };\n"),
    ),
    "a header earlier on the include path": Case(
        {
            **packages(a="include_directories(first second)\n" + BUILD),
            "src/a/x.c": INCLUDES,
            "src/a/first/other.h": "",
            "src/a/second/v.h": "#define V 1\n",
        },
        write("src/a/first/v.h", "#define V 2\n"),
    ),
    "a header that __has_include looked for": Case(
        {
            **packages(a="include_directories(first)\n" + BUILD),
            "src/a/x.c": '#if __has_include("v.h")\n#include "v.h"\n#endif\n' + PROGRAM,
            "src/a/first/other.h": "",
        },
        write("src/a/first/v.h", "#define V 2\n"),
    ),
    "a header of a need that __has_include looked for": Case(
        {
            **packages(d=HEADERS, a=(USES_D, "d")),
            "src/d/include/d.h": "",
            "src/a/x.c": '#if __has_include("v.h")\n#include "v.h"\n#endif\n' + PROGRAM,
        },
        write("src/d/include/v.h", "#define V 2\n"),
    ),
    "a program of a need that generates": Case(
        {
            **packages(
                d="install(PROGRAMS gen.sh DESTINATION bin)\n",
                a=(
                    GENERATES.replace(
                        "${CMAKE_CURRENT_SOURCE_DIR}", "${CMAKE_SOURCE_DIR}/../../install/d/bin"
                    ),
                    "d",
                ),
            ),
            "src/d/gen.sh": '#!/bin/sh\necho "#define V 1"\n',
            "src/a/x.c": INCLUDES,
        },
        write("src/d/gen.sh", '#!/bin/sh\necho "#define V 2"\n'),
    ),
    "a library that becomes shared": Case(
        {
            **packages(
                d="add_library(foo STATIC foo.c)\ninstall(TARGETS foo DESTINATION lib)\n",
                a=(
                    (
                        "find_library(FOO foo REQUIRED HINTS ${CMAKE_SOURCE_DIR}/../../install/d/lib)\n"
                        "add_executable(x x.c)\n"
                        "target_link_libraries(x ${FOO})\ninstall(TARGETS x DESTINATION bin)\n"
                    ),
                    "d",
                ),
            ),
            "src/d/foo.c": "int foo(void) { return 1; }\n",
            "src/a/x.c": CALLS,
        },
        swap("src/d/CMakeLists.txt", "STATIC", "SHARED"),
    ),
    "a header in the build folder of a need": Case(
        {
            **packages(
                d="configure_file(v.h.in v.h)\n",
                a=('include_directories("${CMAKE_BINARY_DIR}/../d")\n' + BUILD, "d"),
            ),
            "src/d/v.h.in": "#define V 1\n",
            "src/a/x.c": INCLUDES,
        },
        write("src/d/v.h.in", "#define V 2\n"),
    ),
    "a header that a need installs without being declared, merged": Case(
        {
            **packages(d=HEADERS, e='include_directories("${CMAKE_INSTALL_PREFIX}/include")\n' + BUILD),
            "src/d/include/v.h": "#define V 1\n",
            "src/e/x.c": INCLUDES,
        },
        write("src/d/include/v.h", "#define V 2\n"),
        options=("--merge-install", "--executor", "sequential"),
    ),
    "a generated header that is generated no more": Case(
        {
            **packages(
                a="configure_file(v.h.in v.h)\ninclude_directories(${CMAKE_BINARY_DIR} other)\n" + BUILD
            ),
            "src/a/v.h.in": "#define V 1\n",
            "src/a/other/v.h": "#define V 2\n",
            "src/a/x.c": INCLUDES,
        },
        swap("src/a/CMakeLists.txt", "configure_file(v.h.in v.h)\n", ""),
    ),
    "a file of the repository that CMake code reads": Case(
        {
            **packages(a="file(READ ../../VERSION VV)\nadd_definitions(-DV=${VV})\n" + BUILD),
            "src/a/x.c": PROGRAM,
            "VERSION": "1",
        },
        write("VERSION", "2"),
    ),
    "a file of the repository that is installed": Case(
        {**packages(a="install(DIRECTORY ../../common/ DESTINATION share)\n"), "common/one": "1"},
        write("common/two", "2"),
    ),
    "a header outside that a link leads to": Case(
        {
            **packages(a='include_directories("${CMAKE_SOURCE_DIR}/../../outside")\n' + BUILD),
            "src/a/x.c": INCLUDES,
            "real/v.h": "#define V 1\n",
        },
        write("real/v.h", "#define V 2\n"),
        links={"outside/v.h": "../real/v.h"},
    ),
    "a link before '..' in the path of a header": Case(
        {
            **packages(a=BUILD),
            "src/a/x.c": INCLUDES.replace('"v.h"', '"../../place/../v.h"'),
            "one/v.h": "#define V 1\n",
            "two/v.h": "#define V 2\n",
            "one/inside/keep": "",
            "two/inside/keep": "",
        },
        lambda root: (root / "other").replace(root / "version"),
        links={"place": "version/inside", "version": "one", "other": "two"},
    ),
    "a header outside that comes before another": Case(
        {
            **packages(
                a='include_directories("${CMAKE_SOURCE_DIR}/../../one" "${CMAKE_SOURCE_DIR}/../../two")\n'
                + BUILD
            ),
            "src/a/x.c": INCLUDES,
            "one/other.h": "",
            "two/v.h": "#define V 1\n",
        },
        write("one/v.h", "#define V 2\n"),
    ),
    "a program outside that a custom command names": Case(
        {
            **packages(a=GENERATES.replace("${CMAKE_CURRENT_SOURCE_DIR}", "${CMAKE_SOURCE_DIR}/../../tools")),
            "src/a/x.c": INCLUDES,
            "tools/gen.sh": 'echo "#define V 1"\n',
        },
        write("tools/gen.sh", 'echo "#define V 2"\n'),
    ),
    "an external project in the package": Case(
        {
            **packages(
                a="include(ExternalProject)\nExternalProject_Add(ep SOURCE_DIR ${CMAKE_SOURCE_DIR}/ext"
                " CMAKE_ARGS -DCMAKE_INSTALL_PREFIX=${CMAKE_BINARY_DIR}/ei"
                " BUILD_BYPRODUCTS ${CMAKE_BINARY_DIR}/ei/lib/libe.a)\nadd_executable(x x.c)\n"
                "add_dependencies(x ep)\ntarget_link_libraries(x ${CMAKE_BINARY_DIR}/ei/lib/libe.a)\n"
                "install(TARGETS x DESTINATION bin)\n"
            ),
            "src/a/x.c": CALLS,
            "src/a/ext/CMakeLists.txt": "cmake_minimum_required(VERSION 3.16)\nproject(e C)\n"
            "add_library(e STATIC e.c)\ninstall(TARGETS e DESTINATION lib)\n",
            "src/a/ext/e.c": "int foo(void) { return 1; }\n",
        },
        write("src/a/ext/e.c", "int foo(void) { return 2; }\n"),
    ),
    "a precompiled header and a unity build": Case(
        {
            **packages(
                a="file(GLOB S s/*.c)\nadd_executable(x x.c ${S})\n"
                "target_precompile_headers(x PRIVATE pch.h)\n"
                "set_target_properties(x PROPERTIES UNITY_BUILD ON)\ninstall(TARGETS x DESTINATION bin)\n"
            ),
            "src/a/x.c": PROGRAM,
            "src/a/pch.h": '#include "in.h"\n',
            "src/a/in.h": "#define V 1\n",
            "src/a/s/a.c": "int a;\n",
        },
        lambda root: (write("src/a/in.h", "#define V 2\n")(root), write("src/a/s/b.c", "int b = 5;\n")(root)),
    ),
    "a header with a blank and an umlaut in its name": Case(
        {
            **packages(a='include_directories("${CMAKE_SOURCE_DIR}/in größe")\n' + BUILD),
            "src/a/x.c": INCLUDES.replace("v.h", "v $.h"),
            "src/a/in größe/v $.h": "#define V 1\n",
        },
        write("src/a/in größe/v $.h", "#define V 2\n"),
    ),
    "a file of a glob elsewhere": Case(
        {
            **packages(
                a="file(GLOB F ../../data/*.txt)\ninstall(FILES ${F} DESTINATION share)\n"
                "install(FILES x.c DESTINATION share)\n"
            ),
            "src/a/x.c": "",
            "data/one.txt": "1",
        },
        write("data/two.txt", "2"),
    ),
    "an optional include that appears": Case(
        {**packages(a="include(../../more.cmake OPTIONAL)\n" + BUILD), "src/a/x.c": PROGRAM},
        write("more.cmake", "add_definitions(-DV=3)\n"),
    ),
    "a file that find_file found": Case(
        {
            **packages(
                a="find_file(F v.txt PATHS ${CMAKE_SOURCE_DIR}/../../share NO_DEFAULT_PATH)\n"
                "file(READ ${F} VV)\nadd_definitions(-DV=${VV})\n" + BUILD
            ),
            "src/a/x.c": PROGRAM,
            "share/v.txt": "1",
        },
        write("share/v.txt", "2"),
    ),
    "a depfile of a custom command": Case(
        {
            **packages(
                a="cmake_policy(SET CMP0116 NEW)\nadd_custom_command(OUTPUT v.h DEPFILE v.d COMMAND sh"
                " ${CMAKE_SOURCE_DIR}/gen.sh)\nadd_executable(x x.c ${CMAKE_BINARY_DIR}/v.h)\n"
                "target_include_directories(x PRIVATE ${CMAKE_BINARY_DIR})\n"
                "install(TARGETS x DESTINATION bin)\n"
            ),
            "src/a/x.c": INCLUDES,
            "src/a/gen.sh": 'here=$(dirname "$0")\necho "#define V $(cat "$here/read me")" > v.h\n'
            'echo "v.h: $here/read\\\\ me" > v.d\n',
            "src/a/read me": "1",
        },
        write("src/a/read me", "2"),
    ),
    "the mode of a source that a link leads to": Case(
        {
            **packages(
                a="get_filename_component(R s.sh REALPATH)\n"
                "install(DIRECTORY ../../tools/ DESTINATION all USE_SOURCE_PERMISSIONS)\n"
            ),
            "tools/s.sh": "echo\n",
        },
        lambda root: (root / "tools/s.sh").chmod(0o755),
        links={"src/a/s.sh": "../../tools/s.sh"},
    ),
}


WITH_MAKE = (
    "a script of a custom command without DEPENDS",
    "a precompiled header and a unity build",
    "a header with a blank and an umlaut in its name",
)
"""Kinds of inputs that are also tried with make, whose build folder starts empty after any change."""


@pytest.mark.parametrize(
    ("generator", "name"),
    [*(("Ninja", name) for name in CASES), *(("Unix Makefiles", name) for name in WITH_MAKE)],
)
def test_a_build_after_any_change_matches_a_clean_build(
    generator: str, name: str, forge: Forge, tree: Tree
) -> None:
    case = CASES[name]
    root = tree(case.files)
    for link, target in case.links.items():
        (root / link).parent.mkdir(parents=True, exist_ok=True)
        (root / link).symlink_to(target)
    variables = {"CMAKE_GENERATOR": generator}
    assert forge("build", *case.options, cwd=root, env=variables).code == 0
    case.edit(root)
    assert forge("build", *case.options, cwd=root, env=variables).code == case.code
    assert "finished" not in _up_to_date(forge("build", *case.options, cwd=root, env=variables))
    actual = look(root / "install")
    for folder in ("build", "install", "log"):
        shutil.rmtree(root / folder)
    assert forge("build", *case.options, cwd=root, env=variables).code == case.code
    assert actual == look(root / "install")


@pytest.mark.parametrize("name", ["other/libv.so", "libs/libv.so"])
def test_libraries_that_linkers_search_are_inputs_of_unobserved_builds(
    name: str, forge: Forge, tree: Tree
) -> None:
    build = (
        BUILD
        + "target_link_libraries(x -L${CMAKE_SOURCE_DIR}/../../other -L${CMAKE_SOURCE_DIR}/../../libs -lv)\n"
    )
    root = tree({**packages(a=build), "src/a/x.c": CALLS})

    def compile_library(path: str, number: int) -> None:
        (root / path).parent.mkdir(exist_ok=True)
        code = f"int foo(void) {{ return {number}; }}\n"
        arguments = ("-shared", "-Wl,--build-id", f"-Wl,-soname,v{number}", "-x", "c", "-", "-o", root / path)
        subprocess.run(["cc", *arguments], input=code.encode(), check=True)

    compile_library("libs/libv.so", 1)
    assert forge("build", "--no-observer", cwd=root).code == 0
    assert "1 package unchanged" in forge("build", "--no-observer", cwd=root).out
    compile_library(name, 2)
    assert "1 package finished" in forge("build", "--no-observer", cwd=root).out


def _up_to_date(ran: Ran) -> str:
    """Return what a build says beside how many packages it did not build."""
    return ran.out.replace("0 packages finished", "")


SAVED = {"source": "src/{}/x.c", "header": "src/{}/v.h", "outside": "outside_{}/v.h"}
"""Packages by the name of their file that is saved during the build."""


def _saved_during_the_build(when: str) -> dict[str, str]:
    """Return a package per line of SAVED that takes a while before or after compiling, and one more of each.

    The other one, NAME_reverted, is to have its file saved and taken back.
    """
    wait = f"add_custom_target(wait COMMAND sleep 1.2)\n{BUILD}add_dependencies(x wait)\n"
    body = wait if when == "before" else BUILD + "add_custom_command(TARGET x POST_BUILD COMMAND sleep 1.2)\n"
    files: dict[str, str] = {}
    for name in (*SAVED, *(f"{name}_reverted" for name in SAVED)):
        where = f'"${{CMAKE_SOURCE_DIR}}" "${{CMAKE_SOURCE_DIR}}/../../outside_{name}"'
        folder = f"outside_{name}" if name.startswith("outside") else f"src/{name}"
        files |= packages(**{name: f"include_directories({where})\n{body}"})
        files |= {f"src/{name}/x.c": INCLUDES, f"{folder}/v.h": "#define V 1\n"}
    return files


@pytest.mark.parametrize("when", ["before", "after"])
def test_a_file_saved_during_a_build_is_rebuilt(when: str, forge: Forge, tree: Tree) -> None:
    """Before the file is compiled or after; if it is taken back, what was made may be of either state."""
    root = tree(_saved_during_the_build(when))
    names = sorted(path.name for path in (root / "src").iterdir())
    paths = {name: root / SAVED[name.removesuffix("_reverted")].format(name) for name in names}
    texts = {name: path.read_text(encoding="utf-8") for name, path in paths.items()}

    def save(name: str) -> None:
        deadline = time.monotonic() + 20
        waited_for = "build.ninja" if when == "before" else "CMakeFiles/x.dir/x.c.o"
        while not (root / "build" / name / waited_for).exists() and time.monotonic() < deadline:
            time.sleep(0.01)
        time.sleep(0.2)
        other = texts[name].replace("V 1", "V 2").replace("V 0", "V 3") + "int more = 5;\n"
        paths[name].write_text(other, encoding="utf-8")

    build = partial(forge, "build", f"--jobs={len(names)}", cwd=root, env={"CMAKE_GENERATOR": "Ninja"})
    with ThreadPoolExecutor(len(names)) as saves:
        done = saves.map(save, names)
        assert build().code == 0
        assert list(done) == [None] * len(names)
    for name in names:
        if name.endswith("_reverted"):
            paths[name].write_text(texts[name], encoding="utf-8")
    again = build()
    assert again.code == 0
    assert [name for name in names if f"Finished <<< {name} [" not in again.out] == []
    actual = look(root / "install")
    for folder in ("build", "install", "log"):
        shutil.rmtree(root / folder)
    assert build().code == 0
    assert actual == look(root / "install")


def test_builds_never_write_into_sources(forge: Forge, built: Tree) -> None:
    """They may be read-only, or somebody else's: not even a time is set."""
    root = built(
        {**packages(a="include_directories(inc)\n" + BUILD), "src/a/x.c": INCLUDES, "src/a/inc/v.h": ""}
    )
    for name in ("src/a/x.c", "src/a/inc/v.h"):
        (root / name).write_text(INCLUDES if name.endswith("x.c") else "#define V 4\n", encoding="utf-8")
        os.utime(root / name, (1_000_000_000, 1_000_000_000))
    before = {path: path.lstat() for path in sorted((root / "src").rglob("*"))}
    assert forge("build", cwd=root).code == 0
    assert "Finished" not in forge("build", cwd=root).out
    for path, status in before.items():
        now = path.lstat()
        assert (now.st_mtime_ns, now.st_ctime_ns, now.st_ino) == (
            status.st_mtime_ns,
            status.st_ctime_ns,
            status.st_ino,
        )


def test_sources_written_by_the_build_reach_a_stable_state(forge: Forge, tree: Tree) -> None:
    """A package that writes the same bytes among its sources each time is not built for ever."""
    body = 'execute_process(COMMAND sh -c "echo same > ${CMAKE_SOURCE_DIR}/written")\n' + BUILD
    root = tree({**packages(a=body), "src/a/x.c": PROGRAM})
    for _ in range(3):
        assert forge("build", cwd=root).code == 0
    assert "Finished" not in forge("build", cwd=root).out


def test_a_failed_configure_keeps_objects(forge: Forge, built: Tree) -> None:
    """What was compiled before is brought back once the mistake is mended."""
    root = built({**packages(a=BUILD), "src/a/x.c": PROGRAM})
    made = (root / "build/a/CMakeFiles/x.dir/x.c.o").stat()
    listed = root / "src/a/CMakeLists.txt"
    good = listed.read_text(encoding="utf-8")
    listed.write_text(good + "message(FATAL_ERROR wrong)\n", encoding="utf-8")
    assert forge("build", cwd=root).code == 1
    listed.write_text(good + "# mended\n", encoding="utf-8")
    assert forge("build", cwd=root).code == 0
    now = (root / "build/a/CMakeFiles/x.dir/x.c.o").stat()
    assert (now.st_ino, now.st_mtime_ns) == (made.st_ino, made.st_mtime_ns)


def test_a_new_source_recompiles_nothing_else(forge: Forge, built: Tree) -> None:
    """One new file among many: objects of the others are brought back, the program is linked again."""
    body = "file(GLOB S *.c)\nadd_executable(x ${S})\ninstall(TARGETS x DESTINATION bin)\n"
    many = {f"src/a/part_{number}.c": f"int part_{number};\n" for number in range(20)}
    root = built({**packages(a=body), **many, "src/a/x.c": PROGRAM})
    before = {path.name: path.stat().st_ino for path in (root / "build/a/CMakeFiles/x.dir").glob("*.o")}
    (root / "src/a/part_new.c").write_text("int part_new;\n", encoding="utf-8")
    assert forge("build", cwd=root).code == 0
    after = {path.name: path.stat().st_ino for path in (root / "build/a/CMakeFiles/x.dir").glob("*.o")}
    assert after.keys() - before.keys() == {"part_new.c.o"}
    assert {name: after[name] for name in before} == before


def test_sources_with_future_times_are_built_normally(forge: Forge, tree: Tree) -> None:
    """For example after the clock of a board without a battery was wrong."""
    root = tree({**packages(a=BUILD), "src/a/x.c": PROGRAM})
    future = time.time() + 1e8
    for name in ("CMakeLists.txt", "x.c"):
        os.utime(root / "src/a" / name, (future, future))
    assert forge("build", cwd=root).code == 0
    assert "Starting" not in forge("build", cwd=root).out
    (root / "src/a/CMakeLists.txt").write_text("project(a C)\ninstall(FILES x.c DESTINATION share)\n")
    os.utime(root / "src/a/CMakeLists.txt", (future, future))
    assert forge("build", cwd=root).code == 0
    assert (root / "install/a/share/x.c").is_file()
