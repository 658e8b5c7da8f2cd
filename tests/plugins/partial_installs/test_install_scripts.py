"""What CMake's install scripts install is known, with the CMake of the system and with the newest."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from forge.plugins.partial_installs.install_scripts import installed_entries, read_install_scripts
from tests.conftest import Tree

pytestmark = pytest.mark.needs("cmake", "g++")

HEAD = "cmake_minimum_required(VERSION 3.18)\nproject(p C)\n"
EVERYTHING = """
include(GNUInstallDirs)
add_library(greet SHARED greet.c)
set_target_properties(greet PROPERTIES VERSION 1.2.3 SOVERSION 1)
add_library(quiet STATIC greet.c)
add_executable(hello hello.c)
target_link_libraries(hello greet)
install(TARGETS greet quiet hello EXPORT targets)
install(EXPORT targets DESTINATION share/p/cmake)
install(FILES a.txt b.txt DESTINATION share/p)
install(FILES a.txt DESTINATION share/p RENAME renamed.txt)
install(FILES nothing.txt DESTINATION share/p OPTIONAL)
install(PROGRAMS run.sh DESTINATION bin)
install(DIRECTORY d DESTINATION share/p)
install(DIRECTORY d/ DESTINATION share/p/all USE_SOURCE_PERMISSIONS)
install(DIRECTORY d/ DESTINATION share/p/some PATTERN z EXCLUDE)
add_subdirectory(sub)
"""
FILES = {
    "p/greet.c": "void greet(void) {}\n",
    "p/hello.c": "void greet(void); int main(void) { greet(); return 0; }\n",
    "p/a.txt": "a",
    "p/b.txt": "b",
    "p/run.sh": "",
    "p/d/x": "",
    "p/d/e/y": "",
    "p/sub/CMakeLists.txt": 'install(FILES c.txt DESTINATION "share/a b")\n',
    "p/sub/c.txt": "",
}
NEWEST = Path(sys.executable).with_name("cmake")


def configure(root: Path, cmake: str | Path, text: str) -> Path:
    (root / "p/CMakeLists.txt").write_text(HEAD + text)
    build = root / "a build"
    argv = [cmake, "-S", root / "p", "-B", build, f"-DCMAKE_INSTALL_PREFIX={root / 'install'}"]
    subprocess.run(argv, check=True, capture_output=True)
    return build


@pytest.mark.parametrize("newest", [False, True], ids=["system", "newest"])
def test_installed_files_match_the_install_scripts(tree: Tree, *, newest: bool) -> None:
    root = tree(FILES)
    cmake = NEWEST if newest else shutil.which("cmake") or "cmake"
    build = configure(
        root, cmake, EVERYTHING.replace("install(FILES nothing.txt DESTINATION share/p OPTIONAL)\n", "")
    )
    subprocess.run([cmake, "--build", build], check=True, capture_output=True)
    subprocess.run([cmake, "--install", build], check=True, capture_output=True)
    scripts = read_install_scripts(build)
    assert scripts is not None
    assert scripts.rules is not None
    entries = installed_entries(scripts.rules)
    assert entries is not None
    prefix = root / "install"
    installed = {
        os.path.relpath(f"{folder}/{name}", prefix) for folder, _, names in os.walk(prefix) for name in names
    }
    assert {*entries} == installed
    for path, entry in entries.items():
        if entry.rule.is_copy:
            assert (prefix / path).read_bytes() == Path(entry.source).read_bytes()
    configure(root, cmake, EVERYTHING)
    scripts = read_install_scripts(build)
    assert scripts is not None
    assert scripts.rules is not None
    assert installed_entries(scripts.rules) is None


@pytest.mark.parametrize(
    "text",
    [
        'install(CODE "if(EXISTS \\$ENV{DESTDIR}\\${CMAKE_INSTALL_PREFIX}/x AND EXISTS /x)\\nendif()")',
        'install(CODE "file(WRITE x y)")',
        "install(SCRIPT more.cmake)",
        "install(FILES a.txt DESTINATION /somewhere)",
        "install(FILES a.txt DESTINATION ${CMAKE_INSTALL_PREFIX}/share)",
        'install(CODE "if(EXISTS /etc/x)\\nendif()")',
        'install(CODE "execute_process(COMMAND true)")',
        'install(CODE "file(REMOVE \\${CMAKE_INSTALL_PREFIX}/x)")',
        'install(CODE "if(CMAKE_INSTALL_DO_STRIP OR EXISTS /x)\\nendif()")',
        'install(CODE "endif()\\nfile(REMOVE /x)\\nif(1)")',
    ],
)
@pytest.mark.parametrize("newest", [False, True], ids=["system", "newest"])
def test_install_scripts_with_other_commands_are_not_analysed(tree: Tree, text: str, *, newest: bool) -> None:
    root = tree({"p/a.txt": "", "p/more.cmake": "file(REMOVE /x)"})
    cmake = NEWEST if newest else shutil.which("cmake") or "cmake"
    scripts = read_install_scripts(configure(root, cmake, text))
    assert scripts is None or scripts.rules is None
