"""Which packages of a checkout are in scope: those that generate interfaces and need no client library."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

from forge.workspace.discovery import discover, discover_embedded
from forge.workspace.model import DependencyKind

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from pathlib import Path

    from forge.workspace.model import Package

_GENERATES = re.compile(r"^\s*rosidl_generate_interfaces\s*\(", re.MULTILINE)
_CLIENT = re.compile(r"^\s*find_package\s*\(\s*(rclcpp|rclpy|rcl|rmw)\b", re.MULTILINE)

_NEEDED = frozenset(
    {
        *(DependencyKind.BUILD, DependencyKind.BUILDTOOL, DependencyKind.EXEC),
        *(DependencyKind.BUILD_EXPORT, DependencyKind.BUILDTOOL_EXPORT),
    }
)


@dataclass(frozen=True, slots=True)
class Chosen:
    """The packages of a repository that are built."""

    measured: Mapping[str, Path]
    """The interface packages of the repository."""
    others: Mapping[str, Path]
    """What they depend on and forge does not have embedded."""


def checkouts(sources: Path, distribution: str) -> dict[str, Path]:
    """Return the checkouts OWNER+NAME for a distribution; those in its own folder take precedence."""
    bases = (sources, sources / distribution)
    return {path.name: path for base in bases for path in sorted(base.glob("*+*")) if path.is_dir()}


def choose(checkout: Path, all_checkouts: Mapping[str, Path], distribution: str) -> Chosen:
    """Return the interface packages of a checkout and what to build with them, from any checkout."""
    own = _packages(checkout, distribution)
    measured = {name: each.path for name, each in own.items() if is_interface_package(each)}
    known = dict(own)
    embedded = discover_embedded(distribution)
    others: dict[str, Path] = {}
    waiting = list(measured)
    while waiting:
        for name in dependencies(known[waiting.pop()]):
            if name in measured or name in others:
                continue
            if name not in known and name not in embedded:
                known.update(_found(name, all_checkouts, distribution))
            if name in known and not needs_client_library(known[name]):
                others[name] = known[name].path
                waiting.append(name)
    return Chosen(measured, others)


def batches(chosen: Mapping[str, Chosen], distribution: str, most: int) -> Iterator[list[str]]:
    """Yield the names of repositories that are built together: at most so many, no package from two sources.

    Repositories with packages that forge has embedded are built alone, for theirs replace the embedded ones.
    """
    embedded = discover_embedded(distribution)
    batch: dict[str, dict[str, Path]] = {}
    for name, each in chosen.items():
        packages = {**each.others, **each.measured}
        if not embedded.keys().isdisjoint(packages):
            yield [name]
            continue
        known = {package: path for one in batch.values() for package, path in one.items()}
        clash = any(known.get(package, path) != path for package, path in packages.items())
        if clash or len(batch) == most:
            yield list(batch)
            batch = {}
        batch[name] = packages
    if batch:
        yield list(batch)


def is_interface_package(package: Package) -> bool:
    """Tell whether a package generates interfaces with ament and needs no client library."""
    script = _script(package)
    return (
        package.build_type == "ament_cmake" and bool(_GENERATES.search(script)) and not _CLIENT.search(script)
    )


def needs_client_library(package: Package) -> bool:
    """Tell whether a package asks for a client library; many name one in package.xml and do without it."""
    return bool(_CLIENT.search(_script(package)))


def _script(package: Package) -> str:
    path = package.path / "CMakeLists.txt"
    return path.read_text(encoding="utf-8") if path.is_file() else ""


def dependencies(package: Package) -> Iterator[str]:
    """Yield the names that a package depends on, except for its tests and documentation."""
    return (each.name for each in package.manifest.dependencies if each.kinds & _NEEDED)


def _found(name: str, all_checkouts: Mapping[str, Path], distribution: str) -> dict[str, Package]:
    """Return the package of a name from the first checkout that has a folder of that name."""
    for checkout in all_checkouts.values():
        if any(checkout.rglob(f"{name}/package.xml")) or checkout.name.endswith(f"+{name}"):
            package = _packages(checkout, distribution).get(name)
            if package is not None:
                return {name: package}
    return {}


def _packages(checkout: Path, distribution: str) -> Mapping[str, Package]:
    return discover(checkout, [str(checkout)], {"ROS_DISTRO": distribution}).packages
