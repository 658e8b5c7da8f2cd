"""The toolchain file of a target, and what it is made of."""

import os
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from forge.base.errors import HostError
from forge.base.layout import Layout
from forge.plugins.cross import toolchain
from forge.plugins.cross.targets import Target
from forge.plugins.cross.toolchain import has_emulator
from forge.plugins.cross.zig import Zig
from forge.toolchain.targets import CrossBuild, CrossOptions
from forge.workspace.model import Package
from tests.conftest import Tree
from tests.packages import package

QEMU = {"bin/qemu-aarch64": "#!/bin/sh\n"}
ZIG = {"bin/zig": "#!/bin/sh\n"}
LIBRARY = "cache/forge/zig/forge/*/libc++.a"


@pytest.fixture(autouse=True)
def _without_the_wheel(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ziglang", None)


def layout(root: Path, target: str = "aarch64-linux-gnu") -> Layout:
    return Layout(root / "build" / target, root / "install" / target, None, target=target)


def prepare(root: Path, word: str = "arm64", *, toolchain_file: str = "", sysroot: str = "") -> CrossBuild:
    file, copy = (root / name if name else None for name in (toolchain_file, sysroot))
    variables = {"PATH": str(root / "bin"), "XDG_CACHE_HOME": str(root / "cache")}
    return toolchain.prepare(word, layout(root), variables, CrossOptions(file, copy))


def file_of(build: CrossBuild) -> Path:
    return Path(build.cmake_args[0].partition("=")[2])


def compiled(root: Path, languages: str = "") -> Package:
    """Return a CMake package that enables these languages, or C and C++."""
    found = replace(package("hello", build_type="cmake"), path=root / "hello")
    found.path.mkdir(exist_ok=True)
    (found.path / "CMakeLists.txt").write_text(f"project(hello {languages})\n")
    return found


def test_zig_on_path_is_the_compiler_of_a_known_target(tree: Tree) -> None:
    root = tree(ZIG)
    cross = prepare(root, "arm64.2.31")
    text = file_of(cross).read_text()
    assert 'set(CMAKE_CXX_COMPILER "${CMAKE_CURRENT_LIST_DIR}/c++")' in text
    assert "set(CMAKE_SYSTEM_PROCESSOR aarch64)" in text
    script = file_of(cross).with_name("c++").read_text()
    assert f"exec {root}/bin/zig c++ -target aarch64-linux-gnu.2.31 -fno-sanitize=undefined" in script
    assert f"export ZIG_GLOBAL_CACHE_DIR={root}/cache/forge/zig\n" in script
    assert cross.variables["CXX"] == str(file_of(cross).with_name("c++"))
    assert cross.variables["PKG_CONFIG_LIBDIR"] == "/dev/null"
    assert not has_emulator(layout(root))


def test_the_toolchain_file_contains_no_workspace_path(tree: Tree) -> None:
    """Otherwise caches could not be shared, and a moved workspace would be rebuilt."""
    root = tree({**ZIG, "own.cmake": ""})
    assert str(root) not in file_of(prepare(root)).read_text()
    assert str(root) not in file_of(prepare(root, toolchain_file="own.cmake")).read_text()


def test_packages_are_found_only_in_underlays_for_the_target(tree: Tree) -> None:
    """Those for this machine have generators, but not the libraries."""
    names = ("here/install", "there/install/aarch64-linux-gnu")
    setups = {f"{name}/local_setup.sh": "" for name in names}
    root = tree({**ZIG, **setups})
    variables = {
        "PATH": str(root / "bin"),
        "XDG_CACHE_HOME": str(root / "cache"),
        "COLCON_PREFIX_PATH": os.pathsep.join(str(root / name) for name in names),
    }
    text = file_of(toolchain.prepare("arm64", layout(root), variables, CrossOptions())).read_text()
    assert f'list(APPEND CMAKE_FIND_ROOT_PATH "{root}/there/install/aarch64-linux-gnu")' in text
    assert f"{root}/here" not in text


def test_an_unchanged_file_is_not_written_again(tree: Tree) -> None:
    root = tree(ZIG)
    files = sorted(file_of(prepare(root)).parent.iterdir())
    before = [path.stat().st_ino for path in files]
    assert len(files) == 5
    prepare(root)
    assert [path.stat().st_ino for path in files] == before


def test_qemu_runs_programs_with_the_libraries_of_the_sysroot(tree: Tree) -> None:
    root = tree({**QEMU, "root/usr/lib/python3.10/os.py": "", "own.cmake": "# mine\n"})
    cross = prepare(root, sysroot="root", toolchain_file="own.cmake")
    text = file_of(cross).read_text()
    assert f'set(CMAKE_CROSSCOMPILING_EMULATOR "{root}/bin/qemu-aarch64;-L;{root}/root")' in text
    assert 'include("${CMAKE_CURRENT_LIST_DIR}/../../../own.cmake")' in text
    assert f'set(CMAKE_SYSROOT "{root}/root")' in text
    assert "CMAKE_SYSTEM_NAME" not in text
    assert not file_of(cross).with_name("c++").exists()
    assert cross.python_version == (3, 10)
    assert 'set(PYTHON_SOABI "cpython-310-aarch64-linux-gnu")' in text
    assert cross.variables["PKG_CONFIG_SYSROOT_DIR"] == str(root / "root")
    assert has_emulator(layout(root))


def test_the_python_version_of_a_sysroot_comes_from_its_link(tree: Tree) -> None:
    root = tree({"root/usr/lib/python3.13/os.py": "", "root/usr/bin/python3.11": "", "own.cmake": ""})
    (root / "root/usr/bin/python3").symlink_to("python3.11")
    assert prepare(root, sysroot="root", toolchain_file="own.cmake").python_version == (3, 11)


FINDS_KNOWN = """\
cmake_minimum_required(VERSION 3.22)
project(finds_known NONE)
find_package(known REQUIRED)
"""


@pytest.mark.needs("cmake")
def test_packages_are_found_in_the_architecture_folder(tree: Tree) -> None:
    """CMake asks the compiler for its name, but not without languages, and no path may contain a blank."""
    root = tree(
        {
            "a root/usr/lib/aarch64-linux-gnu/cmake/known/known-config.cmake": "",
            "own.cmake": "set(CMAKE_SYSTEM_NAME Linux)\n",
            "src/CMakeLists.txt": FINDS_KNOWN,
        }
    )
    cross = prepare(root, sysroot="a root", toolchain_file="own.cmake")
    subprocess.run(["cmake", "-S", root / "src", "-B", root / "b", *cross.cmake_args], check=True)


def test_the_host_architecture_needs_no_emulator(tree: Tree, monkeypatch: pytest.MonkeyPatch) -> None:
    machine = type("Machine", (), {"machine": "aarch64"})
    monkeypatch.setattr("os.uname", lambda: machine)
    assert 'set(CMAKE_CROSSCOMPILING_EMULATOR "/usr/bin/env")' in file_of(prepare(tree(ZIG))).read_text()


@pytest.mark.parametrize(
    ("word", "options", "message"),
    [
        ("arm64", {}, "no compiler for 'aarch64-linux-gnu' found"),
        ("mips-linux-gnu", {}, "unknown target 'mips-linux-gnu'"),
        ("arm64.2.31", {"toolchain_file": "own.cmake"}, "'--toolchain-file' decides which version of glibc"),
        ("arm64", {"sysroot": "."}, "--sysroot needs --toolchain-file"),
        ("arm64", {"toolchain_file": "gone.cmake"}, "gone.cmake' does not exist"),
        ("arm64", {"toolchain_file": "own.cmake", "sysroot": "own.cmake"}, "is not a folder"),
    ],
)
def test_unsupported_packages_are_reported_before_anything_is_written(
    tree: Tree, word: str, options: dict[str, str], message: str
) -> None:
    root = tree({"own.cmake": ""})
    with pytest.raises(HostError, match=message):
        prepare(root, word, **options)
    assert not (root / "build").exists()


STAND_IN = r"""#!/bin/sh
# Writes what zig is asked to write, after the last '-o' or for 'ar', and fails for a source named 'bad'.
echo "$@" >> calls
[ "$1" = env ] && { echo ".{ .lib_dir = \"$PWD/lib\" }"; exit; }
case $* in *bad.cpp*) echo "bad.cpp:1: no" >&2; exit 1 ;; esac
tool=$1 output=$3
while [ "$#" -gt 0 ]; do [ "$1" = -o ] && output=$2; shift; done
echo "$tool" > "$output"
"""
SOURCES = {
    "lib/libcxx/src/any.cpp": "",
    "lib/libcxx/src/new.cpp": "",
    "lib/libcxx/src/support/win32/locale.cpp": "",
    "lib/libcxxabi/src/cxa_guard.cpp": "",
    "lib/libcxxabi/src/cxa_noexception.cpp": "",
}


def test_zig_compiles_its_library_once(
    tree: Tree, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """It compiles all sources for Linux and says why this takes long; later builds use the result."""
    root = tree({"bin/zig": STAND_IN, **SOURCES})
    monkeypatch.chdir(root)
    cross = prepare(root)
    assert cross.prepare_compilers([compiled(root, "C")]) == ()
    assert not (root / "calls").exists()
    hello = compiled(root)
    assert cross.prepare_compilers([hello]) == ()
    assert capsys.readouterr().err == (
        "zig compiles its C++ library for aarch64-linux-gnu, once for this machine: this takes a few "
        "minutes\n"
    )
    calls = (root / "calls").read_text()
    assert sorted(re.findall(r"-c \S+/(\w+)\.cpp", calls)) == ["any", "cxa_guard"]
    (library,) = root.glob(LIBRARY)
    assert library.read_text() == "ar\n"
    assert cross.prepare_compilers([hello]) == ()
    assert capsys.readouterr().err == ""
    assert (root / "calls").read_text() == calls


def test_an_incompatible_zig_library_gives_a_warning(tree: Tree, monkeypatch: pytest.MonkeyPatch) -> None:
    """The build warns, and the next build tries again."""
    root = tree({"bin/zig": STAND_IN, **SOURCES, "lib/libcxx/src/bad.cpp": ""})
    monkeypatch.chdir(root)
    cross = prepare(root)
    (problem,) = cross.prepare_compilers([compiled(root)])
    assert problem.message == "cannot compile the C++ library of this version of zig: bad.cpp:1: no"
    assert "exceptions of the standard library" in (problem.hint or "")
    assert not list(root.glob(LIBRARY))


def test_the_library_is_passed_only_when_linking(tree: Tree, monkeypatch: pytest.MonkeyPatch) -> None:
    root = tree({"bin/zig": STAND_IN, **SOURCES})
    monkeypatch.chdir(root)
    cross = prepare(root)
    cross.prepare_compilers([compiled(root)])
    for words in ("-c a.cpp -o a.o", "a.o -o a", "a.cpp -o a", "CMakeCXXCompilerId.cpp", "--version"):
        subprocess.run([file_of(cross).with_name("c++"), *words.split()], check=True)
    *_, compiled_, linked, both, identified, version = (root / "calls").read_text().splitlines()
    flags = "-target aarch64-linux-gnu -fno-sanitize=undefined"
    assert compiled_ == f"c++ {flags} -c a.cpp -o a.o"
    (library,) = root.glob(LIBRARY)
    assert linked == f"c++ {flags} -nostdlib++ -rdynamic {library} a.o -o a -lunwind"
    assert both == f"c++ {flags} a.cpp -o a"
    assert identified == f"c++ {flags} -c CMakeCXXCompilerId.cpp"
    assert version == f"c++ {flags} --version"


def test_an_unsupported_glibc_version_gives_a_warning(tree: Tree) -> None:
    """Build tools show no warnings of compilers that only link."""
    said = "warning: cannot build new glibc version 9.9.0; providing instead 2.44.0"
    root = tree({"bin/zig": f"#!/bin/sh\necho '{said}' >&2\n"})
    (root / "bin/zig").chmod(0o755)
    for version, expected in (("9.9", [f"zig: {said.partition(': ')[2]}"]), ("", [])):
        zig = Zig(root / "bin/zig", Target("aarch64-linux-gnu", version), root / "cache")
        assert [problem.message for problem in zig.glibc_warnings()] == expected
