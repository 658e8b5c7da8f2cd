"""What is to be said about the workspaces that this one is built on: those that are gone, what is in both."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from forge.errors import Problem
from forge.prefixes import find_underlays, installed_packages
from forge.results import recorded_underlays

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Mapping

    from forge.layout import Layout
    from forge.model import Record

_VARIABLES = ("COLCON_PREFIX_PATH", "AMENT_PREFIX_PATH")
_SHOWN = 3


def lost_underlays(install: Path, variables: Mapping[str, str]) -> tuple[Problem, ...]:
    """Return what the record of an install folder and the environment name, and nobody finds."""
    recorded = [root for root in recorded_underlays(install) if not root.is_dir()]
    problems = [
        Problem(
            f"the underlay '{root}' is not there any more: what was built on it may not run",
            hint="put it back, or forget it with '--reset-underlays'",
        )
        for root in recorded
    ]
    known = {str(root) for root in recorded}
    for variable in _VARIABLES:
        entries = dict.fromkeys(variables.get(variable, "").split(os.pathsep))
        gone = [entry for entry in entries if entry and entry not in known and not os.path.lexists(entry)]
        if gone:
            message = f"'{variable}' names {_listed(gone)}, which this machine has not"
            hint = "if that was removed after it was sourced, go on in a new terminal"
            problems.append(Problem(message, hint=hint))
    return tuple(problems)


def overridden(names: Collection[str], install: Path, variables: Mapping[str, str]) -> Iterator[Problem]:
    """Yield, for each of the packages that an underlay has too, who of that underlay will meet this one."""
    for root in find_underlays(variables, install).chain:
        below = {package.name: package.needs for package in installed_packages(root)}
        for name in sorted(below.keys() & set(names)):
            users = sorted(user for user, needs in below.items() if name in needs and user not in names)
            if users:
                message = f"'{name}' takes the place of that in '{root}', which {_listed(users)} there need"
                hint = "if it is not the same for its users, build these here, too"
                yield Problem(message, hint=hint)


def left_behind(records: Mapping[str, Record], names: Collection[str], layout: Layout) -> Iterator[Problem]:
    """Yield the packages that have left the workspace, and whose installed files others may still find.

    `names` are the packages that were found. One that this command merely does not look at, as with
    '--base-paths', has not left: its folder is still there and not ignored.
    """
    gone = sorted(
        name
        for name, record in records.items()
        if name not in names and record.complete and has_left(Path(record.parts.options[0]))
    )
    if gone:
        verb, whose = ("is", "its") if len(gone) == 1 else ("are", "their")
        message = f"{_listed(gone)} {verb} no longer in the workspace, but {whose} files are still in"
        hint = "remove them: forge clean stale"
        yield Problem(f"{message} '{layout.install}', where other packages may find them", hint=hint)


def has_left(source: Path) -> bool:
    """Tell if a folder holds no package any more, or is ignored."""
    if not (source / "package.xml").is_file():
        return not (source / "CMakeLists.txt").is_file() and not (source / "setup.py").is_file()
    return any(
        (folder / marker).exists()
        for folder in (source, *source.parents)
        for marker in ("COLCON_IGNORE", "AMENT_IGNORE")
    )


def _listed(names: list[str]) -> str:
    """Return the first few names, and how many there are besides."""
    shown = ", ".join(f"'{name}'" for name in names[:_SHOWN])
    return f"{shown} and {len(names) - _SHOWN} more" if len(names) > _SHOWN else shown
