"""Builds for another platform: Debian's cross compiler and, for C, zig, and their programs under qemu.

`make cross` does all of it with zig, which first compiles its C++ library for minutes: FORGE_TEST_ZIG=1.
"""

import os
import shutil
import tarfile
from pathlib import Path

import pytest

from tests.conftest import Forge, Tree
from tests.packages import manifest_text
from tests.snippets import ROOT, shell

BY_ZIG = os.environ.get("FORGE_TEST_ZIG") == "1"

pytestmark = [
    pytest.mark.slow,
    pytest.mark.needs(
        "bash", "cmake", "ninja", "qemu-aarch64", *(() if BY_ZIG else ("aarch64-linux-gnu-g++",))
    ),
]

TOOLCHAIN = """\
set(CMAKE_SYSTEM_NAME Linux)
set(CMAKE_SYSTEM_PROCESSOR aarch64)
set(CMAKE_C_COMPILER aarch64-linux-gnu-gcc)
set(CMAKE_CXX_COMPILER aarch64-linux-gnu-g++)
"""
COMPILERS = () if BY_ZIG else ("--toolchain-file", "debian.cmake")
TARGET = "aarch64-linux-gnu"
FOR_AARCH64 = b"\xb7\x00"
"""The machine in the header of an ELF file."""
QEMU = f"qemu-aarch64 -L /usr/{TARGET}"

MOVES = """\
service: asked for 2.000 m, stands at 1.992 m
action: goal -1.000 m accepted
"""


def test_the_examples_run_on_the_target(tmp_path: Path) -> None:
    """Interfaces, libraries and programs of the examples are built, bundled, and run from the archive."""
    shutil.copytree(ROOT / "examples_ws/src", tmp_path / "src")
    (tmp_path / "debian.cmake").write_text(TOOLCHAIN)
    build = f"forge build --target arm64 --target-python 3.10 {' '.join(COMPILERS)}"
    assert "Summary: 7 packages finished" in shell(build, tmp_path)
    assert "Summary: 0 packages finished, 7 packages unchanged" in shell(build, tmp_path)

    assert f"-{TARGET}.tar.gz: " in shell("forge bundle --target arm64", tmp_path)
    robot = tmp_path / "robot"
    with tarfile.open(next(tmp_path.glob("*.tar.gz"))) as archive:
        archive.extractall(robot, filter="tar")
    prefix = robot / "install/robot_demo_cpp/lib/robot_demo_cpp"
    assert (prefix / "move_robot").read_bytes()[18:20] == FOR_AARCH64
    run = f"source {robot}/install/local_setup.bash && {QEMU} {prefix}"
    assert shell(f"{run}/move_robot", tmp_path).startswith(MOVES)
    pose = shell(f"{run}/print_pose", tmp_path)
    assert pose.startswith("status: 1\npose:\n  position:\n    x: 1.25000\n")

    scripts = robot / "install/robot_demo_py/lib/robot_demo_py"
    assert (scripts / "move_robot").read_text().startswith("#!/usr/bin/python3\n")
    assert (robot / "install/robot_demo_py/lib/python3.10/site-packages/robot_demo_py").is_dir()


LISTS = """\
cmake_minimum_required(VERSION 3.18)
project(maker C CXX)
find_package(ament_cmake REQUIRED)
add_executable(generator generator.c)
add_custom_command(OUTPUT made.h COMMAND generator made.h DEPENDS generator)
add_library(thrower SHARED thrower.cpp)
add_executable(maker maker.cpp ${CMAKE_CURRENT_BINARY_DIR}/made.h)
target_link_libraries(maker thrower)
target_include_directories(maker PRIVATE ${CMAKE_CURRENT_BINARY_DIR})
install(TARGETS maker DESTINATION lib/maker)
if(BUILD_TESTING)
  add_test(NAME plain COMMAND maker)
  ament_add_test(of_ament COMMAND "$<TARGET_FILE:maker>" GENERATE_RESULT_FOR_RETURN_CODE_ZERO)
endif()
ament_package()
"""
MAKER = {
    "src/maker/package.xml": manifest_text("maker", "<buildtool_depend>ament_cmake</buildtool_depend>"),
    "src/maker/CMakeLists.txt": LISTS,
    "src/maker/generator.c": """\
#include <stdio.h>
int main(int count, char ** words) {
  FILE * file = fopen(words[count - 1], "w");
  return fputs("#define ANSWER 0\\n", file) < 0 || fclose(file);
}
""",
    "src/maker/thrower.cpp": '#include <stdexcept>\nvoid fail() { throw std::runtime_error("x"); }\n',
    "src/maker/maker.cpp": """\
#include <exception>
#include "made.h"
void fail();
int main()
{
  try { fail(); } catch (const std::exception &) { return ANSWER; } catch (...) { return 1; }
}
""",
    "debian.cmake": TOOLCHAIN,
}


def test_build_and_test_programs_run_under_qemu(tree: Tree, forge: Forge) -> None:
    """A generator, tests of two kinds, and an exception that a shared library throws."""
    root = tree(MAKER)
    built = forge("build", "--target", "arm64", *COMPILERS, cwd=root)
    assert built.code == 0, built.err
    tested = forge("test", "--target", "arm64", "--return-code-on-test-failure", cwd=root)
    assert tested.code == 0, tested.err
    assert "2 tests, 0 errors, 0 failures, 0 skipped" in tested.out
    cleaned = forge("clean", "workspace", "--yes", cwd=root)
    assert f"(build folder of 'ament_cmake', for '{TARGET}')" in cleaned.out
    assert not (root / "build").exists()
    assert not (root / "install").exists()


PLAIN = {
    "src/plain/package.xml": manifest_text("plain", build_type="cmake"),
    "src/plain/CMakeLists.txt": """\
cmake_minimum_required(VERSION 3.18)
project(plain C)
add_executable(plain ../maker/generator.c)
install(TARGETS plain DESTINATION bin)
enable_testing()
add_test(NAME plain COMMAND plain made)
""",
}


@pytest.mark.needs("python-zig")
def test_zig_compiles_no_cxx_library_for_c_packages(tree: Tree, forge: Forge) -> None:
    """Only zig's wheel is needed: it compiles what the linker adds to every program, for some seconds."""
    root = tree({**PLAIN, "src/maker/generator.c": MAKER["src/maker/generator.c"]})
    wheel = Path(shutil.which("python-zig") or "").parents[1]
    zig = next(wheel.glob("lib/python3*/site-packages/ziglang"))
    env = {"PATH": f"{zig}{os.pathsep}{os.environ['PATH']}", "XDG_CACHE_HOME": str(root / "cache")}
    built = forge("build", "--target", "arm64", cwd=root, env=env)
    assert (built.code, built.err) == (0, "")
    assert (root / "cache/forge/zig").is_dir()
    assert not list(root.glob("cache/**/libc++*"))
    program = root / f"install/{TARGET}/plain/bin/plain"
    assert program.read_bytes()[18:20] == FOR_AARCH64
    tested = forge("test", "--target", "arm64", "--return-code-on-test-failure", cwd=root, env=env)
    assert tested.code == 0, tested.err
    assert "1 test, 0 errors, 0 failures, 0 skipped" in tested.out


def test_missing_qemu_is_reported_with_a_hint(tree: Tree, forge: Forge) -> None:
    """Programs of the build cannot run, and `forge test` says so before it starts any."""
    root = tree({**MAKER, **PLAIN})
    (root / "bin").mkdir()
    for name in ("aarch64-linux-gnu-gcc", "aarch64-linux-gnu-g++", "cmake", "ninja", "python3", "sh"):
        (root / "bin" / name).symlink_to(shutil.which(name) or name)
    env = {"PATH": str(root / "bin")}
    built = forge("build", "--target", "arm64", *COMPILERS, "--continue-on-error", cwd=root, env=env)
    assert built.code == 1
    assert "compiled for another platform: install qemu-user\n" in built.err
    tested = forge("test", "--target", "arm64", "--packages-select", "plain", cwd=root, env=env)
    assert tested.code == 2
    assert tested.err == (
        f"error: this machine cannot run the tests of programs for '{TARGET}'\n"
        "hint: install qemu-user, for example with `apt install qemu-user`, then build again\n"
    )
