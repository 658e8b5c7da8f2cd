"""New packages build, and their tests pass."""

import shutil
import subprocess
import sys

import pytest

from forge.plugins.create.package import NewPackage, render_package
from forge.workspace.model import Person
from tests.conftest import Tree

ADA = Person("Ada", "ada@example.org")


def files_of(blueprint: NewPackage) -> dict[str, str]:
    return {path: text for path, text in render_package(blueprint).items() if text is not None}


@pytest.mark.parametrize("name", ["3d-scan", "union", "Walker", "walker"])
@pytest.mark.needs("g++")
def test_a_created_library_compiles_with_any_package_name(name: str, tree: Tree) -> None:
    blueprint = NewPackage(name, ADA, "cmake", node="walk", library="gait_planner")
    root = tree(files_of(blueprint))
    argv = ["g++", "-std=c++17", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-fsyntax-only", "-Iinclude"]
    subprocess.run([*argv, "src/gait_planner.cpp", "src/walk.cpp"], cwd=root, check=True)


@pytest.mark.needs("cmake", "g++", "make")
def test_a_created_cmake_package_builds_installs_and_is_found(tree: Tree) -> None:
    maker = NewPackage("walker", ADA, "cmake", node="walk", library="gait")
    user = "find_package(walker 0.0 REQUIRED)\nadd_executable(use use.cpp)\n"
    root = tree(
        {
            **{f"walker/{path}": text for path, text in files_of(maker).items()},
            "user/CMakeLists.txt": "cmake_minimum_required(VERSION 3.10)\nproject(user CXX)\n"
            f"{user}target_link_libraries(use ${{walker_LIBRARIES}})\n",
            "user/use.cpp": '#include "walker/gait.hpp"\nint main() { walker::Gait gait; }\n',
        }
    )
    for name in ("walker", "user"):
        configure = ["cmake", "-S", name, "-B", f"build/{name}", "-DCMAKE_INSTALL_PREFIX=install"]
        configure += [f"-DCMAKE_INSTALL_PREFIX={root}/install", f"-DCMAKE_PREFIX_PATH={root}/install"]
        made = subprocess.run(configure, cwd=root, check=True, capture_output=True, text=True)
        assert "Warning" not in made.stderr
        subprocess.run(["cmake", "--build", f"build/{name}", "--target", "all"], cwd=root, check=True)
        if name == "walker":
            subprocess.run(["cmake", "--build", f"build/{name}", "--target", "install"], cwd=root, check=True)
    ran = subprocess.run([root / "build/walker/walk"], check=True, capture_output=True, text=True)
    assert ran.stdout == "hello world walker package\n"


def test_tests_of_a_created_python_package_pass_without_ros(tree: Tree) -> None:
    root = tree(files_of(NewPackage("walker", ADA, "ament_python", node="walk")))
    shutil.copy(root / "walker/walk.py", root / "run_walk.py")
    argv = [
        sys.executable,
        "-m",
        "pytest",
        "-q",
        "-rs",
        "-W",
        "error",
        "-p",
        "no:cacheprovider",
        "--rootdir=.",
    ]
    ran = subprocess.run([*argv, "test"], cwd=root, check=False, capture_output=True, text=True)
    assert ran.stdout.count("comes with ROS") == 3, ran.stdout
    walked = subprocess.run(
        [sys.executable, "run_walk.py"], cwd=root, check=True, capture_output=True, text=True
    )
    assert walked.stdout == "Hi from walker.\n"
