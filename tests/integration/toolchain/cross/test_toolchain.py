"""The toolchain file of a target, and what it is made of."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

import pytest

from forge.base.errors import EnvironmentFault
from forge.base.layout import Layout
from forge.toolchain.cross.targets import parse_target
from forge.toolchain.cross.toolchain import has_emulator, prepare_cross_build

if TYPE_CHECKING:
    from pathlib import Path

    from forge.toolchain.cross.toolchain import CrossBuild
    from tests.conftest import Tree

QEMU = {"bin/qemu-aarch64": "#!/bin/sh\n"}
ZIG = {"bin/zig": '#!/bin/sh\necho "$@" >> "$ZIG_GLOBAL_CACHE_DIR/../calls"\n'}


@pytest.fixture(autouse=True)
def _without_the_wheel(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ziglang", None)


def layout(root: Path, target: str = "aarch64-linux-gnu") -> Layout:
    return Layout(root / "build" / target, root / "install" / target, None, target=target)


def prepare(root: Path, word: str = "arm64", *, toolchain_file: str = "", sysroot: str = "") -> CrossBuild:
    return prepare_cross_build(
        parse_target(word),
        layout(root),
        {"PATH": str(root / "bin"), "XDG_CACHE_HOME": str(root / "cache")},
        toolchain_file=root / toolchain_file if toolchain_file else None,
        sysroot=root / sysroot if sysroot else None,
    )


def test_zig_on_path_is_the_compiler_of_a_known_target(tree: Tree) -> None:
    root = tree(ZIG)
    cross = prepare(root, "arm64.2.31")
    text = cross.file.read_text()
    assert 'set(CMAKE_CXX_COMPILER "${CMAKE_CURRENT_LIST_DIR}/c++")' in text
    assert "set(CMAKE_SYSTEM_PROCESSOR aarch64)" in text
    script = cross.file.with_name("c++").read_text()
    assert f"exec {root}/bin/zig c++ -target aarch64-linux-gnu.2.31 -fno-sanitize=undefined" in script
    assert f"export ZIG_GLOBAL_CACHE_DIR={root}/cache/forge/zig\n" in script
    assert cross.variables["CXX"] == str(cross.file.with_name("c++"))
    assert cross.variables["PKG_CONFIG_LIBDIR"] == "/dev/null"
    assert not has_emulator(layout(root))


def test_the_file_is_the_same_at_every_path(tree: Tree) -> None:
    """Else a cache could not be shared, and a workspace that was moved would be built again."""
    root = tree({**ZIG, **QEMU})
    assert str(root / "install") not in prepare(root).file.read_text()


def test_an_unchanged_file_is_not_written_again(tree: Tree) -> None:
    root = tree(ZIG)
    files = sorted(prepare(root).file.parent.iterdir())
    before = [path.stat().st_ino for path in files]
    assert len(files) == 5
    prepare(root)
    assert [path.stat().st_ino for path in files] == before


def test_qemu_runs_programs_with_the_libraries_of_the_sysroot(tree: Tree) -> None:
    root = tree({**QEMU, "root/usr/lib/python3.10/os.py": "", "own.cmake": "# mine\n"})
    cross = prepare(root, sysroot="root", toolchain_file="own.cmake")
    text = cross.file.read_text()
    assert f'set(CMAKE_CROSSCOMPILING_EMULATOR "{root}/bin/qemu-aarch64;-L;{root}/root")' in text
    assert f'include("{root}/own.cmake")' in text
    assert f'set(CMAKE_SYSROOT "{root}/root")' in text
    assert "CMAKE_SYSTEM_NAME" not in text
    assert cross.zig is None
    assert cross.python_version == (3, 10)
    assert cross.variables["PKG_CONFIG_SYSROOT_DIR"] == str(root / "root")
    assert has_emulator(layout(root))


def test_the_python_of_a_sysroot_is_what_its_link_says(tree: Tree) -> None:
    root = tree({"root/usr/lib/python3.13/os.py": "", "root/usr/bin/python3.11": "", "own.cmake": ""})
    (root / "root/usr/bin/python3").symlink_to("python3.11")
    assert prepare(root, sysroot="root", toolchain_file="own.cmake").python_version == (3, 11)


def test_the_processor_of_this_machine_needs_no_emulator(tree: Tree, monkeypatch: pytest.MonkeyPatch) -> None:
    machine = type("Machine", (), {"machine": "aarch64"})
    monkeypatch.setattr("os.uname", lambda: machine)
    assert 'set(CMAKE_CROSSCOMPILING_EMULATOR "/usr/bin/env")' in prepare(tree(ZIG)).file.read_text()


@pytest.mark.parametrize(
    ("word", "options", "message"),
    [
        ("arm64", {}, "no compiler for 'aarch64-linux-gnu' found"),
        ("mips-linux-gnu", {}, "unknown target 'mips-linux-gnu'"),
        ("arm64.2.31", {"toolchain_file": "own.cmake"}, "'--toolchain-file' decides which version of glibc"),
        ("arm64", {"toolchain_file": "gone.cmake"}, "gone.cmake' does not exist"),
        ("arm64", {"toolchain_file": "own.cmake", "sysroot": "own.cmake"}, "is not a folder"),
    ],
)
def test_what_cannot_be_built_is_told_before_anything_is_written(
    tree: Tree, word: str, options: dict[str, str], message: str
) -> None:
    root = tree({"own.cmake": ""})
    with pytest.raises(EnvironmentFault, match=message):
        prepare(root, word, **options)
    assert not (root / "build").exists()


def test_zig_compiles_its_library_once(tree: Tree, capsys: pytest.CaptureFixture[str]) -> None:
    root = tree(ZIG)
    cross = prepare(root)
    (root / "cache/forge/zig").mkdir(parents=True)
    assert cross.zig is not None
    cross.zig.compile_libraries(cross.file.parent)
    assert capsys.readouterr().err == (
        "zig compiles its C++ library for aarch64-linux-gnu, once for this machine: this takes a few "
        "minutes\n"
    )
    cross.zig.compile_libraries(cross.file.parent)
    assert capsys.readouterr().err == ""
    assert len((root / "cache/forge/calls").read_text().splitlines()) == 1
