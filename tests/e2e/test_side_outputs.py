"""After CMake ran again, files beside the products of compilers and linkers are as in a clean build."""

import shutil
from pathlib import Path

import pytest

from tests.conftest import Forge, Tree
from tests.evolving import look
from tests.packages import manifest_text

pytestmark = pytest.mark.needs("cmake", "ninja", "gcc")

HEAD = "cmake_minimum_required(VERSION 3.16)\nproject(a C)\nadd_executable(x x.c y.c)\n"
INSTALL = """install(TARGETS x DESTINATION bin)
install(DIRECTORY ${CMAKE_BINARY_DIR}/ DESTINATION share
  FILES_MATCHING REGEX "\\\\.(map|su|s|i|lst|optimized|gcno|dwo|txt|extra)$"
  PATTERN CMakeCache.txt EXCLUDE PATTERN TargetDirectories.txt EXCLUDE PATTERN *manifest.txt EXCLUDE
  PATTERN .forge EXCLUDE)
"""
OPTIONS = {
    "a link map": "target_link_options(x PRIVATE -Wl,-Map=x.map)\n",
    "a link map in a folder that CMake made": "file(MAKE_DIRECTORY ${CMAKE_BINARY_DIR}/maps)\n"
    "target_link_options(x PRIVATE -Wl,-Map=${CMAKE_BINARY_DIR}/maps/of.map)\n",
    "a link map named in a response file": "file(WRITE ${CMAKE_BINARY_DIR}/l.rsp -Wl,-Map=other.map)\n"
    "target_link_options(x PRIVATE @${CMAKE_BINARY_DIR}/l.rsp)\n",
    "a link map in the place of a file of CMake": "file(WRITE ${CMAKE_BINARY_DIR}/z.map none)\n"
    "target_link_options(x PRIVATE -Wl,-Map=z.map)\n",
    "stack usage": "target_compile_options(x PRIVATE -fstack-usage)\n",
    "saved temporaries": "target_compile_options(x PRIVATE -save-temps=obj)\n",
    "saved temporaries in the working directory": "target_compile_options(x PRIVATE -save-temps)\n",
    "a listing": "set_source_files_properties(x.c PROPERTIES COMPILE_OPTIONS -Wa,-adhlns=x.lst)\n",
    "a dump": "target_compile_options(x PRIVATE -O1 -fdump-tree-optimized)\n",
    "notes for coverage": "target_compile_options(x PRIVATE --coverage)\n"
    "target_link_options(x PRIVATE --coverage)\n",
    "split debug information": "target_compile_options(x PRIVATE -g -gsplit-dwarf)\n",
    "a file of a compiler wrapper": "file(WRITE ${CMAKE_BINARY_DIR}/w.sh "
    '"echo 1 > ${CMAKE_BINARY_DIR}/unnamed.extra; exec \\"$@\\"")\n'
    "set_property(TARGET x PROPERTY C_COMPILER_LAUNCHER sh ${CMAKE_BINARY_DIR}/w.sh)\n",
}


DIFFERENT_EACH_TIME = {"notes for coverage", "a listing"}
"""Files with times or names of temporary files."""


def installed(root: Path) -> object:
    """Return the installed files, and their contents if these are always the same."""
    found = look(root / "install")
    code = (root / "src/a/CMakeLists.txt").read_text()
    return sorted(found) if any(OPTIONS[name] in code for name in DIFFERENT_EACH_TIME) else found


def clean(forge: Forge, root: Path) -> object:
    """Return what a build in empty folders installs."""
    for folder in ("build", "install", "log"):
        shutil.rmtree(root / folder)
    assert forge("build", cwd=root).code == 0
    return installed(root)


@pytest.fixture(params=OPTIONS)
def root(request: pytest.FixtureRequest, tree: Tree) -> Path:
    """Return a package that installs what its compilers and linker write."""
    return tree(
        {
            "src/a/package.xml": manifest_text("a", build_type="cmake"),
            "src/a/CMakeLists.txt": HEAD + OPTIONS[request.param] + INSTALL,
            "src/a/x.c": "int y(void);\nint main(void) { return y(); }\n",
            "src/a/y.c": "int y(void) { return 0; }\n",
        }
    )


def test_side_outputs_are_kept_when_cmake_runs_again(forge: Forge, root: Path) -> None:
    assert forge("build", cwd=root).code == 0
    for number in range(3):
        (root / f"src/a/{number}.md").write_text("x")
        assert forge("build", cwd=root).code == 0
    found = installed(root)
    assert found == clean(forge, root)


def test_side_outputs_of_removed_sources_and_options_are_deleted(forge: Forge, root: Path) -> None:
    assert forge("build", cwd=root).code == 0
    (root / "src/a/y.c").unlink()
    (root / "src/a/x.c").write_text("int main(void) { return 0; }\n")
    code = root / "src/a/CMakeLists.txt"
    code.write_text(code.read_text().replace(" y.c", ""))
    assert forge("build", cwd=root).code == 0
    found = installed(root)
    assert found == clean(forge, root)
    code.write_text(HEAD.replace(" y.c", "") + INSTALL)
    assert forge("build", cwd=root).code == 0
    found = installed(root)
    assert found == clean(forge, root)


def test_stack_usage_costs_no_compilation(forge: Forge, tree: Tree) -> None:
    root = tree(
        {
            "src/a/package.xml": manifest_text("a", build_type="cmake"),
            "src/a/CMakeLists.txt": HEAD + OPTIONS["stack usage"] + INSTALL,
            "src/a/x.c": "int y(void);\nint main(void) { return y(); }\n",
            "src/a/y.c": "int y(void) { return 0; }\n",
        }
    )
    assert forge("build", cwd=root).code == 0
    built = (root / "build/a/CMakeFiles/x.dir/x.c.o").stat().st_mtime_ns
    (root / "src/a/read.md").write_text("x")
    assert forge("build", cwd=root).code == 0
    assert (root / "build/a/CMakeFiles/x.dir/x.c.o").stat().st_mtime_ns == built
