"""The ROS distributions whose standard interfaces forge includes, and the definitions of each.

The folders msg, srv and action of an embedded package have the definitions of the oldest distribution.
Definitions that a later one added or changed are in since/DISTRIBUTION; its file `removed` lists removed
ones.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from forge.base.errors import Problem, SelectionError
from forge.base.layout import PACKAGE
from forge.base.names import did_you_mean
from forge.base.options import option

DISTRIBUTIONS = ("humble", "jazzy", "kilted", "rolling")
"""From the oldest to the newest; this is also their alphabetical order, by which conditions compare them."""

OLDEST = DISTRIBUTIONS[0]
VARIABLE = "ROS_DISTRO"

FIRST_WITH_EVENTS = "jazzy"
"""The first distribution in which services have a message 'Event'."""

EMBEDDED = PACKAGE / "embedded"
SINCE = "since"
REMOVED = "removed"

_KINDS = ("msg", "srv", "action")


def distribution_option() -> Any:
    """Return the option --rosdistro, a field of a frozen dataclass."""
    return option(
        "ROS distribution (default: that of ROS_DISTRO, forge.toml, an underlay, or the last build)",
        metavar="NAME",
    )


def check_distribution(name: str | None, argument: str = "--rosdistro") -> None:
    """Raise SelectionError if forge does not have the interfaces of the requested distribution."""
    if name and name not in DISTRIBUTIONS:
        hint = did_you_mean(name, DISTRIBUTIONS) or f"use one of {', '.join(DISTRIBUTIONS)}"
        raise SelectionError(Problem(f"{argument}: unknown ROS distribution '{name}'", hint=hint))


def distribution_in(variables: Mapping[str, str]) -> str:
    """Return the distribution whose interfaces an environment uses: the oldest one if it is unknown."""
    name = variables.get(VARIABLE, "")
    return name if name in DISTRIBUTIONS else OLDEST


def up_to(rosdistro: str) -> tuple[str, ...]:
    """Return a distribution and all older ones, from the newest to the oldest."""
    return DISTRIBUTIONS[DISTRIBUTIONS.index(rosdistro) :: -1]


def has_service_events(rosdistro: str) -> bool:
    return FIRST_WITH_EVENTS in up_to(rosdistro)


def definition_folders(folder: Path, rosdistro: str) -> tuple[Path, ...]:
    """Return the folders that contain the definitions of a package; the first ones take precedence."""
    newer = folder / SINCE
    if not folder.is_relative_to(EMBEDDED) or not os.path.isdir(newer):  # noqa: PTH112  (see below)
        return (folder,)
    return (*(base for name in up_to(rosdistro) if (base := newer / name).is_dir()), folder)


def removed_definitions(folder: Path) -> frozenset[str]:
    """Return the definitions that one of these folders removes, such as 'msg/Pose2D.msg'."""
    path = folder / REMOVED
    in_distribution = folder.parent.name == SINCE and path.is_file()
    return frozenset(path.read_text(encoding="utf-8").split() if in_distribution else ())


def find_definition(folder: Path, rosdistro: str, relative: str) -> Path | None:
    """Return the path of the definition `relative` to the folder of a package, None if it has none."""
    for base in definition_folders(folder, rosdistro):
        if relative in removed_definitions(base):
            return None
        path = base / relative
        if os.path.isfile(path):  # noqa: PTH113  (False for a name that is too long)
            return path
    return None


def is_embedded(folder: Path) -> bool:
    """Return whether a package is embedded or was installed from one; `folder` contains its package.xml."""
    if folder.is_relative_to(EMBEDDED):
        return True
    manifest = folder / "package.xml"
    return manifest.is_file() and "<forge_family>" in manifest.read_text(encoding="utf-8")


def embedded_definitions(folder: Path, rosdistro: str) -> dict[str, Path]:
    """Return the folder of each definition of an embedded package by its path below that folder."""
    bases: dict[str, Path | None] = {}
    for base in definition_folders(folder, rosdistro):
        paths = (
            path.relative_to(base) for kind in _KINDS for path in sorted((base / kind).glob(f"*.{kind}"))
        )
        for relative in paths:
            bases.setdefault(relative.as_posix(), base)
        for removed in removed_definitions(base):
            bases.setdefault(removed, None)
    return {relative: base for relative, base in bases.items() if base}


def distributions_with(package: str, relative: str = "") -> tuple[str, ...]:
    """Return the distributions in which an embedded package has a definition, or any definition at all."""
    folder = EMBEDDED / package
    if relative:
        return tuple(name for name in DISTRIBUTIONS if find_definition(folder, name, relative))
    return tuple(name for name in DISTRIBUTIONS if embedded_definitions(folder, name))


def distribution_hint(package: str, rosdistro: str, relative: str = "") -> str | None:
    """Return a hint that names the distributions with a definition that `rosdistro` lacks, or None."""
    distributions = distributions_with(package, relative)
    if not distributions or rosdistro in distributions:
        return None
    name = f"{package}/{relative.rpartition('/')[2].partition('.')[0]}" if relative else package
    if distributions[0] == OLDEST:
        span = f"up to {distributions[-1].capitalize()}"
    else:
        span = f"in {distributions[0].capitalize()}" + (
            " and later" if distributions[-1] == DISTRIBUTIONS[-1] else ""
        )
    nearest = distributions[-1] if distributions[0] == OLDEST else distributions[0]
    return f"'{name}' exists {span}, this workspace is for {rosdistro.capitalize()}: --rosdistro {nearest}"
