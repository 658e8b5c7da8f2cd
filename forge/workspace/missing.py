"""Reports ROS packages that dependencies name and that exist nowhere.

It is an error only if the build certainly fails. Other packages are built, because a manifest may declare
more than the build needs.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from forge.base.errors import Problem
from forge.base.frozen import frozen
from forge.base.layout import docs_url
from forge.workspace.manifest import declaration
from forge.workspace.model import BUILD_KINDS, RUN_KINDS, Package
from forge.workspace.resolve import is_ros_name, quoted_names, resembles_ros_name, similar_package

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Mapping, Sequence

    from forge.workspace.resolve import DependencyResolution


@frozen
class MissingDependencies:
    """Unresolved dependencies: errors of the packages that cannot be built, and warnings of others."""

    errors: tuple[Problem, ...] = ()
    warnings: tuple[Problem, ...] = ()
    unbuildable: frozenset[str] = frozenset()
    """The packages of `errors`, without their dependents."""


def missing_dependencies(
    resolution: DependencyResolution,
    names: Iterable[str],
    skip_keys: Collection[str] = (),
    certainly_missing: Callable[[Package, Collection[str]], frozenset[str]] = lambda *_: frozenset(),
    whereabouts: Callable[[str], str | None] = lambda _: None,
) -> MissingDependencies:
    """Return the unresolved dependencies of `names`, except for `skip_keys`.

    Build dependencies on ROS packages without which the build certainly fails are errors. Other build and run
    dependencies are warnings, test dependencies are ignored. Names that merely resemble ROS packages are at
    most warnings, and only for build dependencies, unless they resemble a package that exists. `whereabouts`
    returns a remedy for a name if it is known where that package is.
    """
    errors: dict[str, list[str]] = {}
    warnings: dict[str, list[str]] = {}
    for name in names:
        unresolved = [other for other in resolution.missing.get(name, ()) if other not in skip_keys]
        if not unresolved:
            continue
        package = resolution.packages[name]
        manifest = package.manifest
        # Python packages use most modules at run time; group members may be absent (REP 149).
        lenient = package.build_type == "ament_python" or not package.ros or manifest.group_dependencies
        built_with = () if lenient else manifest.names(BUILD_KINDS)
        used = manifest.names(BUILD_KINDS | RUN_KINDS)
        candidates = [other for other in unresolved if is_ros_name(other) and other in built_with]
        required = certainly_missing(package, candidates) if candidates else ()
        for dependency in unresolved:
            sure = is_ros_name(dependency)
            if dependency in required:
                errors.setdefault(dependency, []).append(name)
            elif dependency in built_with or (
                dependency in used and (sure or _is_misspelt(dependency, resolution))
            ):
                warnings.setdefault(dependency, []).append(name)
    unbuildable = frozenset(name for users in errors.values() for name in users)
    return MissingDependencies(
        _together(errors, resolution, whereabouts), _together(warnings, resolution, whereabouts), unbuildable
    )


def _is_misspelt(dependency: str, resolution: DependencyResolution) -> bool:
    return resembles_ros_name(dependency) and similar_package(dependency, resolution.known()) is not None


def _together(
    found: Mapping[str, list[str]],
    resolution: DependencyResolution,
    whereabouts: Callable[[str], str | None],
) -> tuple[Problem, ...]:
    """Return one problem for all dependencies that the same packages lack for the same reason.

    Names that are probably misspelt have a problem each.
    """
    known = tuple(resolution.known()) if found else ()
    problems: list[Problem] = []
    groups: dict[tuple[tuple[str, ...], str, str | None, str | None], list[str]] = {}
    ignored: dict[tuple[str, ...], list[str]] = {}
    for dependency, users in sorted(found.items()):
        if dependency in resolution.ignored:
            ignored.setdefault(tuple(sorted(users)), []).append(dependency)
            continue
        reason = resolution.withheld.get(dependency, "")
        if hint := resolution.elsewhere.get(dependency):
            problems.append(_of_another_distribution(dependency, users, resolution, hint))
            continue
        near = similar_package(dependency, known)
        place = whereabouts(dependency)
        groups.setdefault((tuple(sorted(users)), reason, near, place), []).append(dependency)
    problems += (
        _missing(
            names, resolution.packages[users[0]], _dependents(users), reason, place or _remedy(names, near)
        )
        for (users, reason, near, place), names in groups.items()
    )
    problems += (_ignored(names, users, resolution) for users, names in ignored.items())
    return tuple(problems)


def _ignored(names: Sequence[str], users: Sequence[str], resolution: DependencyResolution) -> Problem:
    which, them = ("which is", "it") if len(names) == 1 else ("which are", "them")
    message = f"{_dependents(users)} {quoted_names(names)}, {which} in the workspace, but ignored"
    location = declaration(resolution.packages[users[0]].manifest.path, names[0])
    hint = f"if the build needs {them}, remove {them} from --packages-ignore and --packages-ignore-regex"
    return Problem(message, location, hint)


def _of_another_distribution(
    dependency: str, users: Sequence[str], resolution: DependencyResolution, hint: str
) -> Problem:
    location = declaration(resolution.packages[min(users)].manifest.path, dependency)
    message = f"{_dependents(sorted(users))} '{dependency}', which the chosen ROS distribution does not have"
    return Problem(message, location, hint)


def _dependents(users: Sequence[str]) -> str:
    return quoted_names(users) + (" needs" if len(users) == 1 else " need")


def _missing(names: Sequence[str], user: Package, dependents: str, reason: str, hint: str) -> Problem:
    """Return the problem of dependencies that `user` and others lack."""
    quoted = quoted_names(names)
    which = "which is" if len(names) == 1 else "which are"
    message = f"{dependents} {quoted}, {which} neither in the workspace nor in a sourced underlay"
    location = declaration(user.manifest.path, names[0])
    if reason:
        return Problem(
            f"{message}; the embedded packages cannot be used, because {reason}",
            location,
            f"add {quoted} from the same source, or remove that package to use the embedded ones for all; "
            f"see {docs_url('explanation/embedded.md')}",
        )
    return Problem(f"{message}, nor embedded in forge", location, hint)


def _remedy(names: Sequence[str], near: str | None) -> str:
    """Return where to get packages of which nothing is known but `near`, a similar name."""
    them, their = ("it", "its") if len(names) == 1 else ("them", "their")
    remedy = f"source an installation that contains {them}, or add {their} sources to the workspace"
    question = f"did you mean '{near}'? otherwise " if near else ""
    return f"{question}{remedy}; see {docs_url('how-to/rclcpp.md')}"
