"""C++ compilers collect garbage later while forge builds, and make the same files."""

import json
import os
import shutil
import subprocess
from pathlib import Path

import pytest

from forge.plugins.gcc_heap.heap import SCRIPT, heap_variables
from forge.toolchain.resources import LIBRARY_PATH_BELOW, Memory
from tests.conftest import Forge, Tree
from tests.packages import manifest_text

pytestmark = [pytest.mark.slow, pytest.mark.needs("cmake", "ninja", "make", "g++")]

OPTION = "--param=ggc-min-heapsize=524288"
PLENTY = Memory(64 << 30, 64 << 30)
RECORDING = """#!/bin/sh
printf '%s\\n' "$*" >> "$(dirname "$0")/compilations"
exec g++ "$@"
"""
FILES = {
    "src/p/package.xml": manifest_text("p", build_type="cmake"),
    "src/p/CMakeLists.txt": """cmake_minimum_required(VERSION 3.10)
project(p C CXX)
add_library(p SHARED a.cpp b.c)
install(TARGETS p DESTINATION lib)
""",
    "src/p/a.cpp": "#include <map>\n#include <string>\nstd::map<std::string, std::string> names;\n",
    "src/p/b.c": "int b(void) { return 1; }\n",
}


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    """Return a C++ compiler that is GCC and writes its command lines to a file beside it."""
    compiler = tmp_path / "tools" / "x86_64-linux-gnu-g++-12"
    compiler.parent.mkdir()
    compiler.write_text(RECORDING)
    compiler.chmod(0o755)
    return compiler


def compilations(compiler: Path) -> list[str]:
    """Return the recorded command lines that compile a.cpp, and forget them."""
    record = compiler.with_name("compilations")
    lines = record.read_text(encoding="utf-8").splitlines()
    record.unlink()
    return [line for line in lines if line.endswith("/a.cpp")]


@pytest.mark.parametrize("generator", ["Ninja", "Unix Makefiles"])
def test_only_compilers_started_by_forge_get_the_option(
    tree: Tree, forge: Forge, recording: Path, generator: str
) -> None:
    root = tree(FILES)
    arguments = ("--jobs", "1", "--cmake-args", f"-DCMAKE_CXX_COMPILER={recording}", "-G", generator)
    assert forge("build", *arguments, cwd=root).code == 0
    (line,) = compilations(recording)
    assert line.startswith("--param=ggc-min-heapsize=")
    for path in (root / "build/p/compile_commands.json", root / "build/compile_commands.json"):
        commands = [entry["command"] for entry in json.loads(path.read_text(encoding="utf-8"))]
        assert len(commands) == 2
        assert not any("FORGE" in command or "ggc" in command for command in commands)
    (root / "src/p/a.cpp").write_text("int changed;\n", encoding="utf-8")
    by_hand = ["cmake", "--build", str(root / "build/p")]
    done = subprocess.run(by_hand, capture_output=True, text=True, check=True)
    assert "b.c" not in done.stdout
    (line,) = compilations(recording)
    assert "ggc" not in line


def test_a_failing_command_can_be_pasted_into_a_shell(tree: Tree, forge: Forge) -> None:
    root = tree(FILES | {"src/p/a.cpp": "int wrong = ;\n"})
    assert forge("build", cwd=root).code == 1
    log = (root / "log/latest_build/p/stdout.log").read_text(encoding="utf-8")
    (line,) = (line for line in log.splitlines() if line.startswith("$FORGE_CXX "))
    pasted = subprocess.run(
        ["sh", "-c", line], cwd=root / "build/p", capture_output=True, text=True, check=False
    )
    assert pasted.returncode == 1
    assert "int wrong = ;" in pasted.stderr


def test_projects_keep_their_own_launcher(tree: Tree, forge: Forge, recording: Path) -> None:
    launcher = recording.with_name("launcher")
    launcher.write_text('#!/bin/sh\necho "launched $*" >> "$(dirname "$0")/compilations"\nexec "$@"\n')
    launcher.chmod(0o755)
    text = FILES["src/p/CMakeLists.txt"]
    setting = f"set(CMAKE_CXX_COMPILER_LAUNCHER {launcher})\n"
    root = tree(FILES | {"src/p/CMakeLists.txt": text.replace("add_library", f"{setting}add_library")})
    forge("build", "--cmake-args", f"-DCMAKE_CXX_COMPILER={recording}", cwd=root)
    launched, compiled = compilations(recording)
    assert launched.startswith(f"launched {recording} ")
    assert "ggc" not in launched + compiled
    rule = f'set_property(GLOBAL PROPERTY RULE_LAUNCH_COMPILE "{launcher}")\n'
    tree({"src/p/CMakeLists.txt": text.replace("add_library", f"{rule}add_library")})
    forge("build", "--cmake-args", f"-DCMAKE_CXX_COMPILER={recording}", cwd=root)
    launched, compiled = compilations(recording)
    assert launched.startswith(f"launched {recording} ")
    assert "ggc" not in launched + compiled
    assert (root / "install/p/lib/libp.so").exists()


def launch(folder: Path, *argv: str) -> str:
    """Run a command line through the script and return what arrived."""
    environment = {
        **os.environ,
        **heap_variables(PLENTY, 2),
        LIBRARY_PATH_BELOW: "/below",
        "LD_LIBRARY_PATH": "/ws/lib",
    }
    script = SCRIPT
    for program in ("g++", "g++-13", "c++", "ccache", "cmake", "clang-tidy"):
        path = folder / program
        path.write_text('#!/bin/sh\necho "$LD_LIBRARY_PATH: $*"\n', encoding="utf-8")
        path.chmod(0o755)
    argv = (str(folder / argv[0]), *argv[1:])
    return subprocess.run(
        ["sh", script, *argv], env=environment, capture_output=True, text=True, check=True
    ).stdout


LAUNCHED = {
    "the option comes first, so that others can replace it": (
        f"/below: {OPTION} ",
        ["g++ -O2 -c a.cpp", "g++-13 -c a.cpp", "c++ -c a.cpp"],
    ),
    "object files that would record it are compiled without, and projects keep their settings": (
        "/below: ",
        [
            *("g++ -g -c a.cpp", "g++ -ggdb3 -c a.cpp", "g++ -g1 -c a.cpp", "g++ -flto -c a.cpp"),
            *("g++ -flto=auto -c a.cpp", "g++ -frecord-gcc-switches -c a.cpp"),
            *("g++ --param=ggc-min-heapsize=4096 -c a.cpp", "g++ --param ggc-min-expand=10 -c a.cpp"),
            "g++ -x c++-header -c cmake_pch.hxx.cxx",
        ],
    ),
    "other programs and unknown options are left alone": (
        "/ws/lib: ",
        [
            *("ccache /usr/bin/g++ -c a.cpp", "cmake -E __run_co_compile -- /usr/bin/g++ -c a.cpp"),
            *("clang-tidy -p build a.cpp", "g++ -fplugin=mine.so -c a.cpp", "g++ -specs=mine.specs -c a.cpp"),
            "g++ @options -c a.cpp",
        ],
    ),
}


@pytest.mark.parametrize("rule", LAUNCHED)
def test_the_launcher_adds_the_option_only_if_it_is_harmless(tmp_path: Path, rule: str) -> None:
    expected, commands = LAUNCHED[rule]
    found = {command: launch(tmp_path, *command.split()) for command in commands}
    assert found == {command: f"{expected}{command.partition(' ')[2]}\n" for command in commands}


def test_gcc_output_is_identical(tmp_path: Path) -> None:
    """With the option, and if it collects garbage all the time."""
    source, result = tmp_path / "a.cpp", tmp_path / "a.o"
    source.write_text(
        '#include <map>\n#include <string>\nstd::map<std::string, std::string> f() { return {{"a", "b"}}; }\n'
    )
    script = SCRIPT
    compiler = shutil.which("g++") or ""
    often = [compiler, "--param=ggc-min-heapsize=1024", "--param=ggc-min-expand=1"]
    objects = []
    for prefix in (often, ["sh", str(script), compiler]):
        environment = {**os.environ, **heap_variables(PLENTY, 2)}
        subprocess.run([*prefix, "-O1", "-c", str(source), "-o", str(result)], env=environment, check=True)
        objects.append(result.read_bytes())
    assert objects[0] == objects[1]
