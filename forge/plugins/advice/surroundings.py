"""Warnings about underlays and the interpreter: missing ones, and others than those of the last build."""

from __future__ import annotations

import os
import re
import shlex
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path

from forge.base.distributions import VARIABLE
from forge.base.errors import Problem
from forge.base.files import text_or_nothing
from forge.base.text import listed, quoted_names
from forge.environment.install_state import recorded_overlays, recorded_state, recorded_underlays
from forge.environment.prefixes import Underlays, find_underlays, installed_packages
from forge.toolchain.interpreter import Interpreter

_SETS_ROSDISTRO = re.compile(rf"^(?:set;{VARIABLE};|export {VARIABLE}=)(\w+)$", re.MULTILINE)
_ROSDISTRO_HOOK = "share/ros_environment/environment/1.ros_distro"
_VARIABLES = ("COLCON_PREFIX_PATH", "AMENT_PREFIX_PATH")


def about_underlays(
    install: Path, variables: Mapping[str, str], underlays: Underlays, rosdistro: str
) -> Iterator[Problem]:
    """Yield warnings for missing underlays, for workspaces built on this one, and for other distributions."""
    lost = [root for root in recorded_underlays(install) if not root.is_dir()]
    for root in lost:
        message = f"the underlay '{root}' no longer exists: packages built on it may not run"
        yield Problem(message, hint="restore it, or pass '--reset-underlays' to forget it")
    missing_roots = [*map(str, lost)]
    for variable in _VARIABLES:
        entries = dict.fromkeys(filter(None, variables.get(variable, "").split(os.pathsep)))
        # An isolated workspace has one entry in COLCON_PREFIX_PATH, and one per package in the other.
        gone = [
            entry
            for entry in entries
            if not os.path.lexists(entry)
            and not any(f"{entry}/".startswith(f"{root.rstrip('/')}/") for root in missing_roots)
        ]
        missing_roots += gone
        if gone:
            message = (
                f"'{variable}' names {listed(gone)}, which {'does' if len(gone) == 1 else 'do'} not exist"
            )
            yield Problem(message, hint="if it was removed after sourcing, continue in a new terminal")
    for root in dict.fromkeys((*underlays.overlays, *recorded_overlays(install))):
        if root.resolve() != install.resolve():
            message = f"'{root}' was built on this workspace and is not used as its underlay"
            hint = "source it in other terminals, and build this workspace without it"
            yield Problem(message, hint=hint if root in underlays.overlays else None)
    for root in underlays.chain:
        prefixes = (root, root / "ros_environment")
        scripts = (f"{prefix}/{_ROSDISTRO_HOOK}{end}" for prefix in prefixes for end in (".dsv", ".sh"))
        sets = (match[1] for path in scripts if (match := _SETS_ROSDISTRO.search(text_or_nothing(path))))
        other = recorded_state(root).rosdistro or next(sets, None)
        if rosdistro and other and other != rosdistro:
            message = f"the underlay '{root}' is for ROS '{other}', but this build is for '{rosdistro}'"
            hint = "in a new terminal, source only underlays of one distribution"
            yield Problem(message, hint=f"{hint}, or pass '--rosdistro {other}'")


def overridden(names: Collection[str], install: Path, variables: Mapping[str, str]) -> Iterator[Problem]:
    """Yield a warning for each underlay whose packages depend on packages that `names` override."""
    for root in find_underlays(variables, install).chain:
        below = {package.name: package.needs for package in installed_packages(root)}
        users = {
            name: [user for user, needs in below.items() if name in needs and user not in names]
            for name in sorted(below.keys() & set(names))
        }
        used = [name for name in users if users[name]]
        if used:
            verb, what = ("overrides", "the package") if len(used) == 1 else ("override", "the packages")
            dependents = listed(sorted({user for name in used for user in users[name]}))
            message = f"{quoted_names(used)} {verb} {what} in '{root}', on which {dependents} there depend"
            hint = "if the two are not compatible, build the dependents in this workspace, too"
            yield Problem(message, hint=hint)


def other_interpreter(recorded: str | None, interpreter: Interpreter) -> Iterator[Problem]:
    """Yield a warning if the last build used another interpreter, which still exists."""
    if recorded is not None and Path(recorded) != interpreter.path:
        message = (
            f"the interpreter is now '{interpreter.path}' ({interpreter.origin}) instead of '{recorded}'"
        )
        hint = (
            "packages that depend on it are rebuilt; to keep the old one, activate its environment or pass "
        )
        yield Problem(message, hint=f"{hint}--python {shlex.quote(recorded)}")
