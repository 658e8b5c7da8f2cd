"""`forge build --audit` reports what packages read without declaring it, and nothing in our own packages."""

import shutil
from collections.abc import Mapping
from functools import partial
from pathlib import Path

import pytest

from tests.cmake.test_shapes import copy_shapes
from tests.conftest import Forge, Ran, Tree
from tests.packages import manifest_text

pytestmark = [pytest.mark.slow, pytest.mark.needs("cmake", "g++")]

SHELL = Path("/bin/sh").resolve().name
package = partial(manifest_text, build_type="cmake")
MINIMUM = "cmake_minimum_required(VERSION 3.16)\n"
OUTSIDE = """\
cmake_minimum_required(VERSION 3.16)
project(a C)
file(READ {outside}/configured.txt text)
add_custom_command(OUTPUT made.h DEPENDS {depends} COMMAND sh ${{CMAKE_CURRENT_SOURCE_DIR}}/make.sh made.h)
add_executable(x x.c made.h)
target_include_directories(x PRIVATE ${{CMAKE_CURRENT_BINARY_DIR}})
install(TARGETS x DESTINATION bin)
"""


def outside(root: Path, depends: str = "") -> Mapping[str, str]:
    """Return a package that reads two files elsewhere, one of them in a script."""
    folder = root / "outside"
    return {
        "ws/src/a/package.xml": package("a"),
        "ws/src/a/CMakeLists.txt": OUTSIDE.format(outside=folder, depends=depends),
        "ws/src/a/make.sh": f"cat {folder}/made.txt > $1\n",
        "ws/src/a/x.c": '#include "made.h"\nint main(void) { return MADE; }\n',
        "outside/made.txt": "#define MADE 0\n",
        "outside/configured.txt": "text\n",
    }


def audit(forge: Forge, root: Path, *options: str) -> tuple[Ran, list[str]]:
    ran = forge("build", "--audit", *options, cwd=root)
    return ran, ran.out.partition("Summary: ")[2].splitlines()[1:]


def test_undeclared_files_are_reported_with_the_line_to_add(forge: Forge, tree: Tree, tmp_path: Path) -> None:
    """From scratch, as a package may be up to date."""
    root = tree(outside(tmp_path)) / "ws"
    assert forge("build", cwd=root).code == 0
    left = root / "build/a/left_over"
    left.touch()
    ran, lines = audit(forge, root)
    assert ran.code == 1, ran.err
    folder = tmp_path / "outside"
    assert lines == [
        f"a: 'cmake' read {folder}/configured.txt for cmake",
        "  hint: add 'set_property(DIRECTORY APPEND PROPERTY "
        f"CMAKE_CONFIGURE_DEPENDS {folder}/configured.txt)' to CMakeLists.txt",
        f"a: 'cat' read {folder}/made.txt for 'made.h'",
        f"  hint: add 'DEPENDS {folder}/made.txt' to the add_custom_command() that makes 'made.h'",
        f"a: '{SHELL}' read {root}/src/a/make.sh for 'made.h'",
        f"  hint: add 'DEPENDS {root}/src/a/make.sh' to the add_custom_command() that makes 'made.h'",
        "audit: 1 of 1 package reads 3 files without declaring them",
    ]
    assert not left.exists()
    assert "Starting" not in forge("build", cwd=root).out


def test_following_the_hints_resolves_the_findings(forge: Forge, tree: Tree, tmp_path: Path) -> None:
    folder = tmp_path / "outside"
    files = dict(outside(tmp_path, f"{folder}/made.txt make.sh"))
    files["ws/src/a/CMakeLists.txt"] += (
        f"set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS {folder}/configured.txt)\n"
    )
    ran, lines = audit(forge, tree(files) / "ws", "--cmake-args", "-GNinja")
    assert lines == ["audit: 1 package, no undeclared inputs"]
    assert ran.code == 0


def test_failing_packages_are_reported_as_in_a_build(forge: Forge, tree: Tree, tmp_path: Path) -> None:
    files = {**outside(tmp_path), "ws/src/a/x.c": "nonsense\n"}
    ran, _ = audit(forge, tree(files) / "ws")
    assert ran.code == 1
    assert ran.out.endswith("audit: 0 packages, no undeclared inputs\n")


def test_undeclared_compiler_and_linker_inputs_get_the_right_properties(
    forge: Forge, tree: Tree, tmp_path: Path
) -> None:
    root = tree(
        {
            "ws/src/l/package.xml": package("l"),
            "ws/src/l/CMakeLists.txt": (
                f"{MINIMUM}project(l C)\nadd_executable(x x.c)\n"
                "target_link_options(x PRIVATE -Wl,--version-script=${CMAKE_SOURCE_DIR}/x.map)\n"
                "install(TARGETS x DESTINATION bin)\n"
            ),
            "ws/src/l/x.c": f'__asm__(".incbin \\"{tmp_path}/blob\\"");\nint main(void) {{ return 0; }}\n',
            "ws/src/l/x.map": "{ global: *; };\n",
            "blob": "1234",
        }
    )
    ran, lines = audit(forge, root / "ws")
    assert ran.code == 1
    assert [line for line in lines if "hint" in line] == [
        f"  hint: add 'set_property(SOURCE {root}/ws/src/l/x.c "
        f"APPEND PROPERTY OBJECT_DEPENDS {tmp_path}/blob)'",
        f"  hint: add 'set_property(TARGET x APPEND PROPERTY LINK_DEPENDS {root}/ws/src/l/x.map)'",
    ]


LIBRARY = f"""{MINIMUM}project(lib C)
install(FILES lib.h DESTINATION include/lib)
"""
USER = f"""{MINIMUM}project(user C)
add_executable(x x.c)
target_include_directories(x PRIVATE {{include}})
install(TARGETS x DESTINATION bin)
"""


def with_library(include: Path, more: str = "") -> dict[str, str]:
    return {
        "ws/src/lib/package.xml": package("lib"),
        "ws/src/lib/CMakeLists.txt": LIBRARY,
        "ws/src/lib/lib.h": "#define LIB 0\n",
        "ws/src/user/package.xml": package("user", more),
        "ws/src/user/CMakeLists.txt": USER.format(include=include),
        "ws/src/user/x.c": "#include <lib/lib.h>\nint main(void) { return LIB; }\n",
    }


@pytest.mark.parametrize("layout", [(), ("--merge-install",)])
def test_undeclared_dependencies_are_reported(
    forge: Forge, tree: Tree, tmp_path: Path, layout: tuple[str, ...]
) -> None:
    include = tmp_path / "ws/install" / ("include" if layout else "lib/include")
    root = tree(with_library(include)) / "ws"
    ran, lines = audit(forge, root, "--executor", "sequential", *layout)
    assert ran.code == 1, ran.err
    assert lines == [
        f"user: 'cc1' read {include}/lib/lib.h of package 'lib'",
        "  hint: add <depend>lib</depend> to package.xml",
        "audit: 1 of 2 packages reads 1 file without declaring it",
    ]
    tree(with_library(include, "<depend>lib</depend>"))
    assert audit(forge, root, *layout)[1] == ["audit: 2 packages, no undeclared inputs"]


def test_underlay_headers_used_instead_of_workspace_headers_are_reported(
    forge: Forge, tree: Tree, tmp_path: Path
) -> None:
    include = tmp_path / "under/install/lib/include"
    root = tree(with_library(include, "<depend>lib</depend>"))
    shutil.copytree(root / "ws/src/lib", root / "under/src/lib")
    assert forge("build", cwd=root / "under").code == 0
    prefix = {"AMENT_PREFIX_PATH": f"{root}/under/install/lib"}
    ran = forge("build", "--audit", cwd=root / "ws", env=prefix)
    assert ran.code == 1, ran.err
    text = (
        f"user: 'cc1' read {include}/lib/lib.h of an underlay, but this workspace builds 'lib'\n  hint: let"
    )
    assert text in ran.out


def test_unobservable_programs_are_reported(forge: Forge, tree: Tree, tmp_path: Path) -> None:
    files = dict(outside(tmp_path, f"{tmp_path}/outside/made.txt"))
    files["ws/src/a/CMakeLists.txt"] = (
        f"{MINIMUM}project(a C)\nadd_executable(gen gen.c)\ntarget_link_options(gen PRIVATE -static)\n"
        "add_custom_command(OUTPUT made.h COMMAND gen DEPENDS gen)\n"
        "add_custom_target(all_made ALL DEPENDS made.h)\n"
    )
    files["ws/src/a/gen.c"] = '#include <stdio.h>\nint main(void) { return !fopen("made.h", "w"); }\n'
    ran, lines = audit(forge, tree(files) / "ws")
    assert lines == [
        f"a: '{tmp_path}/ws/build/a/gen' cannot be observed; its inputs are unknown",
        "audit: 1 package, no undeclared inputs; 1 could not be observed completely",
    ]
    assert ran.code == 0


def test_an_audit_without_a_compiler_is_rejected(forge: Forge, tree: Tree, tmp_path: Path) -> None:
    root = tree(outside(tmp_path)) / "ws"
    programs = tmp_path / "bin"
    programs.mkdir()
    for name in ("cmake", "make", "sh", "cat"):
        (programs / name).symlink_to(shutil.which(name) or name)
    variables = {"PATH": str(programs), "XDG_CACHE_HOME": str(tmp_path / "cache"), "CC": "", "CXX": ""}
    ran = forge("build", "--audit", cwd=root, env=variables)
    assert ran.code == 2
    assert "error: '--audit' cannot observe programs here" in ran.err
    assert "apt install gcc" in ran.err


def test_the_shapes_have_no_undeclared_inputs(forge: Forge, tmp_path: Path) -> None:
    """All ten, with a few of the many messages, in the other layout."""
    copy_shapes(tmp_path, 8)
    ran, lines = audit(forge, tmp_path, "--merge-install", "--symlink-install", "--packages-skip", "users")
    assert ran.code == 0, ran.err
    assert lines[-1] == "audit: 23 packages, no undeclared inputs", "\n".join(lines)
