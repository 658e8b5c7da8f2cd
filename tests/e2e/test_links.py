"""Going from copies to links and back: every build ends as a clean one with its options."""

import shutil
from pathlib import Path

import pytest

from tests.conftest import Forge, Tree
from tests.evolving import differences, look
from tests.packages import manifest_text

pytestmark = pytest.mark.needs("cmake", "ninja")

_HEAD = "cmake_minimum_required(VERSION 3.18)\nproject({name} NONE)\nfind_package(ament_cmake REQUIRED)\n"
EMBEDDED = f"""{_HEAD.format(name="own")}find_package(ament_cmake_python REQUIRED)
ament_python_install_package(own)
install(DIRECTORY launch DESTINATION share/own)
ament_package()
"""
# As ROS's own ament prepares a Python package: a link in the build folder, or a copy, under one name.
PREPARING = f"""{_HEAD.format(name="ros")}add_subdirectory(below)
install(DIRECTORY ros/ DESTINATION lib/python/ros)
ament_package()
"""
BELOW = """set(folder "${CMAKE_CURRENT_BINARY_DIR}/ament_cmake_python/ros")
file(MAKE_DIRECTORY "${folder}")
if(AMENT_CMAKE_SYMLINK_INSTALL)
  set(verb create_symlink)
else()
  set(verb copy_directory)
endif()
add_custom_target(prepare ALL COMMAND ${CMAKE_COMMAND} -E ${verb} "${PROJECT_SOURCE_DIR}/ros" "${folder}/ros")
"""
FILES = {
    "src/own/package.xml": manifest_text(
        "own",
        "<buildtool_depend>ament_cmake</buildtool_depend>",
        "<buildtool_depend>ament_cmake_python</buildtool_depend>",
    ),
    "src/own/CMakeLists.txt": EMBEDDED,
    "src/own/own/__init__.py": "x = 1\n",
    "src/own/own/deep/__init__.py": "",
    "src/own/launch/own.launch.py": "",
    "src/ros/package.xml": manifest_text("ros", "<buildtool_depend>ament_cmake</buildtool_depend>"),
    "src/ros/CMakeLists.txt": PREPARING,
    "src/ros/below/CMakeLists.txt": BELOW,
    "src/ros/ros/__init__.py": "x = 1\n",
}


def build(forge: Forge, root: Path, *options: str) -> dict[str, tuple[str, ...]]:
    """Build; return what is installed, without what Python compiles for itself."""
    ran = forge("build", *options, cwd=root)
    assert ran.code == 0, ran.out + ran.err
    return {name: what for name, what in look(root / "install").items() if "__pycache__" not in name}


def test_links_and_copies_replace_each_other(forge: Forge, tree: Tree) -> None:
    root = tree({f"ws/{name}": text for name, text in FILES.items()}) / "ws"
    found = [build(forge, root, *options) for options in ((), ("--symlink-install",), ())]
    for name in ("build", "install", "log"):
        shutil.rmtree(root / name)
    linked = build(forge, root, "--symlink-install")
    assert not differences(found[1], linked)
    assert not differences(found[0], found[2])
    assert differences(found[0], linked)
