"""Resolving dependencies: embedded packages, missing packages and cycles."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import pytest

from forge.base.graph import order
from forge.workspace.manifest import parse_manifest
from forge.workspace.model import Export, Package
from forge.workspace.resolve import break_test_cycles, missing_problems, resolve_dependencies, similar_package
from tests.packages import manifest_text, package

if TYPE_CHECKING:
    from tests.conftest import Tree


def by_name(*packages: Package) -> dict[str, Package]:
    """Return a table of packages."""
    return {p.name: p for p in packages}


def embedded(name: str, *depends: str, family: str = "", answers: tuple[str, ...] = ()) -> Package:
    """Return a package that forge might bring along."""
    made = package(name, *depends)
    exports = [Export("forge_provides", (), other) for other in answers]
    if family:
        exports.append(Export("forge_family", (), family))
    return replace(made, embedded=True, manifest=replace(made.manifest, exports=tuple(exports)))


EMBEDDED = by_name(
    embedded("ament_cmake", family="ament", answers=("ament_cmake_core", "ament_cmake_auto")),
    embedded("rosidl_default_generators", "ament_cmake", family="rosidl", answers=("rosidl_cmake",)),
    embedded("std_msgs", "rosidl_cmake", "builtin_interfaces"),
    embedded("builtin_interfaces", "rosidl_cmake"),
    embedded("action_msgs", "builtin_interfaces"),
    embedded("unique_identifier_msgs"),
)


def nobody(_name: str) -> None:
    """Provide nothing."""


def test_what_is_needed_is_added_however_deep_and_nothing_else() -> None:
    made = resolve_dependencies(by_name(package("a", "std_msgs")), EMBEDDED, nobody)
    assert set(made.packages) == {
        "a",
        "std_msgs",
        "builtin_interfaces",
        "rosidl_default_generators",
        "ament_cmake",
    }
    assert made.needs["std_msgs"] == {"rosidl_default_generators", "builtin_interfaces"}


def test_an_alias_leads_to_the_package_that_answers_to_it() -> None:
    made = resolve_dependencies(
        by_name(package("a", "ament_cmake_auto", "ament_cmake_core")), EMBEDDED, nobody
    )
    assert made.needs["a"] == {"ament_cmake"}


def test_the_workspace_wins_over_the_embedded() -> None:
    made = resolve_dependencies(by_name(package("a", "std_msgs"), package("std_msgs")), EMBEDDED, nobody)
    assert not made.packages["std_msgs"].embedded
    assert set(made.packages) == {"a", "std_msgs"}


def test_an_underlay_wins_over_the_embedded() -> None:
    made = resolve_dependencies(
        by_name(package("a", "std_msgs", "action_msgs")), EMBEDDED, {"std_msgs": 1}.get
    )
    assert "std_msgs" not in made.packages
    assert "action_msgs" in made.packages


def test_a_family_is_used_whole_or_not_at_all() -> None:
    made = resolve_dependencies(
        by_name(package("a", "ament_cmake", "ament_cmake_auto", "std_msgs")), EMBEDDED, {"ament_cmake": 1}.get
    )
    assert "ament_cmake" not in made.packages
    assert "rosidl_default_generators" in made.packages
    assert made.needs["rosidl_default_generators"] == frozenset()
    assert made.missing == {"a": ("ament_cmake_auto",)}
    errors, _ = missing_problems(made, ["a"])
    assert errors[0].message.endswith(
        "the embedded packages cannot be used, because 'ament_cmake' comes from '1'"
    )


def test_an_incomplete_family_in_the_workspace_is_reported() -> None:
    half = package("ament_cmake_core", build_type="cmake")
    made = resolve_dependencies(by_name(package("a", "ament_cmake_auto"), half), EMBEDDED, nobody)
    errors, _ = missing_problems(made, ["a"])
    assert errors[0].message == (
        "'a' needs 'ament_cmake_auto', which is neither in the workspace nor in a sourced underlay; "
        "the embedded packages cannot be used, because 'ament_cmake_core' is in the workspace "
        "(src/ament_cmake_core)"
    )
    assert errors[0].hint is not None
    assert errors[0].hint.startswith("add 'ament_cmake_auto' from the same source")


def test_actions_need_what_their_manifest_leaves_unsaid() -> None:
    generating = replace(package("a", "rosidl_default_generators"), has_actions=True)
    made = resolve_dependencies(by_name(generating), EMBEDDED, nobody)
    unsaid = {"action_msgs", "builtin_interfaces", "unique_identifier_msgs"}
    assert made.needs["a"] == unsaid | {"rosidl_default_generators"}
    bringing = replace(package("a"), has_actions=True)
    assert not resolve_dependencies(by_name(bringing), EMBEDDED, nobody).needs["a"]


def test_a_missing_dependency_is_an_error_for_cmake_and_a_warning_for_python() -> None:
    workspace = by_name(
        package("a", "rclcpp", "libboost-dev"),
        package("b", "rclcpp", "boost"),
        package("p", "rclpy", build_type="ament_python"),
        package("t", "launch_testing", tag="test_depend"),
        package("x", "launch_ros", tag="exec_depend"),
    )
    errors, warnings = missing_problems(resolve_dependencies(workspace, EMBEDDED, nobody), workspace)
    assert len(errors) == 1
    assert errors[0].message.startswith("'a', 'b' need 'rclcpp', which is neither in the workspace nor")
    assert [warning.message.split(",")[0] for warning in warnings] == [
        "'x' needs 'launch_ros'",
        "'p' needs 'rclpy'",
    ]


def test_what_the_same_packages_lack_is_said_in_one_sentence() -> None:
    both = ("rclcpp", "rclcpp_action")
    workspace = by_name(package("a", *both), package("b", *both, "tf2"))
    errors, _ = missing_problems(resolve_dependencies(workspace, EMBEDDED, nobody), workspace)
    assert [error.message.rpartition(" neither")[0] for error in errors] == [
        "'a', 'b' need 'rclcpp', 'rclcpp_action', which are",
        "'b' needs 'tf2', which is",
    ]


def test_a_misspelt_dependency_has_its_line_and_a_suggestion(tree: Tree) -> None:
    text = manifest_text("a", "<!-- geomtry_msgs -->", "<depend>x</depend>", "<depend>geomtry_msgs</depend>")
    path = tree({"package.xml": text}) / "package.xml"
    workspace = {"a": Package(path.parent, parse_manifest(text.encode(), path, {}))}
    made = resolve_dependencies(workspace, EMBEDDED, nobody, lambda: ["geometry_msgs"])
    (error,), _ = missing_problems(made, workspace)
    assert error.location is not None
    assert error.location.line == 1 + text[: text.index("<depend>geom")].count("\n")
    assert error.location.source is not None
    assert "<depend>geomtry_msgs</depend>" in error.location.source
    hint = "did you mean 'geometry_msgs'? otherwise source an installation that contains it, or add its"
    assert str(error.hint).startswith(hint)


def test_misspelt_dependencies_are_compared_with_the_workspace_and_underlays() -> None:
    workspace = by_name(package("a", "my_interfces", "rclcppp", "rmw_x", "rmw_y"), package("my_interfaces"))
    made = resolve_dependencies(workspace, EMBEDDED, nobody, lambda: ["rclcpp"])
    errors, warnings = missing_problems(made, workspace)
    assert [(problem.message.split(",")[0], str(problem.hint)[:30]) for problem in (*errors, *warnings)] == [
        ("'a' needs 'rclcppp'", "did you mean 'rclcpp'? otherwi"),
        ("'a' needs 'rmw_x'", "source an installation that co"),
        ("'a' needs 'my_interfces'", "did you mean 'my_interfaces'? "),
    ]
    assert "contains them, or add their sources" in str(errors[1].hint)


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("my_mgs", "my_msgs"),
        ("geomtry_msgs", "geometry_msgs"),
        ("test_msgs", None),
        ("nmea_msgs", None),
        ("tf2_geometry_msgs", None),
        ("rclpy", None),
    ],
)
def test_other_packages_with_the_same_ending_are_not_misspelt(name: str, expected: str | None) -> None:
    known = ("my_msgs", "std_msgs", "nav_msgs", "geometry_msgs", "rclcpp")
    assert similar_package(name, known) == expected


def test_what_is_written_like_a_ros_package_is_warned_of_where_it_is_built_with() -> None:
    """Words with '_' between them are hardly ever a system package; but what is named may be optional."""
    workspace = by_name(
        package("a", "libodd_collector", "lib_x-dev", "spdlog"),
        package("x", "libodd_collector", tag="exec_depend"),
        package("p", "odd_python", build_type="ament_python"),
    )
    errors, warnings = missing_problems(resolve_dependencies(workspace, EMBEDDED, nobody), workspace)
    assert not errors
    assert [warning.message.split(",")[0] for warning in warnings] == ["'a' needs 'libodd_collector'"]


def test_a_package_of_a_group_takes_the_members_that_there_are() -> None:
    """Its manifest lists all of them as dependencies for tools that know no groups."""
    switch = package("switch", "rmw_one", "rmw_two")
    switch = replace(switch, manifest=replace(switch.manifest, group_dependencies=("rmw_packages",)))
    workspace = by_name(switch, package("rmw_one"))
    errors, warnings = missing_problems(resolve_dependencies(workspace, EMBEDDED, nobody), workspace)
    assert not errors
    assert [warning.message.split(",")[0] for warning in warnings] == ["'switch' needs 'rmw_two'"]


def test_superseded_embedded_packages_are_listed_for_removal() -> None:
    """A family as a whole, single packages by their name; the workspace's own is not meant."""
    own = by_name(package("a", "std_msgs"), package("unique_identifier_msgs"))
    assert resolve_dependencies(own, EMBEDDED, nobody).superseded == set()
    made = resolve_dependencies(
        own, EMBEDDED, {"ament_cmake_core": 1, "std_msgs": 1, "unique_identifier_msgs": 1}.get
    )
    assert made.superseded == {"ament_cmake", "std_msgs"}


def test_a_cycle_closed_by_test_dependencies_is_broken_with_a_warning() -> None:
    made = resolve_dependencies(
        by_name(
            package("a", "b", "z", tag="test_depend"), package("b", "a"), package("z"), package("y", "z")
        ),
        {},
        nobody,
    )
    opened, warnings = break_test_cycles(made)
    assert order(opened.needs) == ("y", "z", "a", "b") or order(opened.needs) == ("z", "a", "y", "b")
    assert opened.needs["a"] == {"z"}
    assert opened.postponed == {"a": {"b"}}
    assert [warning.message for warning in warnings] == [
        "test dependency of 'a' on 'b' closes a cycle and is ignored"
    ]


def test_a_cycle_of_other_dependencies_stays_an_error() -> None:
    strong = resolve_dependencies(by_name(package("a", "b"), package("b", "a")), {}, nobody)
    opened, warnings = break_test_cycles(strong)
    assert order(opened.needs) is None
    assert warnings == ()
    open_already = resolve_dependencies(
        by_name(package("a", "b", tag="test_depend"), package("b")), {}, nobody
    )
    assert break_test_cycles(open_already) == (open_already, ())
