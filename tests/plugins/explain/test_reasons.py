"""Rebuilds are announced and explained by what changed: the file, folder, option or variable."""

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from forge.cli import preparation
from tests.conftest import Forge, Tree
from tests.packages import manifest_text

pytestmark = pytest.mark.needs("cmake", "g++")

LISTS = """cmake_minimum_required(VERSION 3.18)
project({0} {1})
{2}
install(FILES package.xml DESTINATION share/{0})
"""
LIBRARY = """add_library(low low.cpp)
target_include_directories(low PUBLIC $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}> $<INSTALL_INTERFACE:include>)
install(FILES low.hpp DESTINATION include)
install(TARGETS low EXPORT low)
install(EXPORT low DESTINATION lib/cmake/low FILE low-config.cmake)
"""
USER = "find_package(low REQUIRED)\nadd_library(top top.cpp)\ntarget_link_libraries(top low)"
READER = 'message(STATUS "$ENV{MIDDLEWARE}")'


def package(name: str, code: str, *depends: str, languages: str = "CXX", **files: str) -> dict[str, str]:
    return {
        f"src/{name}/package.xml": manifest_text(name, *depends, build_type="cmake"),
        f"src/{name}/CMakeLists.txt": LISTS.format(name, languages, code),
        **{f"src/{name}/{file.replace('_', '.')}": text for file, text in files.items()},
    }


@pytest.fixture
def workspace(tree: Tree) -> Path:
    """Make a library with a user, a package that reads a variable, and one that does neither."""
    return tree(
        {
            **package("low", LIBRARY, low_hpp="int low();\n", low_cpp="int low() { return 1; }\n"),
            **package("top", USER, "<depend>low</depend>", top_cpp="#include <low.hpp>\nint top;\n"),
            **package("reader", READER, languages="NONE"),
            **package("plain", "", languages="NONE"),
        }
    )


def reasons(forge: Forge, root: Path, *options: str, env: dict[str, str] | None = None) -> dict[str, str]:
    """Return why packages would be built."""
    ran = forge("build", "--dry-run", *options, cwd=root, env=env)
    assert ran.code == 0, ran.err
    lines = (line.partition(": build, ") for line in ran.out.splitlines())
    return {name: reason for name, found, reason in lines if found}


def announced(forge: Forge, root: Path, *options: str, env: dict[str, str] | None = None) -> list[str]:
    ran = forge("build", *options, cwd=root, env=env)
    assert ran.code == 0, ran.err
    return [line for line in ran.err.splitlines() if "rebuilt" in line]


def test_changed_options_are_announced_in_one_line(forge: Forge, workspace: Path) -> None:
    """Before the build starts, and not if it builds for the first time or because of sources."""
    assert announced(forge, workspace) == []
    line = "options changed since the last build: --symlink-install; 4 packages are rebuilt"
    ran = forge("build", "--dry-run", "--symlink-install", cwd=workspace)
    assert ran.err == f"{line}\n"
    assert announced(forge, workspace, "--symlink-install") == [line]
    assert announced(forge, workspace, "--symlink-install") == []
    debug = ("--cmake-args", "-DCMAKE_BUILD_TYPE=Debug")
    changed = "-DCMAKE_BUILD_TYPE=Debug, --symlink-install (removed)"
    line = f"options changed since the last build: {changed}; 4 packages are rebuilt"
    assert announced(forge, workspace, *debug) == [line]
    assert announced(forge, workspace, "--cmake-args", "-DCMAKE_BUILD_TYPE=Release") == [
        "options changed since the last build: -DCMAKE_BUILD_TYPE=Release; 4 packages are rebuilt"
    ]
    (workspace / "src/plain/new").touch()
    assert announced(forge, workspace, "--cmake-args", "-DCMAKE_BUILD_TYPE=Release") == []


def test_only_packages_that_read_a_changed_variable_are_rebuilt(forge: Forge, workspace: Path) -> None:
    assert announced(forge, workspace) == []
    changed = "the environment variable 'MIDDLEWARE' changed; 1 package is rebuilt"
    env = {"MIDDLEWARE": "one"}
    assert reasons(forge, workspace, env=env) == {"reader": "the environment variable 'MIDDLEWARE' changed"}
    assert announced(forge, workspace, env=env) == [f"{changed}; unset it to keep it"]
    assert announced(forge, workspace, env=env) == []
    assert announced(forge, workspace, env={"MIDDLEWARE": "two"}) == [
        f"{changed}; set it as before to keep it"
    ]
    assert announced(forge, workspace) == [f"{changed}; set it as before to keep it"]


def test_a_linked_source_is_reported_as_a_source(forge: Forge, workspace: Path) -> None:
    """It is neither an installed nor an external file, also after a build that failed in between."""
    assert forge("build", "--symlink-install", cwd=workspace).code == 0
    (workspace / "src/low/low.hpp").write_text("int low(); // edited\n")
    found = reasons(forge, workspace, "--symlink-install")
    assert found["low"] == "'low.hpp' changed"
    assert found.get("top", "'src/low/low.hpp' changed") == "'src/low/low.hpp' changed"
    (workspace / "src/low/low.cpp").write_text("broken\n")
    assert forge("build", "--symlink-install", cwd=workspace).code == 1
    found = reasons(forge, workspace, "--symlink-install")
    assert found["low"] == "the last build did not finish successfully"
    assert found.get("top", "'src/low/low.hpp' changed") == "'src/low/low.hpp' changed"


def edited(root: Path) -> None:
    lists = root / "src/plain/CMakeLists.txt"
    lists.write_text(lists.read_text() + "# edited\n")


def renamed(root: Path) -> None:
    (root / "src/plain/old").rename(root / "src/plain/new")


def removed(root: Path) -> None:
    (root / "src/plain/old").unlink()


def emptied_install(root: Path) -> None:
    shutil.rmtree(root / "install/plain/share/plain")


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (edited, "'CMakeLists.txt' changed"),
        (renamed, "'new' was added, 'old' was removed"),
        (removed, "'old' was removed"),
        (emptied_install, "'install/plain/share/plain/package.bash' and "),
    ],
)
def test_reasons_are_stable_across_dry_runs(
    change: Callable[[Path], None], reason: str, forge: Forge, workspace: Path
) -> None:
    """A run that builds nothing, such as --dry-run, has read the files."""
    (workspace / "src/plain/old").write_text("text\n")
    assert forge("build", "--packages-select", "plain", cwd=workspace).code == 0
    change(workspace)
    for _ in range(3):
        assert reasons(forge, workspace, "--packages-select", "plain")["plain"].startswith(reason)


def test_changed_external_files_and_folders_are_named(forge: Forge, tree: Tree, tmp_path: Path) -> None:
    """A header, its folder, and a file of the workspace that belongs to no package."""
    system = tmp_path / "system"
    code = f"include_directories({system})\nadd_library(a a.cpp)\nfile(READ ../shared.txt text)\n"
    code += f"file(GLOB names {system}/names/*)\n"
    root = tree(
        {
            "system/x.h": "int x;\n",
            "system/names/old": "",
            **{f"ws/{name}": text for name, text in package("a", code, a_cpp="#include <x.h>\n").items()},
            "ws/src/shared.txt": "1",
        }
    )
    root /= "ws"
    assert forge("build", cwd=root).code == 0
    (system / "x.h").write_text("int x, y;\n")
    expected = f"the external input '{system}/x.h' changed"
    for _ in range(2):
        assert reasons(forge, root) == {"a": expected}
    assert announced(forge, root) == [f"{expected}; 1 package is rebuilt"]
    (system / "new.h").touch()
    assert reasons(forge, root) == {}, "nobody has looked for it"
    (system / "names/new").touch()
    expected = f"files were added to or removed from '{system}/names'"
    assert reasons(forge, root) == {"a": expected}
    assert announced(forge, root) == [f"{expected}; 1 package is rebuilt"]
    (root / "src/shared.txt").write_text("2")
    assert reasons(forge, root) == {"a": "'src/shared.txt' changed"}
    assert announced(forge, root) == [], "a source that was edited is no surprise"
    (system / "x.h").unlink()
    assert reasons(forge, root)["a"].startswith(f"the external input '{system}/x.h' was removed")


@pytest.mark.parametrize(
    ("part", "word", "text"),
    [
        (0, "9.9", "forge changed from version {0} to 9.9"),
        (1, "other", "forge itself changed"),
        (2, "3.99.1", "forge now runs in '{3}' with Python 3.99.1, not in '{3}' with Python {2}"),
        (3, "/other/forge", "forge now runs in '/other/forge' with Python {2}, not in '{3}' with Python {2}"),
    ],
)
def test_a_changed_forge_is_described_by_its_differences(
    part: int, word: str, text: str, forge: Forge, workspace: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its version, its code, or only the Python that runs it."""
    assert forge("build", "--packages-select", "plain", cwd=workspace).code == 0
    parts = preparation.forge_stamp().split("\n")
    expected = text.format(*parts)
    parts[part] = word
    monkeypatch.setattr(preparation, "forge_stamp", lambda: "\n".join(parts))
    assert reasons(forge, workspace, "--packages-select", "plain") == {"plain": expected}
    assert announced(forge, workspace, "--packages-select", "plain") == [f"{expected}; 1 package is rebuilt"]


def test_a_moved_workspace_is_announced_once(forge: Forge, workspace: Path, tmp_path: Path) -> None:
    assert forge("build", "--packages-select", "plain", "reader", cwd=workspace).code == 0
    root = tmp_path / "elsewhere"
    root.mkdir()
    for name in ("src", "build", "install"):
        (workspace / name).rename(root / name)
    (line,) = announced(forge, root, "--packages-select", "plain", "reader")
    assert line.startswith("the source folder changed from ")
    assert line.endswith("; 2 packages are rebuilt")


def test_a_file_overwritten_by_another_package_is_not_reported_as_changed(forge: Forge, tree: Tree) -> None:
    """In a merged prefix both are installed again, in order."""
    code = (
        'file(WRITE ${{CMAKE_BINARY_DIR}}/x "{0}")\ninstall(FILES ${{CMAKE_BINARY_DIR}}/x DESTINATION share)'
    )
    root = tree(
        {
            **package("one", code.format("one"), languages="NONE"),
            **package("two", code.format("two"), languages="NONE"),
        }
    )
    assert forge("build", "--merge-install", "--executor", "sequential", cwd=root).code == 0
    (root / "src/one/new").touch()
    assert reasons(forge, root, "--merge-install")["two"] == (
        "a package to be built overwrites one of its files"
    )


def test_the_selection_is_not_an_input(forge: Forge, tree: Tree) -> None:
    """A Python package alone and with one of CMake, which needs more tools."""
    root = tree(
        {
            **package("plain", "", languages="NONE"),
            "src/script/package.xml": manifest_text("script", build_type="ament_python"),
            "src/script/setup.py": "from setuptools import setup\nsetup(name='script', version='0.1.0')\n",
        }
    )
    assert forge("build", "--packages-select", "script", cwd=root).code == 0
    assert reasons(forge, root) == {"plain": "not built yet"}
    assert announced(forge, root) == []
    assert reasons(forge, root, "--packages-select", "script") == {}
