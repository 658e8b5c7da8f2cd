"""Reports missing ROS packages that dependencies name, and their possible sources.

These are warnings: a manifest may declare more than the build needs.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Collection, Iterable, Sequence
from contextlib import suppress
from pathlib import Path

from forge.base.errors import Problem
from forge.base.files import text_or_nothing
from forge.base.layout import Layout, docs_url
from forge.base.text import quoted_names
from forge.workspace import resolve
from forge.workspace.discovery import discover
from forge.workspace.manifest import declaration
from forge.workspace.model import BUILD_KINDS, RUN_KINDS

_FEW = 3
_SUBMODULE = re.compile(r"^[ \t]*path[ \t]*=[ \t]*(\S.*?)[ \t]*$", re.MULTILINE)


def missing_dependencies(
    resolution: resolve.DependencyResolution,
    names: Iterable[str],
    skip_keys: Collection[str] = (),
    place_of: Callable[[str], str | None] = lambda _: None,
) -> tuple[Problem, ...]:
    """Return the unresolved dependencies of `names`, except for `skip_keys`.

    Test dependencies are ignored, and so are names that merely resemble ROS packages, unless they are build
    dependencies or resemble an existing package. `place_of` returns a remedy for a name if the location of
    the package is known.
    """

    def is_misspelt(name: str) -> bool:
        return (
            resolve.resembles_ros_name(name) and resolve.similar_package(name, resolution.known()) is not None
        )

    def problem(names: Sequence[str], users: Sequence[str], what: str, hint: str) -> Problem:
        location = declaration(resolution.packages[users[0]].manifest.path, names[0])
        verb = "needs" if len(users) == 1 else "need"
        return Problem(f"{quoted_names(users)} {verb} {quoted_names(names)}, {what}", location, hint)

    dependents: dict[str, list[str]] = {}
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
        for dependency in unresolved:
            if dependency in built_with or (
                dependency in used and (resolve.is_ros_name(dependency) or is_misspelt(dependency))
            ):
                dependents.setdefault(dependency, []).append(name)
    # One problem for all dependencies that the same packages lack for the same reason.
    known_names = tuple(resolution.known()) if dependents else ()
    problems: list[Problem] = []
    groups: dict[tuple[tuple[str, ...], str, str | None, str | None], list[str]] = {}
    ignored: dict[tuple[str, ...], list[str]] = {}
    for dependency, unsorted in sorted(dependents.items()):
        users = tuple(sorted(unsorted))
        if dependency in resolution.ignored:
            ignored.setdefault(users, []).append(dependency)
        elif hint := resolution.elsewhere.get(dependency):
            what = "which the chosen ROS distribution does not have"
            problems.append(problem([dependency], users, what, hint))
        else:
            reason = resolution.withheld.get(dependency, "")
            near, place = resolve.similar_package(dependency, known_names), place_of(dependency)
            groups.setdefault((users, reason, near, place), []).append(dependency)
    for (users, reason, near, place), names in groups.items():
        one = len(names) == 1
        what = f"which {'is' if one else 'are'} neither in the workspace nor in a sourced underlay"
        if reason:
            what += f"; the embedded packages cannot be used, because {reason}"
            hint = (
                f"add {quoted_names(names)} from the same source, or remove that package to use the embedded "
                f"ones for all; see {docs_url('explanation/embedded.md')}"
            )
        else:
            what += ", nor embedded in forge"
            them = "it" if one else "them"
            remedy = f"'forge fetch' downloads {them}; or source an installation that contains {them}"
            question = f"did you mean '{near}'? otherwise " if near else ""
            hint = place or f"{question}{remedy}; see {docs_url('how-to/rclcpp.md')}"
        problems.append(problem(names, users, what, hint))
    for users, names in ignored.items():
        which, them = ("is", "it") if len(names) == 1 else ("are", "them")
        what = f"which {which} in the workspace, but ignored"
        hint = f"if the build needs {them}, remove {them} from --packages-ignore and --packages-ignore-regex"
        problems.append(problem(names, users, what, hint))
    return tuple(problems)


def whereabouts(root: Path, layout: Layout, name: str) -> str | None:
    """Return a remedy for a package that is in no known prefix, or None if there is none."""

    def holds(install: Path) -> bool:
        # Unlike Path.is_dir, os.path.isdir returns False for inaccessible folders.
        return any(os.path.isdir(prefix / "share" / name) for prefix in (install / name, install))  # noqa: PTH112

    if holds(layout.install):
        if package := discover(root, (os.curdir,), os.environ).packages.get(name):
            return (
                f"'{name}' is in '{package.path}', but left out by '--paths', '--base-paths' or "
                "'--packages-ignore': '--packages-up-to' selects one package and what it needs"
            )
        return (
            f"'{name}' was in the workspace in an earlier build: add it again, or rename or remove the "
            f"dependency; '{layout.command('clean stale')}' removes its files"
        )
    if empty := unchecked_submodules(root):
        fitting = [path for path in empty if path.name == name] or empty
        return submodule_remedy(fitting)
    try:
        beside = sorted(path / "install" for path in root.parent.iterdir() if path != root)
    except OSError:
        beside = []
    other = next(filter(holds, beside), None)
    return f"source the workspace that contains it: . {other}/setup.sh" if other else None


def submodule_remedy(paths: list[Path]) -> str:
    words = " ".join(map(str, paths[:_FEW])) if len(paths) <= _FEW else "--recursive"
    which = f"submodule '{paths[0]}' is" if len(paths) == 1 else f"{len(paths)} submodules are"
    return f"the {which} not checked out: git submodule update --init {words}"


def unchecked_submodules(root: Path) -> list[Path]:
    """Return the submodules of the repositories in a workspace whose folders are empty, relative to it."""
    submodules = []
    patterns = (".gitmodules", "*/.gitmodules", "*/*/.gitmodules")
    for file in (file for pattern in patterns for file in sorted(root.glob(pattern))):
        for path in _SUBMODULE.findall(text_or_nothing(file)):
            folder = file.parent / path
            with suppress(OSError):
                if any(folder.iterdir()):
                    continue
            if folder != file.parent and folder.is_relative_to(root):
                submodules.append(folder.relative_to(root))
    return submodules
