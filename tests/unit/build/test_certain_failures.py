"""A missing package stops a build only where CMake certainly fails without it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from forge.base.layout import Layout
from forge.build.certain_failures import CMakeSearch
from forge.workspace.model import Package
from forge.workspace.resolve import resolve_dependencies
from tests.conftest import Tree
from tests.packages import package

CERTAIN = "cmake_minimum_required(VERSION 3.16)\nproject(a)\nfind_package(rclcpp REQUIRED)\n"


def is_certain(
    root: Path,
    *others: Package,
    text: str = CERTAIN,
    build_type: str = "ament_cmake",
    cmake_args: tuple[str, ...] = (),
    settings: dict[str, object] | None = None,
    variables: dict[str, str] | None = None,
) -> bool:
    """Tell whether package 'a', which needs rclcpp and the others, certainly fails without rclcpp."""
    folder = root / "src/a"
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "CMakeLists.txt").write_text(text)
    made = package("a", "rclcpp", *(other.name for other in others), build_type=build_type)
    made = replace(made, path=folder, settings=settings or {})
    resolution = resolve_dependencies({each.name: each for each in (made, *others)}, {}, lambda _: None)
    layout = Layout(root / "build", root / "install", None)
    found = {"PATH": "/nowhere/bin", "HOME": str(root / "home"), **(variables or {})}
    return bool(CMakeSearch(resolution, layout, found, cmake_args).certainly_missing(made, ["rclcpp"]))


def test_a_package_that_nothing_can_provide_fails_for_certain(tmp_path: Path) -> None:
    assert is_certain(tmp_path)
    assert is_certain(tmp_path, cmake_args=("-DCMAKE_BUILD_TYPE=Release", "-GNinja", "-Wno-dev"))
    assert is_certain(tmp_path, text=CERTAIN.replace("find", "find_package(ament_cmake REQUIRED)\nfind", 1))
    assert not is_certain(tmp_path, build_type="meson")


@pytest.mark.parametrize(
    "options",
    [
        ("-Drclcpp_DIR=/x",),
        ("-D", "rclcpp_DIR=/x"),
        ("-Drclcpp_ROOT:PATH=/x",),
        ("-DCMAKE_PREFIX_PATH=/x",),
        ("-DCMAKE_MODULE_PATH=/x",),
        ("-DCMAKE_TOOLCHAIN_FILE=/x",),
        ("-DCMAKE_PROJECT_INCLUDE=/x",),
        ("-DCMAKE_PROJECT_a_INCLUDE_BEFORE=/x",),
        ("-DCMAKE_PROJECT_TOP_LEVEL_INCLUDES=/x",),
        ("-DCMAKE_FIND_ROOT_PATH=/x",),
        ("-C", "x.cmake"),
        ("--toolchain", "x"),
        ("--preset=x",),
    ],
)
def test_cmake_options_may_provide_the_package(tmp_path: Path, options: tuple[str, ...]) -> None:
    assert not is_certain(tmp_path, cmake_args=options)
    assert not is_certain(tmp_path, settings={"cmake-args": list(options)})


@pytest.mark.parametrize("name", ["rclcpp_DIR", "rclcpp_ROOT", "RCLCPP_ROOT", "CMAKE_TOOLCHAIN_FILE"])
def test_environment_variables_may_provide_the_package(tmp_path: Path, name: str) -> None:
    assert not is_certain(tmp_path, variables={name: "/x"})


@pytest.mark.parametrize(
    ("file", "variables"),
    [
        ("x/lib/rclcpp-2/cmake/rclcppConfig.cmake", {"CMAKE_PREFIX_PATH": "x"}),
        ("x/rclcpp-config.cmake", {"CMAKE_PREFIX_PATH": "x"}),
        ("x/lib/cmake/rclcpp/rclcppConfig.cmake", {"PATH": "x/bin"}),
        ("home/.cmake/packages/rclcpp/1", {}),
        ("src/a/cmake/Findrclcpp.cmake", {}),
    ],
)
def test_files_may_provide_the_package(tree: Tree, file: str, variables: dict[str, str]) -> None:
    root = tree({file: ""})
    placed = {name: value.replace("x", str(root / "x"), 1) for name, value in variables.items()}
    assert not is_certain(root, variables=placed)


def test_an_earlier_build_found_the_package(tree: Tree) -> None:
    root = tree({"build/a/CMakeCache.txt": "rclcpp_DIR:PATH=/x\n"})
    assert not is_certain(root)
    tree({"build/a/CMakeCache.txt": "rclcpp_DIR:PATH=rclcpp_DIR-NOTFOUND\n"})
    assert is_certain(root)


def test_a_package_of_the_workspace_may_provide_the_package(tree: Tree) -> None:
    other, interfaces = package("b"), package("b")
    groups = replace(interfaces.manifest, groups=("rosidl_interface_packages",))
    root = tree({"src/b/CMakeLists.txt": "rosidl_generate_interfaces(b msg/X.msg)\n"})
    interfaces = replace(interfaces, path=root / "src/b", manifest=groups)
    assert not is_certain(root, replace(other, path=root / "src/b"))
    assert is_certain(root, interfaces)
    assert is_certain(root, package("p", build_type="ament_python"))
    tree({"src/b/CMakeLists.txt": "install(FILES rclcppConfig.cmake DESTINATION share/rclcpp/cmake)\n"})
    assert not is_certain(root, interfaces)


def test_an_earlier_find_package_may_provide_the_package(tmp_path: Path) -> None:
    text = CERTAIN.replace("find", "find_package(other)\nfind", 1)
    assert not is_certain(tmp_path, text=text)
