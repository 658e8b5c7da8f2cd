"""Resolves dependencies to packages of the workspace, underlays, the system and embedded packages.

A name is searched in the workspace, then in underlays and the system, then among the embedded packages. These
form families (ament, lint, rosidl) that are used completely or not at all, so that two implementations of an
API are never mixed in one build.
"""

from __future__ import annotations

import operator
import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import field, replace

from forge.base.errors import Location, Problem
from forge.base.frozen import frozen
from forge.base.graph import order, weak_edges_on_cycles
from forge.base.names import nearest
from forge.base.text import quoted_names
from forge.workspace.model import BUILD_KINDS, RUN_KINDS, TEST_KINDS, Package

GENERATORS = "rosidl_default_generators"
"""The package that generates the code of interface packages."""

FAMILY_MARKERS = {
    "ament": ("ament_cmake", "ament_cmake_core"),
    "lint": ("ament_lint_auto",),
    "rosidl": (GENERATORS, "rosidl_cmake"),
}
"""If one of these exists in the workspace, an underlay or the system, its family is not used."""

ACTION_NEEDS = ("action_msgs", "builtin_interfaces", "unique_identifier_msgs")
"""Packages that generated code of actions refers to, and that manifests often omit."""

EVENT_NEEDS = ("service_msgs", "builtin_interfaces")
"""Packages that the events of services refer to, in the ROS distributions that have events."""

INTERFACE_GROUP = "rosidl_interface_packages"

_GENERATORS = frozenset({GENERATORS, INTERFACE_GROUP})
"""Dependencies or groups of packages that generate code; others may just contain .action files."""

ALL_KINDS = BUILD_KINDS | RUN_KINDS | TEST_KINDS

# Patterns of ROS package names: these contain no '-', and rosdep keys of system packages rarely begin or end
# like this.
_ROS_BEGINNINGS = ("rcl", "rmw", "tf2", "launch", "ros2", "rosbag2", "nav2_", "moveit_", "ament_", "rosidl_")
_ROS_ENDINGS = ("_msgs", "_interfaces", "_srvs", "_actions")
_ROS_NAMES = frozenset(
    {"class_loader", "cv_bridge", "demo_nodes_cpp", "demo_nodes_py", "image_transport", "message_filters"}
    | {"pluginlib", "robot_state_publisher", "rqt", "rviz2", "turtlesim", "urdf", "xacro"}
)

_VERSION = re.compile(r"\d{1,18}(\.\d{1,18})*", re.ASCII)
_COMPARISONS: Mapping[str, tuple[str, Callable[[list[int], list[int]], bool]]] = {
    "lt": ("before {}", operator.lt),
    "lte": ("{} or before", operator.le),
    "eq": ("{}", operator.eq),
    "neq": ("other than {}", operator.ne),
    "gte": ("{} or later", operator.ge),
    "gt": ("later than {}", operator.gt),
}

_SIMILAR = 0.82
"""Required similarity of names; 'geometry' and 'tf2_geometry' have 0.8."""


@frozen
class DependencyResolution:
    """The packages of a build, including embedded ones, and the dependencies among them.

    `needs` has an edge for every dependency of any type on one of `packages`. `missing` maps a package to
    unresolved dependencies that look like ROS packages. `superseded` are embedded packages that must not be
    installed, because another package provides their names. `postponed` are test dependencies left out of
    `needs` to avoid cycles. `withheld` maps names of embedded packages whose family is not used to the
    reason, `elsewhere` missing packages to a hint on the ROS distributions that have them. `ignored` are
    packages of the workspace that options ignore. `known` returns the names of all packages that a dependency
    can be resolved to, for suggestions.
    """

    packages: Mapping[str, Package]
    needs: Mapping[str, frozenset[str]]
    missing: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    superseded: frozenset[str] = frozenset()
    postponed: Mapping[str, frozenset[str]] = field(default_factory=dict)
    withheld: Mapping[str, str] = field(default_factory=dict)
    elsewhere: Mapping[str, str] = field(default_factory=dict)
    ignored: frozenset[str] = frozenset()
    known: Callable[[], Iterable[str]] = tuple


def resolve_dependencies(
    workspace: Mapping[str, Package],
    embedded: Mapping[str, Package],
    provider: Callable[[str], object | None],
    *,
    is_embedded: Callable[[str], bool] = lambda _: False,
    events: bool = False,
    untested: Collection[str] = (),
) -> DependencyResolution:
    """Return the workspace's packages with the embedded ones that they depend on, recursively.

    `provider(name)` returns the prefix in which an underlay or the system has a package, else None;
    `is_embedded(name)` returns whether it is an embedded package that forge installed there. With `events`,
    the embedded generators generate the events of services. Dependencies that only the tests of `untested`
    need do not count.
    """
    # The families that other sources provide. An underlay that was built without ROS contains the embedded
    # generators, but only the interfaces that it needs.
    reasons: dict[str, str] = {}
    ours = provider(GENERATORS) if is_embedded(GENERATORS) else None
    for family, marks in FAMILY_MARKERS.items():
        for mark in marks:
            if mark in workspace:
                reasons[family] = f"'{mark}' is in the workspace ({workspace[mark].path})"
            elif (prefix := provider(mark)) and not (family == "rosidl" and prefix == ours):
                reasons[family] = f"'{mark}' comes from '{prefix}'"
    answers: dict[str, Package] = {}
    withheld: dict[str, str] = {}
    for package in embedded.values():
        families = (e.content for e in package.manifest.exports if e.tag == "forge_family")
        reason = next((reasons[family] for family in families if family in reasons), None)
        for name in _names_of(package):
            if reason is None:
                answers[name] = package
            else:
                withheld[name] = reason
    events = events and GENERATORS in answers
    packages = dict(workspace)
    needs: dict[str, frozenset[str]] = {}
    missing: dict[str, tuple[str, ...]] = {}
    waiting = list(workspace)
    while waiting:
        name = waiting.pop()
        if name in needs:
            continue
        wanted = _wanted(packages[name], events=events)
        if name in untested:
            only_tested = packages[name].only_tested_with
            wanted = tuple(other for other in wanted if other not in only_tested)
        dependencies, unmet = [], []
        for other in wanted:
            if other in workspace:
                dependencies.append(workspace[other])
            elif not provider(other):
                if other in answers:
                    dependencies.append(answers[other])
                elif resembles_ros_name(other):
                    unmet.append(other)
        needs[name] = frozenset(other.name for other in dependencies) - {name}
        if unmet:
            missing[name] = tuple(unmet)
        for package in dependencies:
            if package.name not in packages:
                packages[package.name] = package
                waiting.append(package.name)
    used = {package.name for package in answers.values()}
    superseded = (name for name in embedded if name not in used or provider(name))
    return DependencyResolution(
        packages,
        needs,
        missing,
        frozenset(superseded) - workspace.keys(),
        withheld=withheld,
        known=lambda: (*workspace, *answers),
    )


def break_test_cycles(resolution: DependencyResolution) -> tuple[DependencyResolution, tuple[Problem, ...]]:
    """Return the resolution with test dependencies that close a cycle postponed, and warnings."""
    if order(resolution.needs) is not None:
        return resolution, ()
    weak = {name: package.only_tested_with for name, package in resolution.packages.items()}
    dropped = weak_edges_on_cycles(resolution.needs, weak)
    needs = {name: wanted - dropped.get(name, frozenset()) for name, wanted in resolution.needs.items()}
    warnings = (
        Problem(
            f"test dependency of '{name}' on {quoted_names(sorted(wanted))} closes a cycle and is ignored",
            Location(resolution.packages[name].manifest.path),
        )
        for name, wanted in sorted(dropped.items())
    )
    return replace(resolution, needs=needs, postponed=dropped), tuple(warnings)


def unmet_versions(packages: Mapping[str, Package]) -> Iterator[Problem]:
    """Yield unmet version requirements in the workspace; only numeric ones, without trailing zeros, count."""

    def numbers(version: str) -> list[int]:
        parts = [int(part) for part in version.split(".")]
        while parts and not parts[-1]:
            parts.pop()
        return parts

    for package in packages.values():
        for need in package.manifest.dependencies:
            if not (need.versions and need.kinds & ALL_KINDS and need.name in packages):
                continue
            present = packages[need.name].manifest.version
            unmet = [
                _COMPARISONS[word][0].format(wanted)
                for word, wanted in need.versions
                if _VERSION.fullmatch(present) and _VERSION.fullmatch(wanted)
                if not _COMPARISONS[word][1](numbers(present), numbers(wanted))
            ]
            if unmet:
                wanted = f"version {' and '.join(unmet)} of '{need.name}'"
                message = f"'{package.name}' requires {wanted}, but it is {present}"
                yield Problem(message, Location(package.manifest.path))


def is_ros_name(name: str) -> bool:
    """Return whether an unresolved dependency is certainly a ROS package."""
    of_ros = name in _ROS_NAMES or name.startswith(_ROS_BEGINNINGS) or name.endswith(_ROS_ENDINGS)
    return of_ros and "-" not in name


def resembles_ros_name(name: str) -> bool:
    """Return whether a dependency is spelled like a ROS package; rosdep keys separate words by '-'."""
    return is_ros_name(name) or ("_" in name and "-" not in name)


def similar_package(name: str, known: Iterable[str]) -> str | None:
    """Return the known package that was probably meant by an unknown name, or None.

    A common ending such as '_msgs' is not compared: 'std_msgs' is not a misspelled 'test_msgs'.
    """
    ending = next(filter(name.endswith, _ROS_ENDINGS), "")
    others = [other for other in known if other != name]
    stems = {other.removesuffix(ending): other for other in others if other.endswith(ending)}
    near = nearest(name.removesuffix(ending), stems, _SIMILAR) if ending else nearest(name, others, _SIMILAR)
    return (stems[near] if ending else near) if near else None


def provided_names(embedded: Mapping[str, Package]) -> frozenset[str]:
    """Return all names that embedded packages provide, including those of unused families."""
    return frozenset(name for package in embedded.values() for name in _names_of(package))


def _names_of(package: Package) -> list[str]:
    exports = package.manifest.exports
    return [package.name, *(e.content for e in exports if e.tag == "forge_provides")]


def _wanted(package: Package, *, events: bool) -> tuple[str, ...]:
    names = package.manifest.names(ALL_KINDS)
    if _GENERATORS.isdisjoint((*names, *package.manifest.groups)):
        return tuple(dict.fromkeys(names))
    implied: tuple[str, ...] = ACTION_NEEDS if package.has_actions else ()
    if events and (package.has_services or package.has_actions):
        implied += EVENT_NEEDS
    # The packages in these lists are excluded.
    return tuple(dict.fromkeys((*names, *(need for need in implied if need != package.name))))
