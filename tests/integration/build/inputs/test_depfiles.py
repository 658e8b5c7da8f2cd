"""Files outside of a package that its build read, found in build folders of CMake and ninja."""

from __future__ import annotations

import subprocess
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import pytest

from forge.build.inputs.depfiles import cmake_root, external_inputs, read_below
from tests.conftest import Tree

pytestmark = pytest.mark.needs("cmake", "gcc", "ninja", "make")


@dataclass(frozen=True)
class Built:
    """A package in a repository, and what was found of it."""

    root: Path
    found: frozenset[str]

    def has(self, name: str) -> bool:
        """Tell if a path below the repository was found."""
        return f"{self.root}/{name}" in self.found


def build(root: Path, files: Mapping[str, str], generator: str = "Ninja") -> Built:
    """Write a repository whose package is in src/probe, build that, and look for what it read elsewhere."""
    for name, text in files.items():
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        if text.startswith("-> "):
            path.symlink_to(text[3:])
        else:
            path.write_text(text.replace("@ROOT@", str(root)), encoding="utf-8")
    source, folder = root / "src/probe", root / "build/probe"
    for argv in (
        ("cmake", "-G", generator, "-S", str(source), "-B", str(folder)),
        ("cmake", "--build", str(folder)),
    ):
        ran = subprocess.run(argv, capture_output=True, text=True, check=False)
        assert ran.returncode == 0, ran.stdout + ran.stderr
    return Built(root, frozenset(external_inputs(folder, source, (source, folder))))


def cmake(text: str, languages: str = "NONE") -> str:
    """Return a CMakeLists.txt."""
    return f"cmake_minimum_required(VERSION 3.18)\nproject(probe {languages})\n{text}"


CODE = cmake(
    "add_executable(probe main.c)\n"
    "target_include_directories(probe PRIVATE early ../../early ../../outside)\n"
    "target_link_libraries(probe m ${CMAKE_CURRENT_SOURCE_DIR}/../../lib/libmore.so)\n"
    "include(GNUInstallDirs)\n",
    "C",
)
MORE = 'execute_process(COMMAND cc -shared -o lib/libmore.so.1 more.c WORKING_DIRECTORY "@ROOT@")\n'
COMPILED = {
    "src/probe/CMakeLists.txt": CODE.replace("add_executable", f"{MORE}add_executable"),
    "src/probe/main.c": '#include "outer.h"\n#include "sub/deep.h"\nint main(void) { return OUTER; }\n',
    "src/probe/early/none.h": "",
    "outside/outer.h": '#define OUTER 0\n#include "linked.h"\n',
    "outside/linked.h": "-> ../away/real.h",
    "outside/sub/deep.h": "",
    "away/real.h": "",
    "early/sub/other.h": "",
    "more.c": "int more;\n",
    "lib/libmore.so": "-> libmore.so.1",
    "notes.txt": "",
}


@pytest.fixture(scope="module", params=["Ninja", "Unix Makefiles"])
def compiled(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Built:
    """Build a program from headers and libraries elsewhere."""
    return build(tmp_path_factory.mktemp("repository"), COMPILED, request.param)


def test_external_headers_and_libraries_are_found(compiled: Built) -> None:
    assert compiled.has("outside/outer.h")
    assert compiled.has("outside/sub/deep.h")
    assert compiled.has("lib/libmore.so")
    assert any(path.endswith("/stdc-predef.h") for path in compiled.found), "those of the system, too"


def test_links_are_recorded_as_the_compiler_names_them(compiled: Built) -> None:
    assert compiled.has("outside/linked.h"), "its record says where it leads and what stands there"


def test_include_folders_are_recorded_with_their_entries(compiled: Built) -> None:
    assert compiled.has("outside/.")
    assert compiled.has("early/.")
    assert compiled.has("outside/sub/."), "it looked for sub/deep.h"
    assert not compiled.has("away/.")


def test_sources_and_build_products_are_not_external(compiled: Built) -> None:
    own = (f"{compiled.root}/src/probe/", f"{compiled.root}/build/probe/")
    assert not [path for path in compiled.found if path.startswith(own)]


def test_unread_files_are_not_recorded(compiled: Built) -> None:
    assert not compiled.has("notes.txt")
    assert not compiled.has("more.c"), "a program of the package's own read it: that is for an audit"


def test_compiler_programs_are_recorded_and_cmake_modules_are_not(compiled: Built) -> None:
    root = cmake_root(compiled.root / "build/probe")
    assert root.endswith("/")
    assert not [path for path in compiled.found if path.startswith(root)]
    assert any(path.endswith("/ar") for path in compiled.found)


def test_files_read_below_a_given_folder_are_listed_separately(compiled: Built) -> None:
    outside = compiled.root / "outside"
    assert read_below(compiled.root / "build/probe", outside) >= {f"{outside}/outer.h"}
    assert not read_below(compiled.root / "build/probe", compiled.root / "away")


REACHED = {
    "install(FILES)": 'install(FILES ../../VERSION "../../my notes.txt" DESTINATION share)',
    "file(READ)": "file(READ ../../VERSION version)\nfile(STRINGS ${CMAKE_SOURCE_DIR}/../../my.txt lines)",
    "execute_process": 'execute_process(COMMAND cat "${CMAKE_CURRENT_LIST_DIR}/../../VERSION")',
    "include": "include(../../more.cmake)",
}


@pytest.mark.parametrize("name", REACHED)
def test_repository_files_used_by_cmake_code_are_found(tmp_path: Path, name: str) -> None:
    files = {
        "src/probe/CMakeLists.txt": cmake(f"{REACHED[name]}\n"),
        "VERSION": "1",
        "my.txt": "1",
        "my notes.txt": "1",
        "more.cmake": 'file(READ "${CMAKE_CURRENT_LIST_DIR}/VERSION" version)\n',
        "other.txt": "1",
    }
    built = build(tmp_path, files)
    assert built.has("more.cmake" if name == "include" else "VERSION")
    assert built.has("my notes.txt") is (name == "install(FILES)")
    assert built.has("my.txt") is (name == "file(READ)")
    assert not built.has("other.txt")


def test_an_installed_folder_includes_its_contents(tmp_path: Path) -> None:
    files = {
        "src/probe/CMakeLists.txt": cmake("install(DIRECTORY ../../shared/ DESTINATION share)\n"),
        "shared/a.txt": "",
        "shared/deep/b.txt": "",
        "shared/.git/c.txt": "",
    }
    built = build(tmp_path, files)
    expected = {"shared/a.txt", "shared/deep/b.txt", "shared/.", "shared/deep/."}
    assert {path[len(str(tmp_path)) + 1 :] for path in built.found if "/shared/" in path} == expected


@pytest.mark.parametrize(
    ("pattern", "folders"),
    [("../../data/*.txt", {"data/."}), ("../../data/?.txt", {"data/."})],
)
def test_an_external_glob_depends_on_the_names_in_its_folders(
    tmp_path: Path, pattern: str, folders: set[str]
) -> None:
    files = {
        "src/probe/CMakeLists.txt": cmake(f"file(GLOB found ${{CMAKE_CURRENT_SOURCE_DIR}}/{pattern})\n"),
        "data/a.txt": "",
    }
    built = build(tmp_path, files)
    assert all(built.has(folder) for folder in folders)


def test_the_parent_folder_of_the_package_is_not_scanned(tmp_path: Path) -> None:
    files = {
        "src/probe/CMakeLists.txt": cmake("set(root ${CMAKE_CURRENT_SOURCE_DIR}/../..)\nset(up ..)\n"),
        "other.txt": "",
        "src/other/big.txt": "",
    }
    built = build(tmp_path, files)
    assert not built.has("other.txt")
    assert not built.has("src/other/big.txt")


def test_comments_are_ignored(tmp_path: Path) -> None:
    text = cmake("# see ../../VERSION\n#[[\ninclude(../../more.cmake)\n]]\n")
    built = build(tmp_path, {"src/probe/CMakeLists.txt": text, "VERSION": "1", "more.cmake": ""})
    assert not built.has("VERSION")
    assert not built.has("more.cmake")


def test_missing_files_are_recorded(tmp_path: Path) -> None:
    text = cmake("include(../../maybe.cmake OPTIONAL)\n")
    assert build(tmp_path, {"src/probe/CMakeLists.txt": text}).has("maybe.cmake"), "it may come"


def test_a_program_that_a_command_of_the_package_starts_is_found(tmp_path: Path) -> None:
    text = cmake(
        "add_custom_target(all_of_it ALL DEPENDS out.txt)\n"
        "add_custom_command(OUTPUT out.txt COMMAND sh @ROOT@/tools/make.sh > out.txt)\n"
    )
    built = build(tmp_path, {"src/probe/CMakeLists.txt": text, "tools/make.sh": "echo\n"})
    assert built.has("tools/make.sh")


def test_results_of_find_commands_are_recorded(tmp_path: Path) -> None:
    text = cmake("find_program(tool special PATHS @ROOT@/bin)\nfind_file(file odd.txt PATHS @ROOT@/share)\n")
    built = build(
        tmp_path,
        {"src/probe/CMakeLists.txt": text, "bin/special": "#!/bin/sh\n", "share/odd.txt": ""},
    )
    assert built.has("share/odd.txt")


def test_an_unconfigured_build_folder_has_no_inputs(tmp_path: Path) -> None:
    assert external_inputs(tmp_path / "build", tmp_path / "src", (tmp_path / "src",)) == ()
    assert cmake_root(tmp_path / "build") == ""


def test_a_folder_that_cargo_watches_includes_its_files_and_names(tree: Tree) -> None:
    root = tree({"data/x": "", "data/sub/y": "", "src/lib.rs": ""})
    data = str(root / "data")
    tree({"build/.forge/read_by_backend": f"{data}\n{data}/sub/.\n{root}\n/missing\n"})
    found = external_inputs(root / "build", root / "src", (root / "src",))
    names = ("/missing", f"{data}/.", f"{data}/sub/.", f"{data}/sub/y", f"{data}/x")
    assert found == names
