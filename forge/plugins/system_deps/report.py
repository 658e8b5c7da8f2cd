"""The lines of `forge deps`: a shell script whose comments say what is missing and who needs it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from forge.plugins.system_deps.installing import manual_names

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from forge.plugins.system_deps.outstanding import DependencyStatus
    from forge.plugins.system_deps.package_names import PackageNames
    from forge.plugins.system_deps.system import System


def satisfied(needs: Iterable[DependencyStatus], missing: list[DependencyStatus]) -> Iterator[str]:
    """Yield a line for each dependency that is not missing."""
    for need in needs:
        if need not in missing:
            where = need.provider or f"{need.manager}: {' '.join(need.names) or 'nothing to install'}"
            yield f"# {need.key} ({where}), needed by {', '.join(need.users)}"


def named(missing: Iterable[DependencyStatus]) -> Iterator[str]:
    """Yield a line for each missing dependency that has packages."""
    for need in missing:
        if need.manager:
            called = "" if need.names == (need.key,) else f" ({need.manager}: {', '.join(need.names)})"
            yield f"# {need.key}{called}, needed by {', '.join(need.users)}"


def unnamed(missing: list[DependencyStatus], have: frozenset[tuple[str, str]], remedy: str) -> Iterator[str]:
    """Yield a line for each dependency that no command installs; `remedy` is the advice for ROS packages."""
    for manager, names in manual_names(missing, have).items():
        yield f"# install manually ({manager}): {' '.join(names)}"
    for need in missing:
        users = ", ".join(need.users)
        if need.ros:
            yield f"# {need.key}, needed by {users}: {remedy}"
        elif not need.manager:
            yield f"# {need.key} is unknown, needed by {users}"
    if not missing:
        yield "# nothing is missing"


def ros_remedy(names: PackageNames, system: System, rosdistro: str) -> str:
    """Return what to do about a ROS package that no package manager provides."""
    source = "source an installation that contains it"
    if not rosdistro:
        return f"ROS package; {source}, or choose a distribution with --rosdistro"
    if names.lists_ros_packages:
        where = f"{system.name}:{system.version}".rstrip(":")
        return f"not released for {rosdistro} on {where}; {source}, or add its source code to the workspace"
    return f"ROS package; {source}"
