"""Beginners' mistakes: one clear message with its location and a hint, exit code 2, no traceback."""

import os
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path

import pytest

from tests.conftest import Forge, Ran, Tree
from tests.snippets import ROOT, surroundings

MANIFEST = """<?xml version="1.0"?>
<package format="3">
  <name>{name}</name>
  <version>1.0.0</version>
  <description>Package {name}</description>
  <maintainer email="someone@example.com">Someone</maintainer>
  <license>Apache-2.0</license>
  {depends}
  <export><build_type>{build_type}</build_type></export>
</package>
"""

CMAKELISTS = """cmake_minimum_required(VERSION 3.22)
project({name} {languages})
install(FILES package.xml DESTINATION share/{name})
"""

COMPILERS = ("c++", "g++", "gcc", "cc", "clang", "c89", "c99")


def manifest(name: str, *depends: str, build_type: str = "cmake") -> str:
    lines = "\n  ".join(f"<depend>{depend}</depend>" for depend in depends)
    return MANIFEST.format(name=name, depends=lines, build_type=build_type)


def cmakelists(name: str, languages: str = "NONE") -> str:
    """Return a CMakeLists.txt that installs one file."""
    return CMAKELISTS.format(name=name, languages=languages)


def one_message(ran: Ran, *parts: str) -> None:
    """Hold that the command ended with code 2 and one message with these parts, before anything was built."""
    assert ran.code == 2, ran
    assert "Traceback" not in ran.err
    assert "Starting >>>" not in ran.out
    assert ran.err.count("error: ") == 1, ran.err
    for part in parts:
        assert part in ran.err, ran.err


def test_a_malformed_manifest_is_shown_at_the_error(forge: Forge, tree: Tree) -> None:
    broken = manifest("a").replace("</version>", "</versoin>")
    ran = forge("build", cwd=tree({"src/a/package.xml": broken}))
    one_message(ran, "src/a/package.xml:4:", "error: ", "hint: <version> in line 4 is not closed")


def test_a_manifest_in_an_invalid_encoding_is_reported(forge: Forge, tree: Tree) -> None:
    root = tree({"src/a/package.xml": manifest("a")})
    path = root / "src/a/package.xml"
    path.write_bytes(path.read_bytes().replace(b"Someone", b"J\xfcrgen"))
    one_message(
        forge("build", cwd=root), "src/a/package.xml:6:", "hint: the file is not valid UTF-8: save it"
    )


def test_text_after_a_tag_is_ignored(forge: Forge, tree: Tree) -> None:
    """Tutorials mark the line to add like this, and readers copy the mark."""
    text = manifest("a", "b").replace("</depend>", "</depend> # add this line (添加这一行)")
    ran = forge("list", "--names-only", cwd=tree({"src/a/package.xml": text}))
    assert (ran.code, ran.out, ran.err) == (0, "a\n", "")


@pytest.mark.needs("cmake")
def test_an_unknown_type_in_a_build_is_shown_with_a_caret(forge: Forge, tree: Tree) -> None:
    """The same message reaches the user through CMake and the build."""
    text = manifest("robot", "rosidl_default_generators", build_type="ament_cmake")
    group = "<member_of_group>rosidl_interface_packages</member_of_group>\n  <export>"
    lists = """cmake_minimum_required(VERSION 3.22)
project(robot)
find_package(ament_cmake REQUIRED)
find_package(rosidl_default_generators REQUIRED)
rosidl_generate_interfaces(${PROJECT_NAME} "msg/Status.msg")
ament_package()
"""
    root = tree(
        {
            "src/robot/package.xml": text.replace("<export>", group),
            "src/robot/CMakeLists.txt": lists,
            "src/robot/msg/Status.msg": "uint32 ok\nuint23 status\n",
        }
    )
    ran = forge("build", cwd=root, env={"PYTHONPATH": str(ROOT)})  # CMake starts forge again
    assert ran.code == 2
    assert "Traceback" not in ran.err
    assert "Status.msg:2:1: error: " in ran.err
    assert "    uint23 status\n        ^\n" in ran.err
    assert "did you mean 'uint32'?" in ran.err


@pytest.mark.needs("cmake")
def test_a_missing_compiler_is_reported(tree: Tree) -> None:
    root = tree({"src/a/package.xml": manifest("a"), "src/a/CMakeLists.txt": cmakelists("a", "CXX")})
    one_message(_bare(root, without=COMPILERS), "'a' needs", "compiler", "hint: ")


def test_a_missing_cmake_names_the_extra(tree: Tree) -> None:
    root = tree({"src/a/package.xml": manifest("a"), "src/a/CMakeLists.txt": cmakelists("a", "CXX")})
    one_message(_bare(root, without=("cmake", "ninja")), "CMake not found", "install 'cmake>=")


def _bare(root: Path, without: tuple[str, ...]) -> Ran:
    """Run `forge build` as on a machine without some programs and their wheels."""
    programs = _linked(root / "programs", [Path("/usr/bin"), Path("/bin")], without)
    modules = _linked(root / "modules", [Path(sysconfig.get_path("purelib"))], without)
    python = root / "venv/bin/python"
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", root / "venv"], check=True)
    variables = {name: value for name, value in surroundings(root).items() if name not in {"CC", "CXX"}}
    variables |= {"PATH": str(programs), "PYTHONPATH": os.pathsep.join([str(ROOT), str(modules)])}
    ended = subprocess.run(
        [python, "-m", "forge", "build"], cwd=root, env=variables, capture_output=True, text=True, check=False
    )
    return Ran(ended.returncode, ended.stdout, ended.stderr)


def _linked(folder: Path, sources: list[Path], without: tuple[str, ...]) -> Path:
    """Link all that the source folders hold, except what begins with one of the names."""
    folder.mkdir()
    (folder / "COLCON_IGNORE").touch()
    for entry in (entry for source in sources for entry in source.iterdir()):
        if not entry.name.startswith(without) and not (folder / entry.name).is_symlink():
            (folder / entry.name).symlink_to(entry)
    shutil.rmtree(folder / "__pycache__", ignore_errors=True)
    return folder
