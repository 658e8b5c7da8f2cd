"""Warnings about underlays, and the Python for which an underlay was built."""

from __future__ import annotations

import os
import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path

from forge.base.distributions import VARIABLE
from forge.base.errors import Problem, WorkspaceError
from forge.base.files import names_in, text_or_nothing
from forge.base.layout import LAYOUT_MARKER
from forge.base.text import listed, quoted_names
from forge.environment.install_state import (
    recorded_overlays,
    recorded_python,
    recorded_state,
    recorded_underlays,
)
from forge.environment.prefixes import find_underlays, installed_packages

_SETS_ROSDISTRO = re.compile(rf"^(?:set;{VARIABLE};|export {VARIABLE}=)(\w+)$", re.MULTILINE)
_ROSDISTRO_HOOK = "share/ros_environment/environment/1.ros_distro"
_VARIABLES = ("COLCON_PREFIX_PATH", "AMENT_PREFIX_PATH")


def lost_underlays(install: Path, variables: Mapping[str, str]) -> tuple[Problem, ...]:
    """Return warnings for missing underlays, both recorded ones and those in the environment."""
    recorded = [root for root in recorded_underlays(install) if not root.is_dir()]
    problems = [
        Problem(
            f"the underlay '{root}' no longer exists: packages built on it may not run",
            hint="restore it, or pass '--reset-underlays' to forget it",
        )
        for root in recorded
    ]
    missing_roots = [*map(str, recorded)]
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
            verb = "does" if len(gone) == 1 else "do"
            message = f"'{variable}' names {listed(gone)}, which {verb} not exist"
            hint = "if it was removed after sourcing, continue in a new terminal"
            problems.append(Problem(message, hint=hint))
    return tuple(problems)


def unusable_overlays(install: Path, sourced: Collection[Path]) -> Iterator[Problem]:
    """Yield a warning for each sourced or recorded workspace that was built on this one."""
    for root in dict.fromkeys((*sourced, *recorded_overlays(install))):
        if root.resolve() == install.resolve():
            continue
        message = f"'{root}' was built on this workspace and is not used as its underlay"
        hint = (
            "source it in other terminals, and build this workspace without it" if root in sourced else None
        )
        yield Problem(message, hint=hint)


def other_distributions(chain: Sequence[Path], rosdistro: str) -> Iterator[Problem]:
    """Yield a warning for each underlay that is, or was built for, another ROS distribution."""
    for root in chain:
        with suppress(WorkspaceError):  # an invalid record, which commands that need it report
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


Version = tuple[int, int]

_FOLDER = re.compile(r".*/python(\d+)\.(\d+)")
_SHEBANG = re.compile(rb"#!\s*(/\S*/python3?(?:\.\d+)?)\s")
_SCRIPTS_READ = 20
"""The maximum number of scripts that are read per prefix: most have the same interpreter."""


def python_versions(root: Path) -> frozenset[Version]:
    """Return the Python versions of an underlay's modules in lib/pythonX.Y; empty without modules."""
    versions = (frozenset(version for _, version in _module_folders(prefix)) for prefix in _prefixes(root))
    return next(filter(None, versions), frozenset())


def lacks_modules(root: Path, variables: Mapping[str, str]) -> bool:
    """Return whether a prefix has Python modules, but none of its folders is on PYTHONPATH.

    This is the case if only AMENT_PREFIX_PATH or CMAKE_PREFIX_PATH contain a distribution, as with `sudo -E`.
    """
    python_path = {
        os.path.realpath(entry) for entry in variables.get("PYTHONPATH", "").split(os.pathsep) if entry
    }
    folders = [folder for folder, _ in _module_folders(root)]
    return bool(folders) and python_path.isdisjoint(map(os.path.realpath, folders))


def underlay_python(root: Path) -> Path | None:
    """Return the interpreter that an underlay was built with: recorded by forge, else that of its scripts."""
    with suppress(WorkspaceError):  # an invalid record, which commands that need it report
        recorded = recorded_python(root)
        if recorded is not None:
            return Path(recorded)
    for prefix in _prefixes(root):
        for name in names_in(f"{prefix}/bin")[:_SCRIPTS_READ]:
            with suppress(OSError), Path(prefix, "bin", name).open("rb") as stream:
                match = _SHEBANG.match(stream.readline(512))
                python = Path(os.fsdecode(match[1])) if match else None  # no path if `env` finds it
                if python is not None and python.exists():
                    return python
    return None


def _prefixes(root: Path) -> Iterator[Path]:
    yield root
    if (root / LAYOUT_MARKER).is_file():
        yield from (root / name for name in names_in(f"{root}"))


def _module_folders(prefix: Path) -> Iterator[tuple[str, Version]]:
    """Yield the folders with Python modules of one prefix, and the versions in their names."""
    for library in ("lib", "local/lib"):
        for folder in (f"{library}/{name}" for name in names_in(f"{prefix}/{library}")):
            match = _FOLDER.fullmatch(folder)
            for modules in ("site-packages", "dist-packages") if match else ():
                # Empty folders of that name also belong to underlays without modules.
                if match and names_in(f"{prefix}/{folder}/{modules}"):
                    yield f"{prefix}/{folder}/{modules}", (int(match[1]), int(match[2]))
