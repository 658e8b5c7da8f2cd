"""The ROS distributions whose standard interfaces forge includes, and the selected one."""

from __future__ import annotations

from typing import TYPE_CHECKING

from forge.base.errors import Problem, SelectionError
from forge.base.names import did_you_mean
from forge.base.options import option

if TYPE_CHECKING:
    from collections.abc import Mapping

DISTRIBUTIONS = ("humble", "jazzy", "kilted", "rolling")
"""From the oldest to the newest, which is also their alphabetical order, as conditions compare them."""

OLDEST = DISTRIBUTIONS[0]
VARIABLE = "ROS_DISTRO"

FIRST_WITH_EVENTS = "jazzy"
"""The first distribution in which services have a message 'Event'."""


def distribution_option() -> str | None:
    """Return the option --rosdistro, a field of a frozen dataclass."""
    declared: str | None = option(
        "ROS distribution (default: that of ROS_DISTRO, forge.toml, an underlay, or the last build)",
        metavar="NAME",
    )
    return declared


def check_distribution(name: str | None, argument: str = "--rosdistro") -> None:
    """Raise SelectionError if forge does not have the interfaces of the requested distribution."""
    if name and name not in DISTRIBUTIONS:
        hint = did_you_mean(name, DISTRIBUTIONS) or f"use one of {', '.join(DISTRIBUTIONS)}"
        raise SelectionError(Problem(f"{argument}: unknown ROS distribution '{name}'", hint=hint))


def distribution_in(variables: Mapping[str, str]) -> str:
    """Return the distribution of an environment whose interfaces to use.

    If it is another one, ROS itself is expected to provide the interfaces; otherwise, the oldest is used.
    """
    name = variables.get(VARIABLE, "")
    return name if name in DISTRIBUTIONS else OLDEST


def up_to(rosdistro: str) -> tuple[str, ...]:
    """Return a distribution and all older ones, from the newest to the oldest."""
    return DISTRIBUTIONS[DISTRIBUTIONS.index(rosdistro) :: -1]


def has_service_events(rosdistro: str) -> bool:
    return FIRST_WITH_EVENTS in up_to(rosdistro)
