"""Which embedded packages a build needs, and what nobody provides; pure.

A name is looked for in the workspace, then in underlays and the system, then among the packages
that forge brings along. The embedded ones come in families (ament, lint, rosidl) that are used whole
or not at all, so that two implementations of one API never meet in one build.
"""

from __future__ import annotations

from dataclasses import field, replace
from typing import TYPE_CHECKING

from forge.errors import Place, Problem
from forge.frozen import frozen
from forge.graph import order, round_about
from forge.model import BUILD_KINDS, RUN_KINDS, TEST_KINDS, Package

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

FAMILY_MARKS = {
    "ament": ("ament_cmake", "ament_cmake_core"),
    "lint": ("ament_lint_auto",),
    "rosidl": ("rosidl_default_generators", "rosidl_cmake"),
}
"""Where one of these is found in the workspace, an underlay or the system, its family is provided."""

ACTION_NEEDS = ("action_msgs", "builtin_interfaces", "unique_identifier_msgs")
"""What generated code of .action files refers to and manifests commonly leave unsaid."""

INTERFACE_GROUP = "rosidl_interface_packages"

_GENERATORS = frozenset({"rosidl_default_generators", INTERFACE_GROUP})
"""A dependency or a group of a package that generates code; others may merely bring .action files along."""

ALL_KINDS = BUILD_KINDS | RUN_KINDS | TEST_KINDS

# Names that are ROS packages rather than keys of a system package: the former hold no '-', and
# system keys rarely begin or end like these.
_ROS_BEGINNINGS = ("rcl", "rmw", "tf2", "launch", "ros2", "rosbag2", "nav2_", "moveit_", "ament_", "rosidl_")
_ROS_ENDINGS = ("_msgs", "_interfaces", "_srvs", "_actions")
_ROS_NAMES = frozenset(
    {"class_loader", "cv_bridge", "demo_nodes_cpp", "demo_nodes_py", "image_transport", "message_filters"}
    | {"pluginlib", "robot_state_publisher", "rqt", "rviz2", "turtlesim", "urdf", "xacro"}
)


@frozen
class Provision:
    """The packages of a build, embedded ones included, and how names resolve among them.

    `needs` has an edge for every dependency of any kind that one of `packages` answers to.
    `missing` maps a package to its dependencies that look like ROS packages and that nobody provides.
    `superseded` are embedded packages that must not be there, since somebody else answers for them.
    `postponed` are needs of tests alone, left out of `needs` since they would close a circle.
    `withheld` maps each name that forge could answer to, but for its family, to the reason.
    """

    packages: Mapping[str, Package]
    needs: Mapping[str, frozenset[str]]
    missing: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    superseded: frozenset[str] = frozenset()
    postponed: Mapping[str, frozenset[str]] = field(default_factory=dict)
    withheld: Mapping[str, str] = field(default_factory=dict)


def provide(
    workspace: Mapping[str, Package],
    embedded: Mapping[str, Package],
    provider: Callable[[str], object | None],
) -> Provision:
    """Return the workspace's packages with the embedded ones that they need, however deep.

    `provider(name)` tells the prefix in which an underlay or the system has a package, else None.
    """
    reasons = _provided_families(workspace, provider)
    answers, withheld = _answers(embedded, reasons)
    packages = dict(workspace)
    needs: dict[str, frozenset[str]] = {}
    missing: dict[str, tuple[str, ...]] = {}
    waiting = list(workspace)
    while waiting:
        name = waiting.pop()
        if name in needs:
            continue
        wanted = _wanted(packages[name])
        found = {other: _resolve(other, workspace, answers, provider) for other in wanted}
        needs[name] = frozenset(other.name for other in found.values() if other and other.name != name)
        unmet = [
            other
            for other in wanted
            if found[other] is None and is_like_a_ros_name(other) and not provider(other)
        ]
        if unmet:
            missing[name] = tuple(unmet)
        for other in found.values():
            if other and other.name not in packages:
                packages[other.name] = other
                waiting.append(other.name)
    standing = {package.name for package in answers.values()}
    superseded = (name for name in embedded if name not in standing or provider(name))
    return Provision(packages, needs, missing, frozenset(superseded) - workspace.keys(), withheld=withheld)


def without_test_circles(provision: Provision) -> tuple[Provision, tuple[Problem, ...]]:
    """Return the provision with needs of tests postponed where they close a circle, and a warning for each.

    What tests need must be there when they run, which is after everything was built. A circle that
    other needs close is left as it is.
    """
    if order(provision.needs) is not None:
        return provision, ()
    weak = {name: frozenset(_only_tested(package)) for name, package in provision.packages.items()}
    dropped = round_about(provision.needs, weak)
    needs = {name: wanted - dropped.get(name, frozenset()) for name, wanted in provision.needs.items()}
    warnings = (
        Problem(
            f"'{name}' needs {_quoted(sorted(wanted))} for its tests, in a circle: it is built without",
            Place(provision.packages[name].manifest.path),
        )
        for name, wanted in sorted(dropped.items())
    )
    return replace(provision, needs=needs, postponed=dropped), tuple(warnings)


def _only_tested(package: Package) -> set[str]:
    """Return what a package needs for its tests and for nothing else."""
    manifest = package.manifest
    return set(manifest.names(TEST_KINDS)) - set(manifest.names(BUILD_KINDS | RUN_KINDS))


def _quoted(names: Iterable[str]) -> str:
    return ", ".join(f"'{name}'" for name in names)


def is_ros_name(name: str) -> bool:
    """Tell if a dependency that nobody provides is surely a ROS package, not a system library."""
    if "-" in name:
        return False
    return name in _ROS_NAMES or name.startswith(_ROS_BEGINNINGS) or name.endswith(_ROS_ENDINGS)


def is_like_a_ros_name(name: str) -> bool:
    """Tell if a dependency is written like a ROS package: keys of system packages have '-' between words."""
    return is_ros_name(name) or ("_" in name and "-" not in name)


def missing_problems(provision: Provision, names: Iterable[str]) -> tuple[list[Problem], list[Problem]]:
    """Return what stops a build of `names`, and what merely deserves a warning.

    A package that CMake builds cannot do without its build dependencies; a Python package is installed
    without them, and so is a package that needs them only to run. What only tests need is left alone. A
    package without a package.xml may get along: its find_package may be one of several ways. So may one
    that depends on a group: it takes the members that there are (REP 149), and tools that know no groups
    make such packages list all members as dependencies, too. What is only written like a ROS package is
    at most a warning, and only where something is built with it.
    """
    errors: dict[str, list[str]] = {}
    warnings: dict[str, list[str]] = {}
    for name in names:
        package = provision.packages[name]
        manifest = package.manifest
        lenient = package.build_type == "ament_python" or not package.ros or manifest.group_dependencies
        required = set() if lenient else set(manifest.names(BUILD_KINDS))
        used = set(manifest.names(BUILD_KINDS | RUN_KINDS))
        for dependency in provision.missing.get(name, ()):
            sure = is_ros_name(dependency)
            if dependency in required or (sure and dependency in used):
                found = errors if sure and dependency in required else warnings
                found.setdefault(dependency, []).append(name)
    return _together(errors, provision), _together(warnings, provision)


def _provided_families(
    workspace: Mapping[str, Package], provider: Callable[[str], object | None]
) -> dict[str, str]:
    """Return the families that others provide, each with who does."""
    families = {}
    for family, marks in FAMILY_MARKS.items():
        for mark in marks:
            if mark in workspace:
                families[family] = f"'{mark}' is in the workspace ({workspace[mark].path})"
            elif found := provider(mark):
                families[family] = f"'{mark}' comes from '{found}'"
    return families


def _answers(
    embedded: Mapping[str, Package], reasons: Mapping[str, str]
) -> tuple[dict[str, Package], dict[str, str]]:
    """Return every name that an embedded package answers to; apart those of families that others provide."""
    answers: dict[str, Package] = {}
    withheld: dict[str, str] = {}
    for package in embedded.values():
        exports = package.manifest.exports
        names = _names_of(package)
        families = (e.content for e in exports if e.tag == "forge_family")
        reason = next((reasons[family] for family in families if family in reasons), None)
        if reason is None:
            answers.update(dict.fromkeys(names, package))
        else:
            withheld.update(dict.fromkeys(names, reason))
    return answers, withheld


def answered_names(embedded: Mapping[str, Package]) -> frozenset[str]:
    """Return every name that forge can answer to, whether or not its family is provided otherwise."""
    return frozenset(name for package in embedded.values() for name in _names_of(package))


def _names_of(package: Package) -> list[str]:
    exports = package.manifest.exports
    return [package.name, *(e.content for e in exports if e.tag == "forge_provides")]


def _wanted(package: Package) -> tuple[str, ...]:
    names = package.manifest.names(ALL_KINDS)
    if package.has_actions and not _GENERATORS.isdisjoint((*names, *package.manifest.groups)):
        # Not for the packages that make up this list themselves.
        names += tuple(need for need in ACTION_NEEDS if need != package.name)
    return tuple(dict.fromkeys(names))


def _resolve(
    name: str,
    workspace: Mapping[str, Package],
    answers: Mapping[str, Package],
    provider: Callable[[str], object | None],
) -> Package | None:
    if name in workspace:
        return workspace[name]
    if name in answers and not provider(name):
        return answers[name]
    return None


def _together(found: Mapping[str, list[str]], provision: Provision) -> list[Problem]:
    """Return a problem for all dependencies that the same packages lack for the same reason."""
    groups: dict[tuple[tuple[str, ...], str], list[str]] = {}
    for dependency, users in sorted(found.items()):
        reason = provision.withheld.get(dependency, "")
        groups.setdefault((tuple(sorted(users)), reason), []).append(dependency)
    return [_missing(names, users, reason, provision) for (users, reason), names in groups.items()]


def _missing(names: Sequence[str], users: Sequence[str], reason: str, provision: Provision) -> Problem:
    quoted = ", ".join(f"'{name}'" for name in names)
    who = ", ".join(f"'{user}'" for user in users) + (" needs" if len(users) == 1 else " need")
    which = "which is" if len(names) == 1 else "which are"
    what = f"{who} {quoted}, {which} neither in the workspace nor in a sourced underlay"
    place = Place(provision.packages[users[0]].manifest.path)
    if reason:
        return Problem(
            f"{what}, and forge's own would not fit: {reason}",
            place,
            f"add {quoted} from where that is, or take that away: forge then uses its own for all "
            "(docs/explanation/embedded.md in the documentation)",
        )
    return Problem(
        f"{what}, and forge does not bring {'it' if len(names) == 1 else 'them'} along",
        place,
        "source an installation that has them, or add their sources to the workspace "
        "(docs/how-to/rclcpp.md in the documentation)",
    )
