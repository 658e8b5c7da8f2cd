"""CMake detects the compilers once, and packages reuse the result."""

import os
import shutil
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

import pytest

from forge.plugins.compiler_probe.probe import Toolchain
from forge.toolchain.cmake_variables import unused_variables
from tests.conftest import Tree

LISTS = """cmake_minimum_required(VERSION 3.18)
project(x VERSION 1.2 LANGUAGES CXX)
add_executable(x x.cpp)
target_compile_features(x PRIVATE cxx_std_17)
install(TARGETS x DESTINATION lib/x)
"""


def is_seeded(toolchain: Toolchain, source: Path, build: Path, variables: Mapping[str, str]) -> bool:
    """Offer the results to a build folder; tell whether they were copied into it."""
    was_configured = (build / "CMakeCache.txt").exists()
    toolchain.seed(source, build, variables)
    return not was_configured and (build / "CMakeCache.txt").is_file()


@pytest.mark.needs("cmake", "ninja", "g++")
@pytest.mark.parametrize("generator", ["Ninja", "Unix Makefiles"])
def test_a_build_folder_with_cached_detection_is_configured_normally(tree: Tree, generator: str) -> None:
    """The rules and objects equal those of a folder that CMake has configured twice without help.

    In its second run, CMake omits a variable of the Microsoft compiler that the first writes for each target.
    """
    root = tree({"src/CMakeLists.txt": LISTS, "src/x.cpp": "int main() {}\n"})
    cmake = Path(shutil.which("cmake") or "")
    arguments = ("-G", generator, "-DCMAKE_BUILD_TYPE=Release", "-DTYPO=1", "-D", "WRONG:STRING=x")
    files, warnings = {}, {}
    for place in ("usual", "seeded"):
        build = root / "build"
        build.mkdir()
        toolchain = Toolchain(root / "cache", cmake, arguments, (("c++", "g++"),))
        seeded = place == "seeded" and is_seeded(toolchain, root / "src", build, os.environ)
        argv = [str(word) for word in (cmake, "-S", root / "src", "-B", build, *arguments)]
        said = subprocess.run(argv, check=True, capture_output=True, text=True)
        assert ("Detecting CXX compiler ABI info" in said.stdout) != seeded
        warnings[place] = unused_variables(said.stderr.encode())
        subprocess.run(argv, check=True, capture_output=True)
        subprocess.run([cmake, "--build", build], check=True, capture_output=True)
        files[place] = _what_matters(build)
        assert not is_seeded(toolchain, root / "src", build, os.environ), "the folder is no longer new"
        shutil.rmtree(build)
    for name in files["usual"]:
        assert files["usual"][name] == files["seeded"][name], name
    assert warnings["usual"] == warnings["seeded"] == {"TYPO", "WRONG"}


@pytest.mark.needs("cmake", "ninja", "g++")
def test_initial_flags_come_from_the_environment_of_the_step(tree: Tree) -> None:
    """A step may set CXXFLAGS, for example for path maps; the reference project has none."""
    root = tree({"src/CMakeLists.txt": LISTS, "src/x.cpp": "int main() {}\n"})
    cmake, build = Path(shutil.which("cmake") or ""), root / "build"
    build.mkdir()
    assert is_seeded(Toolchain(root / "cache", cmake, ("-G", "Ninja"), ()), root / "src", build, os.environ)
    argv = [str(cmake), "-S", str(root / "src"), "-B", str(build), "-G", "Ninja"]
    subprocess.run(argv, check=True, capture_output=True, env={**os.environ, "CXXFLAGS": "-DMAPPED"})
    assert "FLAGS = -DMAPPED" in (build / "build.ninja").read_text()


@pytest.mark.needs("cmake", "ninja", "g++")
def test_damaged_results_are_recreated(tree: Tree) -> None:
    root = tree({"src/CMakeLists.txt": LISTS, "src/x.cpp": "int main() {}\n"})

    def seeded(name: str) -> dict[str, bytes]:
        (root / name).mkdir()
        toolchain = Toolchain(root / "cache", Path(shutil.which("cmake") or ""), ("-G", "Ninja"), ())
        assert is_seeded(toolchain, root / "src", root / name, os.environ)
        files = (path for path in (root / name).rglob("*") if path.is_file())
        return {str(path.relative_to(root / name)): path.read_bytes() for path in files}

    whole = seeded("one")
    for path in (path for path in (root / "cache").rglob("*") if path.is_file()):
        path.write_bytes(b"\xf1\x00" + path.read_bytes())
    damaged = seeded("two")
    assert damaged.keys() == whole.keys()
    assert [name for name in whole if b"\xf1\x00" in damaged[name]] == []


def _what_matters(build: Path) -> dict[str, object]:
    """Return the objects and rules below a build folder, without the files that CMake itself read."""
    found: dict[str, object] = {}
    for path in sorted(build.rglob("*")):
        if path.suffix == ".o":
            found[path.name] = path.read_bytes()
        elif path.name in {
            "build.ninja",
            "rules.ninja",
            "build.make",
            "flags.make",
            "link.txt",
            "cmake_install.cmake",
        }:
            lines = path.read_text().splitlines()
            found[path.relative_to(build).as_posix()] = [
                line for line in lines if "CMakeSystem.cmake" not in line and "/share/cmake" not in line
            ]
    return found


@pytest.mark.needs("cmake", "ninja", "gcc")
def test_the_cxx_compiler_is_tested_only_if_needed(tree: Tree) -> None:
    """A cross compiler may compile its C++ library for minutes when it is tested."""
    root = tree({"src/CMakeLists.txt": LISTS.replace(" LANGUAGES CXX", " LANGUAGES C"), "build/keep": ""})
    cmake, variables = Path(shutil.which("cmake") or ""), {**os.environ, "CXX": "/no/such/compiler"}
    toolchain = Toolchain(root / "cache", cmake, ("-G", "Ninja"), (), languages="C")
    assert is_seeded(toolchain, root / "src", root / "build", variables)
    assert "CMAKE_CXX_COMPILER" not in (root / "build/CMakeCache.txt").read_text()


@pytest.mark.needs("cmake")
def test_without_a_compiler_no_results_are_reused(tree: Tree) -> None:
    root = tree({"src/CMakeLists.txt": LISTS, "build/keep": ""})
    variables = {**os.environ, "CXX": "/no/such/compiler"}
    toolchain = Toolchain(root / "cache", Path(shutil.which("cmake") or ""), (), ())
    assert not is_seeded(toolchain, root / "src", root / "build", variables)
    assert not (root / "build/CMakeCache.txt").exists()


@pytest.mark.needs("cmake", "ninja", "g++")
@pytest.mark.parametrize("languages", ["", " NONE"])
def test_python_detection_is_cached(tree: Tree, languages: str) -> None:
    """In a new folder, CMake starts the interpreter as often as in a configured one: once.

    CMake 4.4 distrusts cached results of projects with languages, even its own.
    """
    asked = "find_package(Python3 REQUIRED COMPONENTS Interpreter)\n"
    lists = f"cmake_minimum_required(VERSION 3.18)\nproject(x{languages})\n{asked}"
    told = 'message("is ${Python3_EXECUTABLE} ${Python3_VERSION} ${Python3_SITELIB} ${Python3_SOABI}")\n'
    root = tree(
        {
            "src/CMakeLists.txt": lists + told,
            "python3": f'#!/bin/sh\necho start >> "$0.log"\nexec {sys.executable} "$@"\n',
        }
    )
    python, log = root / "python3", root / "python3.log"
    python.chmod(0o755)
    cmake = Path(shutil.which("cmake") or "")

    def configured(place: str) -> tuple[str, int]:
        log.write_text("")
        argv = (
            cmake,
            "-S",
            root / "src",
            "-B",
            root / place,
            "-G",
            "Ninja",
            f"-DPython3_EXECUTABLE={python}",
        )
        said = subprocess.run(argv, check=True, capture_output=True, text=True).stderr
        return said[said.index("is ") :], log.read_text().count("start")

    toolchain = Toolchain(root / "cache", cmake, ("-G", "Ninja"), (), python)
    assert is_seeded(toolchain, root / "src", root / "seeded", os.environ)
    first, again, seeded = configured("usual"), configured("usual"), configured("seeded")
    assert first[1] > 4
    assert first[0] == again[0] == seeded[0]
    distrusted = languages and (again[1], seeded[1]) == (1, first[1])
    assert seeded[1] == again[1] or (distrusted and _version(cmake) >= (4, 4))


def _version(cmake: Path) -> tuple[int, ...]:
    said = subprocess.run([cmake, "--version"], check=True, capture_output=True, text=True).stdout
    return tuple(int(word) for word in said.split()[2].split(".")[:2])
