"""Missing ROS packages are warnings."""

from collections.abc import Iterable, Mapping
from dataclasses import replace

from forge.base.errors import Problem
from forge.plugins.failure_hints.missing import missing_dependencies
from forge.workspace.manifest import parse_manifest
from forge.workspace.model import Package
from forge.workspace.resolve import resolve_dependencies
from tests.conftest import Tree
from tests.packages import manifest_text, package


def missing_in(
    *packages: Package, known: Iterable[str] = (), skip_keys: tuple[str, ...] = ()
) -> tuple[Problem, ...]:
    """Return the missing dependencies of a workspace without underlays."""
    workspace: Mapping[str, Package] = {each.name: each for each in packages}
    resolution = resolve_dependencies(workspace, {}, lambda _: None)
    resolution = replace(resolution, known=lambda: (*workspace, *known))
    return missing_dependencies(resolution, workspace, skip_keys)


def beginnings(problems: Iterable[Problem]) -> list[str]:
    return [problem.message.split(",")[0] for problem in problems]


def test_missing_build_and_exec_dependencies_give_warnings() -> None:
    missing = missing_in(
        package("a", "rclcpp", "libboost-dev"),
        package("b", "rclcpp", "boost"),
        package("p", "rclpy", build_type="ament_python"),
        package("t", "launch_testing", tag="test_depend"),
        package("x", "launch_ros", tag="exec_depend"),
    )
    assert beginnings(missing) == ["'x' needs 'launch_ros'", "'a'", "'p' needs 'rclpy'"]
    assert missing[1].message.startswith("'a', 'b' need 'rclcpp', which is neither in the workspace nor")


def test_skipped_keys_are_not_mentioned() -> None:
    made = package("a", "rclcpp", "tf2", "rmw")
    assert beginnings(missing_in(made, skip_keys=("rclcpp", "rmw"))) == ["'a' needs 'tf2'"]
    assert missing_in(made, skip_keys=("rclcpp", "rmw", "tf2")) == ()


def test_dependencies_missing_from_the_same_packages_are_grouped() -> None:
    both = ("rclcpp", "rclcpp_action")
    missing = missing_in(package("a", *both), package("b", *both, "tf2"))
    assert [warning.message.rpartition(" neither")[0] for warning in missing] == [
        "'a', 'b' need 'rclcpp', 'rclcpp_action', which are",
        "'b' needs 'tf2', which is",
    ]


def test_a_misspelled_dependency_gets_a_line_and_a_suggestion(tree: Tree) -> None:
    text = manifest_text("a", "<!-- geomtry_msgs -->", "<depend>x</depend>", "<depend>geomtry_msgs</depend>")
    path = tree({"package.xml": text}) / "package.xml"
    made = Package(path.parent, parse_manifest(text.encode(), path, {}))
    (error,) = missing_in(made, known=["geometry_msgs"])
    assert error.location is not None
    assert error.location.line == 1 + text[: text.index("<depend>geom")].count("\n")
    assert error.location.source is not None
    assert "<depend>geomtry_msgs</depend>" in error.location.source
    hint = "did you mean 'geometry_msgs'? otherwise 'forge fetch' downloads it; or source an installation"
    assert str(error.hint).startswith(hint)


def test_misspelled_dependencies_are_compared_with_workspace_and_underlays() -> None:
    own = package("a", "my_interfces", "rclcppp", "rmw_x", "rmw_y")
    problems = missing_in(own, package("my_interfaces"), known=["rclcpp"])
    assert [(problem.message.split(",")[0], str(problem.hint)[:30]) for problem in problems] == [
        ("'a' needs 'my_interfces'", "did you mean 'my_interfaces'? "),
        ("'a' needs 'rclcppp'", "did you mean 'rclcpp'? otherwi"),
        ("'a' needs 'rmw_x'", "'forge fetch' downloads them; "),
    ]
    assert "or source an installation that contains them" in str(problems[2].hint)


def test_a_misspelled_dependency_of_a_python_package_gives_a_warning() -> None:
    own = package("p", "geometry_msg", "odd_python", "geometry-msgs", build_type="ament_python")
    assert beginnings(missing_in(own, known=["geometry_msgs"])) == ["'p' needs 'geometry_msg'"]


def test_unresolved_build_dependencies_like_ros_packages_give_warnings() -> None:
    """System packages hardly ever have '_' in their names; such a dependency may still be optional."""
    missing = missing_in(
        package("a", "libodd_collector", "lib_x-dev", "spdlog"),
        package("x", "libodd_collector", tag="exec_depend"),
        package("p", "odd_python", build_type="ament_python"),
    )
    assert beginnings(missing) == ["'a' needs 'libodd_collector'"]


def test_group_dependencies_use_the_existing_members() -> None:
    switch = package("switch", "rmw_one", "rmw_two")
    switch = replace(switch, manifest=replace(switch.manifest, group_dependencies=("rmw_packages",)))
    missing = missing_in(switch, package("rmw_one"))
    assert beginnings(missing) == ["'switch' needs 'rmw_two'"]


def test_an_embedded_package_that_cannot_be_used_is_reported_with_the_reason() -> None:
    resolution = resolve_dependencies({"a": package("a", "ament_cmake_auto")}, {}, lambda _: None)
    (warning,) = missing_dependencies(replace(resolution, withheld={"ament_cmake_auto": "of that"}), ["a"])
    assert warning.message == (
        "'a' needs 'ament_cmake_auto', which is neither in the workspace nor in a sourced underlay; "
        "the embedded packages cannot be used, because of that"
    )
    assert str(warning.hint).startswith("add 'ament_cmake_auto' from the same source")
