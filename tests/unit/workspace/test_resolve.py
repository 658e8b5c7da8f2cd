"""Resolving dependencies: embedded packages, missing packages and cycles."""

from dataclasses import replace

import pytest

from forge.base.graph import order
from forge.workspace.model import Export, Package
from forge.workspace.resolve import break_test_cycles, resolve_dependencies, similar_package
from tests.packages import package


def by_name(*packages: Package) -> dict[str, Package]:
    return {p.name: p for p in packages}


def embedded(name: str, *depends: str, family: str = "", answers: tuple[str, ...] = ()) -> Package:
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
    embedded("service_msgs", "builtin_interfaces"),
)


def nobody(_name: str) -> None:
    """Provide nothing."""


def test_embedded_packages_are_added_recursively_as_needed() -> None:
    made = resolve_dependencies(by_name(package("a", "std_msgs")), EMBEDDED, nobody)
    assert set(made.packages) == {
        "a",
        "std_msgs",
        "builtin_interfaces",
        "rosidl_default_generators",
        "ament_cmake",
    }
    assert made.needs["std_msgs"] == {"rosidl_default_generators", "builtin_interfaces"}


def test_families_of_embedded_packages_are_used_completely_or_not_at_all() -> None:
    made = resolve_dependencies(
        by_name(package("a", "ament_cmake", "ament_cmake_auto", "std_msgs")), EMBEDDED, {"ament_cmake": 1}.get
    )
    assert "ament_cmake" not in made.packages
    assert "rosidl_default_generators" in made.packages
    assert made.needs["rosidl_default_generators"] == frozenset()
    assert made.missing == {"a": ("ament_cmake_auto",)}
    assert made.withheld["ament_cmake_auto"] == "'ament_cmake' comes from '1'"


def test_embedded_interfaces_work_with_generators_of_an_underlay() -> None:
    there = {"ament_cmake": 1, "rosidl_default_generators": 2, "rosidl_cmake": 2, "builtin_interfaces": 3}
    made = resolve_dependencies(
        by_name(package("a", "rosidl_default_generators", "std_msgs")),
        EMBEDDED,
        there.get,
        is_embedded=there.__contains__,
    )
    assert set(made.packages) == {"a", "std_msgs"}
    assert made.missing == {}


def test_an_incomplete_family_in_the_workspace_is_reported() -> None:
    half = package("ament_cmake_core", build_type="cmake")
    made = resolve_dependencies(by_name(package("a", "ament_cmake_auto"), half), EMBEDDED, nobody)
    assert made.missing == {"a": ("ament_cmake_auto",)}
    reason = "'ament_cmake_core' is in the workspace (src/ament_cmake_core)"
    assert made.withheld["ament_cmake_auto"] == reason


def test_actions_imply_dependencies_missing_in_the_manifest() -> None:
    generating = replace(package("a", "rosidl_default_generators"), has_actions=True)
    made = resolve_dependencies(by_name(generating), EMBEDDED, nobody)
    unsaid = {"action_msgs", "builtin_interfaces", "unique_identifier_msgs"}
    assert made.needs["a"] == unsaid | {"rosidl_default_generators"}
    bringing = replace(package("a"), has_actions=True)
    assert not resolve_dependencies(by_name(bringing), EMBEDDED, nobody).needs["a"]


@pytest.mark.parametrize("is_action", [True, False])
def test_service_events_imply_dependencies_missing_in_the_manifest(*, is_action: bool) -> None:
    made = package("a", "rosidl_default_generators")
    generating = by_name(replace(made, has_actions=is_action, has_services=not is_action))
    assert "service_msgs" in resolve_dependencies(generating, EMBEDDED, nobody, events=True).needs["a"]
    assert "service_msgs" not in resolve_dependencies(generating, EMBEDDED, nobody).packages
    plain = by_name(package("a", "rosidl_default_generators"))
    assert "service_msgs" not in resolve_dependencies(plain, EMBEDDED, nobody, events=True).packages


def test_generators_of_a_distribution_add_no_event_dependencies() -> None:
    generating = replace(package("a", "rosidl_default_generators"), has_services=True)
    installed = {"rosidl_default_generators": 1}
    made = resolve_dependencies(by_name(generating), EMBEDDED, installed.get, events=True)
    assert made.needs["a"] == frozenset()


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
def test_packages_with_the_same_suffix_are_not_suggested(name: str, expected: str | None) -> None:
    known = ("my_msgs", "std_msgs", "nav_msgs", "geometry_msgs", "rclcpp")
    assert similar_package(name, known) == expected


def test_superseded_embedded_packages_are_marked_for_removal() -> None:
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
