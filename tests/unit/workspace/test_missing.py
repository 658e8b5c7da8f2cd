"""Missing ROS packages: errors and warnings."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path

import pytest

from forge.base.errors import Problem
from forge.base.layout import Layout
from forge.build.certain_failures import CMakeSearch
from forge.workspace.cmake_text import requirements, used_by_tests_only
from forge.workspace.manifest import parse_manifest
from forge.workspace.missing import MissingDependencies, missing_dependencies
from forge.workspace.model import Package
from forge.workspace.resolve import resolve_dependencies
from tests.conftest import Tree
from tests.packages import manifest_text, package


def requiring(tree: Tree, made: Package, *names: str) -> Package:
    """Return a package whose CMakeLists.txt requires `names`."""
    lines = "".join(f"find_package({name} REQUIRED)\n" for name in names)
    return replace(made, path=tree({f"{made.path}/CMakeLists.txt": lines}) / made.path)


def missing_in(
    *packages: Package, known: Iterable[str] = (), skip_keys: tuple[str, ...] = ()
) -> MissingDependencies:
    """Return the missing dependencies of a workspace without underlays."""
    workspace: Mapping[str, Package] = {each.name: each for each in packages}
    resolution = resolve_dependencies(workspace, {}, lambda _: None)
    resolution = replace(resolution, known=lambda: (*workspace, *known))
    search = CMakeSearch(resolution, Layout(Path("build"), Path("install"), None), {"PATH": "/nowhere"})
    return missing_dependencies(resolution, workspace, skip_keys, search.certainly_missing)


def beginnings(problems: Iterable[Problem]) -> list[str]:
    return [problem.message.split(",")[0] for problem in problems]


def test_missing_required_packages_are_errors_and_others_warnings(tree: Tree) -> None:
    missing = missing_in(
        requiring(tree, package("a", "rclcpp", "libboost-dev"), "rclcpp"),
        requiring(tree, package("b", "rclcpp", "boost"), "rclcpp", "boost"),
        requiring(tree, package("c", "rclcpp")),
        package("p", "rclpy", build_type="ament_python"),
        package("t", "launch_testing", tag="test_depend"),
        requiring(
            tree, package("u", "launch_testing_ament_cmake", tag="test_depend"), "launch_testing_ament_cmake"
        ),
        package("x", "launch_ros", tag="exec_depend"),
    )
    assert missing.errors[0].message.startswith(
        "'a', 'b' need 'rclcpp', which is neither in the workspace nor"
    )
    assert beginnings(missing.errors) == ["'a'"]
    assert beginnings(missing.warnings) == [
        "'x' needs 'launch_ros'",
        "'c' needs 'rclcpp'",
        "'p' needs 'rclpy'",
    ]
    assert missing.unbuildable == {"a", "b"}


def test_a_find_module_of_the_package_makes_a_requirement_uncertain(tree: Tree) -> None:
    made = requiring(tree, package("a", "tf2"), "tf2")
    assert missing_in(made).errors
    tree({"src/a/cmake/Findtf2.cmake": ""})
    assert not missing_in(made).errors


def test_skipped_keys_are_not_mentioned(tree: Tree) -> None:
    made = requiring(tree, package("a", "rclcpp", "tf2", "rmw"), "rclcpp", "tf2")
    missing = missing_in(made, skip_keys=("rclcpp", "rmw"))
    assert (beginnings(missing.errors), missing.warnings) == (["'a' needs 'tf2'"], ())
    assert missing_in(made, skip_keys=("rclcpp", "rmw", "tf2")) == MissingDependencies()


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("find_package(a REQUIRED)\nFIND_PACKAGE(b 1.2 REQUIRED COMPONENTS x)\nfind_package(c)", {"a", "b"}),
        ("# find_package(a REQUIRED)\nfind_package(b QUIET)", set()),
        ("if(WIN32)\nfind_package(a REQUIRED)\nelse()\nfind_package(b REQUIRED)\nendif()", set()),
        ("function(f)\nfind_package(a REQUIRED)\nendfunction()\nfind_package(b REQUIRED)", set()),
        ("macro(f)\nfind_package(a REQUIRED)\nreturn()\nendmacro()", set()),
        ("find_package(a QUIET)\nif(NOT a_FOUND)\nreturn()\nendif()\nfind_package(b REQUIRED)", set()),
        ("ament_target_dependencies(x PUBLIC a)\nrosidl_generate_interfaces(x y DEPENDENCIES b)", set()),
        ("#[[\nfind_package(a REQUIRED)\n]]\nfind_package(b REQUIRED)", {"b"}),
        ("#[==[ ]] find_package(a REQUIRED)\n]==] find_package(b REQUIRED)", {"b"}),
        ("message([[\nfind_package(a REQUIRED)]])\nfind_package(b REQUIRED)", {"b"}),
        ('message("\\"\nfind_package(a REQUIRED)\n")\nfind_package(b REQUIRED)', {"b"}),
        ('message("# ")\nfind_package(b REQUIRED)', {"b"}),
        ("foreach(x)\nfind_package(a REQUIRED)\nendforeach()\nfind_package(b REQUIRED)", {"b"}),
        ("while(0)\nfind_package(a REQUIRED)\nendwhile()\nfind_package(b REQUIRED)", {"b"}),
        ("if(x)\nset(y 1)\nendif()\nfind_package(b;REQUIRED)", {"b"}),
        ("message(find_package (a REQUIRED))\nfind_package(b REQUIRED)", {"b"}),
        ("project(x)\nset(CMAKE_CXX_STANDARD 17)\nfind_package(\n  b\n  REQUIRED # c\n)", {"b"}),
        ("include(x.cmake)\nfind_package(a REQUIRED)", set()),
        ("add_subdirectory(x)\nfind_package(a REQUIRED)", set()),
        ("list(APPEND CMAKE_PREFIX_PATH y)\nfind_package(a REQUIRED)", set()),
        ("set(CMAKE_MODULE_PATH y)\nfind_package(a REQUIRED)", set()),
        ("set(a_DIR y)\nfind_package(a REQUIRED)", set()),
        ("set(ENV{a_ROOT} y)\nfind_package(a REQUIRED)", set()),
        ("foreach(a_DIR y)\nendforeach()\nfind_package(a REQUIRED)", set()),
        ("set(${x} y)\nfind_package(a REQUIRED)", set()),
        ("set(CMAKE_PROJECT_x_INCLUDE y)\nproject(x)\nfind_package(a REQUIRED)", set()),
        ("macro(find_package)\nendmacro()\nfind_package(a REQUIRED)", set()),
        ("cmake_language(EVAL CODE x)\nfind_package(a REQUIRED)", set()),
        ("find_package(a REQUIRED PATHS /y)\nfind_package(b REQUIRED NAMES c)", set()),
        ("return()\nfind_package(a REQUIRED)", set()),
        ("find_package(a REQUIRED", set()),
        ("find_package(a REQUIRED)\n[[", {"a"}),
    ],
)
def test_only_unconditional_find_package_calls_are_errors(text: str, expected: set[str]) -> None:
    assert requirements(text) == expected


def test_packages_that_only_tests_use_are_recognized() -> None:
    text = "find_package(a)\nif(BUILD_TESTING)\nfind_package(a)\nfind_package(b REQUIRED)\nendif()"
    assert used_by_tests_only(text) == {"b"}


def test_dependencies_that_the_same_packages_lack_are_one_problem() -> None:
    both = ("rclcpp", "rclcpp_action")
    missing = missing_in(package("a", *both), package("b", *both, "tf2"))
    assert [warning.message.rpartition(" neither")[0] for warning in missing.warnings] == [
        "'a', 'b' need 'rclcpp', 'rclcpp_action', which are",
        "'b' needs 'tf2', which is",
    ]


def test_a_misspelt_dependency_has_its_line_and_a_suggestion(tree: Tree) -> None:
    text = manifest_text("a", "<!-- geomtry_msgs -->", "<depend>x</depend>", "<depend>geomtry_msgs</depend>")
    path = tree({"package.xml": text}) / "package.xml"
    made = Package(path.parent, parse_manifest(text.encode(), path, {}))
    (error,) = missing_in(made, known=["geometry_msgs"]).warnings
    assert error.location is not None
    assert error.location.line == 1 + text[: text.index("<depend>geom")].count("\n")
    assert error.location.source is not None
    assert "<depend>geomtry_msgs</depend>" in error.location.source
    hint = "did you mean 'geometry_msgs'? otherwise source an installation that contains it, or add its"
    assert str(error.hint).startswith(hint)


def test_misspelt_dependencies_are_compared_with_the_workspace_and_underlays() -> None:
    own = package("a", "my_interfces", "rclcppp", "rmw_x", "rmw_y")
    problems = missing_in(own, package("my_interfaces"), known=["rclcpp"]).warnings
    assert [(problem.message.split(",")[0], str(problem.hint)[:30]) for problem in problems] == [
        ("'a' needs 'my_interfces'", "did you mean 'my_interfaces'? "),
        ("'a' needs 'rclcppp'", "did you mean 'rclcpp'? otherwi"),
        ("'a' needs 'rmw_x'", "source an installation that co"),
    ]
    assert "contains them, or add their sources" in str(problems[2].hint)


def test_a_misspelt_dependency_of_a_python_package_is_a_warning() -> None:
    own = package("p", "geometry_msg", "odd_python", "geometry-msgs", build_type="ament_python")
    assert beginnings(missing_in(own, known=["geometry_msgs"]).warnings) == ["'p' needs 'geometry_msg'"]


def test_unresolved_build_dependencies_that_resemble_ros_packages_are_warnings() -> None:
    """System packages hardly ever have '_' in their names; such a dependency may still be optional."""
    missing = missing_in(
        package("a", "libodd_collector", "lib_x-dev", "spdlog"),
        package("x", "libodd_collector", tag="exec_depend"),
        package("p", "odd_python", build_type="ament_python"),
    )
    assert not missing.errors
    assert beginnings(missing.warnings) == ["'a' needs 'libodd_collector'"]


def test_a_group_dependency_uses_the_existing_members() -> None:
    switch = package("switch", "rmw_one", "rmw_two")
    switch = replace(switch, manifest=replace(switch.manifest, group_dependencies=("rmw_packages",)))
    missing = missing_in(switch, package("rmw_one"))
    assert not missing.errors
    assert beginnings(missing.warnings) == ["'switch' needs 'rmw_two'"]
