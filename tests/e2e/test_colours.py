"""Messages of compilers are coloured on a terminal, nowhere else, and colours cause no build."""

import os
import pty
import subprocess
import sys
from pathlib import Path

import pytest

from tests.conftest import Tree
from tests.packages import manifest_text
from tests.snippets import ROOT

CMAKE = """cmake_minimum_required(VERSION 3.18)
project(p CXX)
include(CheckCXXCompilerFlag)
check_cxx_compiler_flag(-Wall HAS_WALL)
check_cxx_compiler_flag(-Wnonsense HAS_NONSENSE)
if(NOT HAS_WALL OR HAS_NONSENSE)
  message(FATAL_ERROR "wrong check")
endif()
add_library(p STATIC p.cpp)
target_compile_options(p PRIVATE -Wall)
install(TARGETS p DESTINATION lib)
"""
WARNS = "int p()\n{\n  int unused;\n  return 0;\n}\n"
MAGENTA = b"\x1b[01;35m"


def on_terminal(root: Path, *words: str, **variables: str) -> bytes:
    here, there = pty.openpty()
    plain = {name: value for name, value in os.environ.items() if name not in {"NO_COLOR", "CLICOLOR"}}
    environment = {**plain, "PYTHONPATH": str(ROOT), "TERM": "xterm", **variables}
    argv = [sys.executable, "-m", "forge", *words]
    with subprocess.Popen(argv, cwd=root, env=environment, stdout=there, stderr=there):
        os.close(there)
        shown = bytearray()
        while True:
            try:
                chunk = os.read(here, 65536)
            except OSError:  # the other end is closed
                break
            shown += chunk
        os.close(here)
    return bytes(shown)


@pytest.fixture
def root(tree: Tree) -> Path:
    files = {"package.xml": manifest_text("p", build_type="cmake"), "CMakeLists.txt": CMAKE, "p.cpp": WARNS}
    return tree({f"src/p/{name}": text for name, text in files.items()})


@pytest.mark.parametrize("generator", ["Ninja", "Unix Makefiles"])
def test_compiler_output_is_coloured_only_on_terminals(root: Path, generator: str) -> None:
    build = ("build", "--cmake-args", "-G", generator)
    shown = on_terminal(root, *build)
    assert MAGENTA in shown
    assert b"unused variable" in shown
    assert b"\x1b]8" not in shown
    logs = root / "log/latest_build"
    for file in ("p/stdout_stderr.log", "p/streams.log", "events.log"):
        text = (logs / file).read_bytes()
        assert b"unused variable" in text, file
        assert b"\x1b" not in text, file
        assert b"\\x1b" not in text, file
    commands = (root / "build/p/compile_commands.json").read_text(encoding="utf-8")
    assert "color" not in commands

    assert b"1 package unchanged" in on_terminal(root, *build, NO_COLOR="1")
    assert b"1 package unchanged" in on_terminal(root, *build)
    (root / "src/p/p.cpp").write_text(WARNS.replace("unused", "useless"), encoding="utf-8")
    shown = on_terminal(root, *build, NO_COLOR="1")
    assert b"useless" in shown
    assert MAGENTA not in shown


def test_colours_set_no_variables_for_scripts(root: Path) -> None:
    script = 'file(WRITE "${OUT}" "$ENV{CLICOLOR_FORCE}$ENV{FORCE_COLOR}")\n'
    (root / "src/p/note.cmake").write_text(script, encoding="utf-8")
    command = "${CMAKE_COMMAND} -DOUT=${CMAKE_BINARY_DIR}/note -P ${CMAKE_SOURCE_DIR}/note.cmake"
    with (root / "src/p/CMakeLists.txt").open("a", encoding="utf-8") as stream:
        stream.write(f"add_custom_target(note ALL COMMAND {command} COMMAND test ! -t 2)\n")
    assert b"Finished" in on_terminal(root, "build")
    assert not (root / "build/p/note").read_text(encoding="utf-8")
