"""Generated C++ sources share precompiled headers without a visible difference."""

import os
import shutil
import subprocess
import sysconfig
from collections.abc import Callable
from pathlib import Path

import pytest

from forge.base.templating import render
from forge.plugins.fast_rosidl import recipe
from forge.plugins.fast_rosidl.recipe import HEADERS_VARIABLE, prepare_precompiled_headers
from forge.toolchain.resources import LIBRARY_PATH_BELOW

Compile = Callable[..., subprocess.Popen[str]]

pytestmark = [pytest.mark.slow, pytest.mark.needs("g++")]

TOOLS = (("c++", "1"),)
SOURCE = "#include <vector>\nstd::vector<int> f() { return {1}; }\n"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the folder of precompiled headers in a workspace whose path has a space.

    Of the standard headers there are two, which take a tenth of the time.
    """
    monkeypatch.setitem(recipe._TEXTS, "standard_headers.hpp", "#include <array>\n#include <vector>\n")
    return prepared(tmp_path)


@pytest.fixture
def compile_source(tmp_path: Path, folder: Path) -> Compile:
    """Return a function that starts to compile a source by the script, with some options."""
    (tmp_path / "compile.sh").write_text(render("fast_rosidl/templates/compile_generated.sh.j2"))
    (tmp_path / "x.cpp").write_text(SOURCE)

    def start(
        *options: str,
        compiler: str = "g++",
        header: str = "standard_headers.hpp",
        source: str = "x.cpp",
    ) -> subprocess.Popen[str]:
        script = ("sh", "compile.sh", "marker", "--precompiled", header)
        # -H names the headers, and a precompiled one after "!".
        argv = (*script, compiler, *options, "-H", "-MD", "-MF", "x.d", "-o", "x.o", "-c", source)
        return subprocess.Popen(
            argv,
            cwd=tmp_path,
            env={**os.environ, HEADERS_VARIABLE: str(folder)},
            stderr=subprocess.PIPE,
            text=True,
        )

    return start


def prepared(workspace: Path, *tools: tuple[str, str]) -> Path:
    """Prepare the folder in a workspace as a build does."""
    (name, value), *others = prepare_precompiled_headers(workspace / "w s/build", tools or TOOLS).items()
    assert (name, others) == (HEADERS_VARIABLE, [])
    return type(workspace)(value)


def precompiled(folder: Path) -> list[Path]:
    return sorted(folder.glob("*/*.gch"))


def said(process: subprocess.Popen[str]) -> str:
    """Return what a compiler that succeeded has said."""
    _, errors = process.communicate()
    assert process.returncode == 0, errors
    return errors


def test_the_first_source_precompiles_and_all_use_it(compile_source: Compile, folder: Path) -> None:
    for _ in range(2):
        assert f"! {folder}/" in said(compile_source("-std=c++17"))
        assert len(precompiled(folder)) == 1


def test_concurrent_processes_precompile_once(compile_source: Compile, folder: Path) -> None:
    for process in [compile_source() for _ in range(4)]:
        assert f"! {folder}/" in said(process)
    assert len(precompiled(folder)) == 1


def test_the_dependencies_of_an_object_are_complete(compile_source: Compile, tmp_path: Path) -> None:
    said(compile_source())
    found = (tmp_path / "x.d").read_text()
    subprocess.run(["g++", "-MD", "-MF", "plain.d", "-c", "x.cpp"], cwd=tmp_path, check=True)
    usual = (tmp_path / "plain.d").read_text()
    assert {*usual.split()} - {"x.o:", "\\"} <= {*found.split()}


OPTIONS = ("-O2", "-std=c++20", "-fPIC", "-D_GLIBCXX_DEBUG", "-Wpedantic", "-fvisibility=hidden")


def test_options_that_affect_code_have_separate_precompiled_headers(
    compile_source: Compile, folder: Path
) -> None:
    for number, options in enumerate(((), *((option,) for option in OPTIONS)), 1):
        assert f"! {folder}/" in said(compile_source(*options))
        assert len(precompiled(folder)) == number
    assert f"! {folder}/" in said(compile_source())
    assert len(precompiled(folder)) == 1 + len(OPTIONS)


def test_another_cpp_library_has_a_separate_precompiled_header(
    compile_source: Compile, folder: Path, tmp_path: Path
) -> None:
    said(compile_source())
    own = tmp_path / "own library"
    own.mkdir()
    (own / "vector").write_text("#include_next <vector>\n#define OWN 1\n")
    (tmp_path / "x.cpp").write_text("#include <vector>\nint x = OWN;\n")
    for options in (("-isystem", str(own)), (f"-I{own}",), ("-I", str(own))):
        assert f"! {folder}/" in said(compile_source(*options))


def test_another_environment_has_separate_precompiled_headers(
    compile_source: Compile, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    said(compile_source())
    (tmp_path / "array").write_text("#include_next <array>\n#define OWN 1\n")
    (tmp_path / "x.cpp").write_text("#include <array>\nint x = OWN;\n")
    monkeypatch.setenv("CPLUS_INCLUDE_PATH", str(tmp_path))
    assert f"! {folder}/" in said(compile_source())


def test_irrelevant_options_share_a_precompiled_header(compile_source: Compile, folder: Path) -> None:
    first = ("-Wall", "-DPACKAGE=1", "-I/x")
    second = (
        "-DBUILDING",
        "-D",
        "OTHER",
        "--param",
        "ggc-min-expand=30",
        "-isystem",
        "/y",
        "-I",
        "z",
        "-Wextra",
    )
    for options in (first, second):
        assert f"! {folder}/" in said(compile_source(*options))
    assert len(precompiled(folder)) == 1


def test_gcc_rejects_unsuitable_precompiled_headers(compile_source: Compile, folder: Path) -> None:
    """A macro of the library in two words is not recognized, but it changes the headers."""
    assert f"! {folder}/" in said(compile_source())
    assert "! " not in said(compile_source("-D", "_GLIBCXX_ASSERTIONS"))


def test_a_compiler_without_precompilation_still_compiles(
    compile_source: Compile, folder: Path, tmp_path: Path
) -> None:
    program = tmp_path / "other g++"
    program.write_text('#!/bin/sh\ncase "$*" in *c++-header*) exit 1 ;; esac\nexec g++ "$@"\n')
    program.chmod(0o755)
    for _ in range(2):
        assert "! " not in said(compile_source(compiler=str(program)))
    assert precompiled(folder) == []


def test_a_source_compiles_without_the_folder_of_precompiled_headers(
    compile_source: Compile, folder: Path
) -> None:
    shutil.rmtree(folder)
    assert "! " not in said(compile_source())


def test_compilers_do_not_load_libraries_of_the_workspace(
    compile_source: Compile, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Those that the user's environment names are searched."""
    program = tmp_path / "own g++"
    program.write_text('#!/bin/sh\nprintf "in %s" "$LD_LIBRARY_PATH" >&2\n')
    program.chmod(0o755)
    monkeypatch.setenv("LD_LIBRARY_PATH", "/w/install/a/lib:/of the user")
    assert said(compile_source(compiler=str(program))) == "in /w/install/a/lib:/of the user"
    for below in ("/of the user", ""):
        monkeypatch.setenv(LIBRARY_PATH_BELOW, below)
        assert said(compile_source(compiler=str(program))) == f"in {below}"


def test_a_compile_error_keeps_the_marker(compile_source: Compile, tmp_path: Path) -> None:
    (tmp_path / "x.cpp").write_text("int f() { return missing; }\n")
    process = compile_source()
    _, errors = process.communicate()
    assert process.returncode == 1
    assert errors.count("was not declared") == 1
    assert (tmp_path / "marker").exists()


def test_precompiled_headers_are_kept_between_builds(
    compile_source: Compile, folder: Path, tmp_path: Path
) -> None:
    said(compile_source())
    before = precompiled(folder)
    assert prepared(tmp_path) == folder
    assert precompiled(folder) == before != []


def test_a_changed_header_is_precompiled_again(
    compile_source: Compile, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Even if its modification time is older, as that of a file from a package is."""
    (tmp_path / "own").mkdir()
    (tmp_path / "own/array").write_text("#include_next <array>\n")
    monkeypatch.setenv("CPLUS_INCLUDE_PATH", str(tmp_path / "own"))
    said(compile_source())
    (old,) = precompiled(folder)
    assert prepared(tmp_path) == folder
    assert old.exists()
    (tmp_path / "own/array").write_text("#include_next <array>\n#define NEW 1\n")
    os.utime(tmp_path / "own/array", (0, 0))
    assert prepared(tmp_path) == folder
    assert not old.exists()
    (tmp_path / "x.cpp").write_text("#include <array>\nint x = NEW;\n")
    assert f"! {folder}/" in said(compile_source())


def test_different_tools_use_a_different_folder(
    compile_source: Compile, folder: Path, tmp_path: Path
) -> None:
    said(compile_source())
    other = prepared(tmp_path, ("c++", "2"))
    assert other != folder
    assert not folder.exists()
    assert precompiled(other) == []


def test_leftovers_of_interrupted_builds_are_removed(
    compile_source: Compile, folder: Path, tmp_path: Path
) -> None:
    said(compile_source())
    (result,) = precompiled(folder)
    for name in ("ready", "standard_headers.hpp.gch", "standard_headers.hpp.d", "standard_headers.hpp"):
        (result.parent / name).unlink()  # as if it had been killed before the end, or at the very beginning
        assert prepared(tmp_path) == folder
        assert f"! {folder}/" in said(compile_source())


@pytest.mark.needs("gcc", f"{sysconfig.get_paths()['include']}/Python.h")
def test_python_extensions_share_a_precompiled_header(
    compile_source: Compile, folder: Path, tmp_path: Path
) -> None:
    include = sysconfig.get_paths()["include"]
    (tmp_path / "x.c").write_text("#include <Python.h>\nPyObject *f(void) { Py_RETURN_NONE; }\n")
    for options in (("-I", include), ("-DPACKAGE=1", "-isystem", include), (f"-I{include}",)):
        done = compile_source(*options, header="python_headers.h", compiler="gcc", source="x.c")
        assert f"! {folder}/" in said(done)
