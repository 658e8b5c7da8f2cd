"""Typical mistakes in packages: each failure of the real tools ends with a helpful hint."""

import subprocess

import pytest

from tests.conftest import Forge, Tree
from tests.packages import manifest_text
from tests.snippets import ROOT

pytestmark = pytest.mark.needs("cmake", "g++")

PLAIN = """cmake_minimum_required(VERSION 3.18)
project({name} {languages})
{lines}
"""
MAIN = "add_executable(main main.cpp)"
LIBRARY = {
    "src/shapes/package.xml": manifest_text("shapes", build_type="cmake"),
    "src/shapes/CMakeLists.txt": PLAIN.format(
        name="shapes", languages="NONE", lines="install(DIRECTORY include DESTINATION .)"
    ),
    "src/shapes/include/shapes/circle.hpp": "#pragma once\n",
}


def broken(
    lines: str, *depends: str, languages: str = "NONE", main: str = "", build_type: str = "cmake"
) -> dict[str, str]:
    """Return a workspace with a package that cannot be built, and a good one."""
    needed = (f"<depend>{depend}</depend>" for depend in depends)
    return {
        **LIBRARY,
        "src/broken/package.xml": manifest_text("broken", *needed, build_type=build_type),
        "src/broken/CMakeLists.txt": PLAIN.format(name="broken", languages=languages, lines=lines),
        "src/broken/main.cpp": f"{main}\nint main() {{}}\n",
    }


CASES = {
    "a package of the workspace that the manifest does not name": (
        broken("find_package(shapes REQUIRED)"),
        "dependency on 'shapes' is not declared: add <depend>shapes</depend> to src/broken/",
    ),
    "a package of ROS": (
        broken("find_package(rclcpp REQUIRED)"),
        "'forge add rclcpp' and 'forge fetch' download it; or source a ROS installation",
    ),
    "a package that only tests need": (
        broken(
            "include(CTest)\nif(BUILD_TESTING)\nfind_package(launch_testing REQUIRED)\nendif()",
            languages="CXX",
        ),
        "only tests need 'launch_testing': build without them (--cmake-args -DBUILD_TESTING=OFF), or",
    ),
    "a package of the system": (
        broken("find_package(Qt7Widgets REQUIRED)"),
        "install the system package that contains Qt7WidgetsConfig.cmake (Debian: apt-file search",
    ),
    "a command of ament": (
        broken("ament_target_dependencies(x y)"),
        "add find_package(ament_cmake REQUIRED) before it in CMakeLists.txt",
    ),
    "a command of rosidl": (
        broken("rosidl_generate_interfaces(broken)"),
        "add find_package(rosidl_default_generators REQUIRED) before it in CMakeLists.txt",
    ),
    "a target that nobody looked for": (
        broken(f"{MAIN}\ntarget_link_libraries(main shapes::shapes)", languages="CXX"),
        "add find_package(shapes REQUIRED) before its use in CMakeLists.txt and <depend>shapes",
    ),
    "a header of another package": (
        broken(MAIN, languages="CXX", main='#include "shapes/circle.hpp"'),
        "'shapes/circle.hpp' belongs to the package 'shapes'; add <depend>shapes</depend> in "
        "src/broken/package.xml, find_package(shapes REQUIRED) and ament_target_dependencies(",
    ),
    "a header of an interface that forge brings along": (
        broken(MAIN, languages="CXX", main='#include "std_msgs/msg/string.hpp"'),
        "'std_msgs/msg/string.hpp' belongs to the package 'std_msgs'; add",
    ),
    "a header of its own": (
        broken(MAIN, languages="CXX", main='#include "broken/own.hpp"'),
        "for a header of this package: target_include_directories(YOUR_TARGET PRIVATE include)",
    ),
    "a header of another package that is spelled otherwise": (
        broken(MAIN, "shapes", languages="CXX", main='#include "shapes/cirlce.hpp"'),
        "did you mean 'shapes/circle.hpp'?",
    ),
    "a command that is spelled otherwise": (
        broken("find_package(ament_cmake REQUIRED)\nament_packag()", "ament_cmake"),
        "did you mean 'ament_package'?",
    ),
    "a header of the system": (
        broken(MAIN, languages="CXX", main="#include <zxing/qr.h>"),
        "install the system package that contains it (Debian: apt-file search zxing/qr.h)",
    ),
    "a module of Python": (
        broken(
            "find_program(python python3)\n"
            'execute_process(COMMAND ${python} -c "import em_is_not_here" COMMAND_ERROR_IS_FATAL ANY)'
        ),
        "-m pip install em_is_not_here",
    ),
    "a target in install() that is spelled otherwise": (
        broken(f"{MAIN}\ninstall(TARGETS mian DESTINATION lib/broken)", languages="CXX"),
        "did you mean 'main'?",
    ),
    "a source file that is spelled otherwise": (
        broken("add_executable(main mian.cpp)", languages="CXX"),
        "did you mean 'main.cpp'?",
    ),
    "a folder to install that is not there": (
        broken("install(DIRECTORY launch DESTINATION share/broken)"),
        "the package has no 'launch': create it, or remove the reference to it",
    ),
    "a source file that is not linked": (
        broken(MAIN, languages="CXX", main="int go(int);\nint here = go(1);"),
        "no linked object defines 'go(int)': add its source file to add_executable()",
    ),
}
"""Workspaces whose package 'broken' fails, with the hint."""


def test_a_failure_ends_with_a_hint(forge: Forge, tree: Tree) -> None:
    """One build of all cases, in each of which the package has a name of its own."""
    files: dict[str, str] = {}
    for number, (case, _) in enumerate(CASES.values()):
        files |= {
            path.replace("broken", f"broken_{number}"): text.replace("broken", f"broken_{number}")
            for path, text in case.items()
        }
    ran = forge("build", "--continue-on-error", cwd=tree(files))
    assert ran.code == 1
    parts = [part.partition("--- ")[0] for part in ran.err.split("Failed   <<< ")[1:]]
    failures = {part.partition(" ")[0]: part for part in parts}
    for number, (name, (_, hint)) in enumerate(CASES.items()):
        failure = failures[f"broken_{number}"]
        assert "Traceback (most" not in failure
        hints = [line for line in failure.splitlines() if line.startswith("  hint: ")]
        assert len(hints) == 1, (name, failure)
        assert hint.replace("broken", f"broken_{number}") in hints[0], name


def test_a_missing_package_stops_only_its_dependents(forge: Forge, tree: Tree) -> None:
    """A manifest may name a package that CMake never looks for; dependents of what fails are left out."""
    files = {
        f"src/{name}/{file}": text
        for name, depend, lines in (
            ("node", "rclcpp", "find_package(rclcpp REQUIRED)"),
            ("robot", "node", ""),
            ("tools", "rclcpp", ""),
        )
        for file, text in (
            ("package.xml", manifest_text(name, f"<depend>{depend}</depend>", build_type="cmake")),
            ("CMakeLists.txt", PLAIN.format(name=name, languages="NONE", lines=f'{lines}\ninstall(CODE "")')),
        )
    }
    root = tree(files)
    ran = forge("build", "--continue-on-error", cwd=root)
    assert (ran.code, sorted(path.name for path in root.glob("install/[a-z]*/"))) == (1, ["tools"]), ran.err
    assert "warning: 'node', 'tools' need 'rclcpp', which is neither in" in ran.err
    assert "hint: 'forge fetch' downloads it; or source an installation that contains it" in ran.err
    tried = forge("build", "--skip-keys", "rclcpp tf2", "--skip-keys", "rmw", cwd=root)
    assert tried.code == 1
    assert (
        "hint: 'forge fetch' downloads it; or source a ROS installation that contains 'rclcpp'" in tried.err
    )
    assert "which is neither in" not in tried.err


def test_a_missing_cmakelists_is_reported(forge: Forge, tree: Tree) -> None:
    """The manifest says CMake, the folder says Python: one of them was forgotten."""
    files = {"src/broken/package.xml": manifest_text("broken", build_type="cmake")}
    ran = forge("build", cwd=tree(files))
    assert "  hint: the package has no CMakeLists.txt: 'forge pkg create' creates" in ran.err
    ran = forge("build", cwd=tree({"src/broken/setup.py": ""}))
    assert (
        "  hint: the package has a setup.py: add <build_type>ament_python</build_type> to src/broken/"
        in ran.err
    )


def test_an_in_source_cmake_run_is_reported(forge: Forge, tree: Tree) -> None:
    """What it left there makes no difference: CMake would take the folder for the one to build in."""
    root = tree(broken(""))
    subprocess.run(
        ["cmake", "-G", "Unix Makefiles", "."], cwd=root / "src/broken", check=True, capture_output=True
    )
    ran = forge("build", cwd=root)
    assert ran.code == 0, ran.err


INTERFACES = """find_package(ament_cmake REQUIRED)
find_package(rosidl_default_generators REQUIRED)
rosidl_generate_interfaces(${PROJECT_NAME} "msg/Listed.msg")
ament_package()"""


def test_a_message_not_listed_in_cmakelists_gets_a_hint(forge: Forge, tree: Tree) -> None:
    """Users of the message get a hint where to add it; its package gets a warning."""
    lines = (
        "<buildtool_depend>rosidl_default_generators</buildtool_depend>",
        "<member_of_group>rosidl_interface_packages</member_of_group>",
    )
    root = tree(
        {
            "src/own/package.xml": manifest_text("own", *lines),
            "src/own/CMakeLists.txt": PLAIN.format(name="own", languages="NONE", lines=INTERFACES),
            "src/own/msg/Listed.msg": "Forgotten part\n",
            "src/own/msg/Forgotten.msg": "uint8 x\n",
        }
    )
    ran = forge("build", cwd=root, env={"PYTHONPATH": str(ROOT)})  # CMake starts forge again
    assert ran.code == 2
    said = " ".join(ran.err.split())
    assert "'msg/Forgotten.msg' is in the package and not in rosidl_generate_interfaces()" in said
    assert "Listed.msg:1:1: error: unknown type 'own/Forgotten'\n" in ran.err
    assert 'hint: add "msg/Forgotten.msg" to rosidl_generate_interfaces() in CMakeLists.txt\n' in ran.err


def test_a_definition_without_its_d_prefix_gets_a_hint(forge: Forge, tree: Tree) -> None:
    """CMake would warn of a path, once for each package."""
    ran = forge("build", "--cmake-args", "CMAKE_BUILD_TYPE=Debug", "-D", "A=1", cwd=tree(LIBRARY))
    assert ran.err.startswith(
        "warning: --cmake-args contains 'CMAKE_BUILD_TYPE=Debug', which CMake treats as a path\n"
        "hint: write -DCMAKE_BUILD_TYPE=Debug\n"
    )
    assert ran.err.count("hint: write") == 1


def test_a_definition_without_its_dash_gets_a_hint(forge: Forge, tree: Tree) -> None:
    """The D belongs to the option, unless the rest is no variable that CMake knows."""
    words = ("DCMAKE_BUILD_TYPE=Debug", "DBUILD_TESTING:BOOL=OFF", "DEPTH=1")
    ran = forge("build", "--cmake-args", *words, cwd=tree(LIBRARY))
    for word in ("-DCMAKE_BUILD_TYPE=Debug", "-DBUILD_TESTING:BOOL=OFF", "-DDEPTH=1"):
        assert f"hint: write {word}\n" in ran.err
