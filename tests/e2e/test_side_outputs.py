"""After CMake ran again, files beside the products of compilers and linkers are as in a clean build."""

import shutil
from pathlib import Path

import pytest

from tests.conftest import Forge, Tree
from tests.evolving import look
from tests.packages import manifest_text

pytestmark = pytest.mark.needs("cmake", "ninja", "gcc")

HEAD = "cmake_minimum_required(VERSION 3.16)\nproject({} C)\nadd_executable(x x.c y.c)\n"
INSTALL = """install(TARGETS x DESTINATION bin)
install(DIRECTORY ${CMAKE_BINARY_DIR}/ DESTINATION share
  FILES_MATCHING REGEX "\\\\.(map|su|s|i|gcno|txt|extra)$"
  PATTERN CMakeCache.txt EXCLUDE PATTERN TargetDirectories.txt EXCLUDE PATTERN *manifest.txt EXCLUDE
  PATTERN .forge EXCLUDE)
"""
OPTIONS = {
    "map_in_a_folder": "file(MAKE_DIRECTORY ${CMAKE_BINARY_DIR}/maps)\n"
    "target_link_options(x PRIVATE -Wl,-Map=${CMAKE_BINARY_DIR}/maps/of.map)\n",
    "map_in_place_of_a_file": "file(WRITE ${CMAKE_BINARY_DIR}/z.map none)\n"
    "target_link_options(x PRIVATE -Wl,-Map=z.map)\n",
    "stack_usage": "target_compile_options(x PRIVATE -fstack-usage)\n",
    "saved_temporaries": "target_compile_options(x PRIVATE -save-temps)\n",
    "coverage": "target_compile_options(x PRIVATE --coverage)\ntarget_link_options(x PRIVATE --coverage)\n",
    "wrapper": "file(WRITE ${CMAKE_BINARY_DIR}/w.sh "
    '"echo 1 > ${CMAKE_BINARY_DIR}/unnamed.extra; exec \\"$@\\"")\n'
    "set_property(TARGET x PROPERTY C_COMPILER_LAUNCHER sh ${CMAKE_BINARY_DIR}/w.sh)\n",
}
"""CMake code that lets compilers and linkers write files, by the name of a package."""


def package(name: str) -> dict[str, str]:
    """Return a package that installs what its compiler and linker write."""
    return {
        f"src/{name}/package.xml": manifest_text(name, build_type="cmake"),
        f"src/{name}/CMakeLists.txt": HEAD.format(name) + OPTIONS[name] + INSTALL,
        f"src/{name}/x.c": "int y(void);\nint main(void) { return y(); }\n",
        f"src/{name}/y.c": "int y(void) { return 0; }\n",
    }


def installed(root: Path) -> object:
    """Return the installed files, and their contents unless there are times in them."""
    found = look(root / "install")
    return {path: () if "coverage" in path else entry for path, entry in found.items()}


def clean(forge: Forge, root: Path) -> object:
    """Return what a build in empty folders installs."""
    for folder in ("build", "install", "log"):
        shutil.rmtree(root / folder)
    assert forge("build", cwd=root).code == 0
    return installed(root)


def test_side_outputs_are_those_of_a_clean_build(forge: Forge, built: Tree) -> None:
    root = built({path: text for name in OPTIONS for path, text in package(name).items()})
    object_file = root / "build/stack_usage/CMakeFiles/x.dir/x.c.o"
    compiled = object_file.stat().st_mtime_ns
    # CMake runs again, and nothing is compiled.
    for number in range(3):
        for name in OPTIONS:
            (root / f"src/{name}/{number}.md").write_text("x")
        assert forge("build", cwd=root).code == 0
    assert object_file.stat().st_mtime_ns == compiled
    found = installed(root)
    assert found == clean(forge, root)
    # A source is removed.
    for name in OPTIONS:
        (root / f"src/{name}/y.c").unlink()
        (root / f"src/{name}/x.c").write_text("int main(void) { return 0; }\n")
        lists = root / f"src/{name}/CMakeLists.txt"
        lists.write_text(lists.read_text().replace(" y.c", ""))
    assert forge("build", cwd=root).code == 0
    found = installed(root)
    assert found == clean(forge, root)
    # The options are removed.
    for name in OPTIONS:
        code = HEAD.format(name).replace(" y.c", "") + INSTALL
        (root / f"src/{name}/CMakeLists.txt").write_text(code)
    assert forge("build", cwd=root).code == 0
    found = installed(root)
    assert found == clean(forge, root)
