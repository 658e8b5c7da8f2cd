"""Warnings about underlays: missing ones, and packages that override theirs."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from forge.base.errors import Problem
from forge.base.text import listed
from forge.environment.install_state import recorded_underlays
from forge.environment.prefixes import find_underlays, installed_packages

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Mapping
    from pathlib import Path


_VARIABLES = ("COLCON_PREFIX_PATH", "AMENT_PREFIX_PATH")


def lost_underlays(install: Path, variables: Mapping[str, str]) -> tuple[Problem, ...]:
    """Return warnings for underlays in the install folder's record or the environment that do not exist."""
    recorded = [root for root in recorded_underlays(install) if not root.is_dir()]
    problems = [
        Problem(
            f"the underlay '{root}' no longer exists: packages built on it may not run",
            hint="restore it, or pass '--reset-underlays' to forget it",
        )
        for root in recorded
    ]
    known = {str(root) for root in recorded}
    for variable in _VARIABLES:
        entries = dict.fromkeys(variables.get(variable, "").split(os.pathsep))
        gone = [entry for entry in entries if entry and entry not in known and not os.path.lexists(entry)]
        if gone:
            message = f"'{variable}' names {listed(gone)}, which does not exist"
            hint = "if it was removed after sourcing, continue in a new terminal"
            problems.append(Problem(message, hint=hint))
    return tuple(problems)


def overridden(names: Collection[str], install: Path, variables: Mapping[str, str]) -> Iterator[Problem]:
    """Yield a warning for each underlay with packages that others override and that have dependents there."""
    for root in find_underlays(variables, install).chain:
        below = {package.name: package.needs for package in installed_packages(root)}
        users = {
            name: [user for user, needs in below.items() if name in needs and user not in names]
            for name in sorted(below.keys() & set(names))
        }
        used = [name for name in users if users[name]]
        if used:
            verb, what = ("overrides", "the package") if len(used) == 1 else ("override", "the packages")
            quoted = ", ".join(f"'{name}'" for name in used)
            dependents = listed(sorted({user for name in used for user in users[name]}))
            message = f"{quoted} {verb} {what} in '{root}', on which {dependents} there depend"
            hint = "if the two are not compatible, build the dependents in this workspace, too"
            yield Problem(message, hint=hint)
