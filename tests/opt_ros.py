"""A ROS as its binary packages install it: one prefix with the setup scripts of ros_workspace.

It consists of Debian's ament and rosidl, which `make debian-peers` unpacks. Debian has them in /usr; here
they are where they are in /opt/ros/humble on Ubuntu 22.04: modules of ament_python packages in
lib/python3.X/site-packages, those of ament_cmake packages in local/lib/python3.X/dist-packages.
ament_cmake_core itself generates the setup scripts.
"""

import os
import shutil
import site
import subprocess
import sys
import venv
from pathlib import Path

from tests.rosidl import DEBIAN, MODULES, underlay

RELEASE = "{}.{}".format(*sys.version_info[:2])
SITE = f"lib/python{RELEASE}/site-packages"
DIST = f"local/lib/python{RELEASE}/dist-packages"

_OF_CMAKE_PACKAGES = (
    "rosidl_adapter",
    "rosidl_cmake",
    "rosidl_generator_",
    "rosidl_parser",
    "rosidl_typesupport_",
)
_MANIFEST = """<package format="3">
  <name>ros_workspace</name>
  <version>1.0.3</version>
  <description>Setup scripts</description>
  <maintainer email="tests@example.com">The tests</maintainer>
  <license>Apache-2.0</license>
</package>
"""
_CMAKE = """cmake_minimum_required(VERSION 3.10)
project(ros_workspace NONE)
find_package(ament_cmake_core REQUIRED)
function(add_to variable folder)
  string(MAKE_C_IDENTIFIER "${variable}_${folder}" name)
  file(WRITE "${CMAKE_BINARY_DIR}/${name}.sh"
    "ament_prepend_unique_value ${variable} \\"$AMENT_CURRENT_PREFIX/${folder}\\"\\n")
  set(hooks ${hooks} "${CMAKE_BINARY_DIR}/${name}.sh" PARENT_SCOPE)
  set(AMENT_CMAKE_ENVIRONMENT_HOOKS_DESC_${name} "prepend-non-duplicate;${variable};${folder}" PARENT_SCOPE)
endfunction()
foreach(folder IN LISTS LIBRARIES)
  add_to(LD_LIBRARY_PATH ${folder})
endforeach()
foreach(folder IN LISTS MODULES)
  add_to(PYTHONPATH ${folder})
endforeach()
file(WRITE "${CMAKE_BINARY_DIR}/ros_distro.sh" "export ROS_DISTRO=humble\\n")
set(AMENT_CMAKE_ENVIRONMENT_HOOKS_DESC_ros_distro "set;ROS_DISTRO;humble")
ament_environment_hooks(${hooks} "${CMAKE_BINARY_DIR}/ros_distro.sh")
set(SKIP_PARENT_PREFIX_PATH TRUE)
ament_package()
ament_generate_environment()
"""


def install(prefix: Path, scratch: Path) -> Path:
    """Fill the prefix and make it read-only; return its interpreter, which is not that of forge.

    It is a virtual environment below `scratch` with the modules that Ubuntu's python3 has from packages.
    """
    python = _make_python(scratch / "python")
    for folder in ("include", "libexec", "share"):
        shutil.copytree(DEBIAN / folder, prefix / folder, symlinks=True)
    multiarch = next(path.name for path in (DEBIAN / "lib").glob("*-linux-gnu*"))
    shutil.copytree(DEBIAN / "lib" / multiarch, prefix / "lib" / multiarch, symlinks=True)
    for script in prefix.rglob("*.cmake"):
        text = script.read_text(encoding="utf-8")
        script.write_text(text.replace("lib/python3/dist-packages", DIST), encoding="utf-8")
    for path in MODULES.iterdir():
        target = prefix / (DIST if path.name.startswith(_OF_CMAKE_PACKAGES) else SITE) / path.name
        if path.is_dir():
            shutil.copytree(path, target, ignore=shutil.ignore_patterns("__pycache__"))
        elif path.is_file():
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(path, target)
    program = prefix / "bin/rosidl"
    program.parent.mkdir()
    program.write_text(f"#!{python}\nfrom rosidl_cli.cli import main\nmain()\n", encoding="utf-8")
    program.chmod(0o755)
    _install_scripts(prefix, scratch / "ros_workspace", python, f"lib/{multiarch}")
    for folder, _, names in os.walk(prefix):
        for entry in (folder, *(os.path.join(folder, name) for name in names)):  # noqa: PTH118
            if not os.path.islink(entry):  # noqa: PTH114
                os.chmod(entry, os.stat(entry).st_mode & ~0o222)  # noqa: PTH101, PTH116
    return python


def _make_python(folder: Path) -> Path:
    venv.create(folder, symlinks=True)
    (folder / SITE / "of_the_system.pth").write_text(site.getsitepackages()[0] + "\n", encoding="utf-8")
    return folder / "bin/python3"


def _install_scripts(prefix: Path, folder: Path, python: Path, libraries: str) -> None:
    """Build ros_workspace, whose package is not part of Debian."""
    folder.mkdir()
    (folder / "package.xml").write_text(_MANIFEST, encoding="utf-8")
    (folder / "CMakeLists.txt").write_text(_CMAKE, encoding="utf-8")
    options = {
        "CMAKE_INSTALL_PREFIX": str(prefix),
        "LIBRARIES": f"lib;{libraries}",
        "MODULES": f"{DIST};{SITE}",
        "Python3_EXECUTABLE": str(python),
    }
    build = [
        "cmake",
        "-S",
        str(folder),
        "-B",
        str(folder / "build"),
        *(f"-D{k}={v}" for k, v in options.items()),
    ]
    for argv in (build, ["cmake", "--install", str(folder / "build")]):
        subprocess.run(argv, env={**os.environ, **underlay()}, capture_output=True, check=True)
