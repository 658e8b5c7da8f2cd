"""What a build stands on: sourced workspaces, variables that were left behind, results of before."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import TYPE_CHECKING

from forge.errors import EnvironmentFault, Place, Problem, WorkspaceError
from forge.examining.checkup import Checkup
from forge.interpreter import find_interpreter
from forge.prefixes import LAYOUT_MARKER, SYSTEM, installed_packages, provider
from forge.provision import is_ros_name
from forge.results import STATE, foreign_build, other_layout, recorded_underlays
from forge.underlays import lost_underlays

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from forge.examining.subject import Subject

_PYTHON_FOLDER = re.compile(r"python(\d+)\.(\d+)")
_MODULES = ("lib", "local/lib")
_PATHS = ("CMAKE_PREFIX_PATH", "PYTHONPATH", "LD_LIBRARY_PATH")
_FILES = ("COLCON_DEFAULTS_FILE", "COLCON_PYTHON_EXECUTABLE", "COLCON_HOME", "CMAKE_COMMAND", "CTEST_COMMAND")
_PASSING = ("AMENT_CURRENT_PREFIX", "COLCON_CURRENT_PREFIX")
_NAMED = 3
_CACHE_HOME = re.compile(r"^CMAKE_HOME_DIRECTORY:INTERNAL=(.*)$", re.MULTILINE)


def underlays(subject: Subject) -> Checkup:
    """Look at each sourced workspace: is it there, whole, in order, and for the same Python."""
    chain = subject.underlays.chain
    warnings = list(lost_underlays(subject.layout.install, subject.variables))
    for root in chain:
        warnings += _without_scripts(root)
        warnings += _other_python(root, subject)
        warnings += _without_needs(root, subject)
    warnings += _out_of_order(chain)
    said = ", ".join(f"{root} ({_maker(root)})" for root in chain) or "none is sourced"
    return Checkup("underlays", said, warnings=tuple(warnings))


def environment(subject: Subject) -> Checkup:
    """Look for variables that another ROS, another workspace or another Python left behind."""
    variables = subject.surroundings
    warnings = [
        *_of_another_ros(variables),
        *_of_another_python(variables, subject),
        *_leading_nowhere(variables),
        *_half_sourced(variables),
    ]
    known = sorted(name for name in variables if name.startswith(("AMENT_", "COLCON_", "ROS_", "FORGE_")))
    return Checkup("environment", " ".join(known) or "nothing of ROS is set", warnings=tuple(warnings))


def results(subject: Subject) -> Checkup:
    """Look at the folders of earlier builds: whose they are, and whether they were moved."""
    layout = subject.layout
    errors = [problem for problem in (foreign_build(layout), other_layout(layout)) if problem]
    if layout.install.exists() and not layout.install.is_dir():
        errors.append(Problem(f"the install folder '{layout.install}' is a file", hint="remove it"))
    notes = [problem for name in subject.packages for problem in _moved(name, subject)]
    built = (layout.build / ".built_by").is_file()
    said = f"{layout.build.name}, {layout.install.name}" if built else "nothing was built yet"
    try:
        recorded_underlays(layout.install)
    except WorkspaceError as error:
        errors += error.problems
    return Checkup("results", said, tuple(errors), notes=tuple(notes))


def _maker(root: Path) -> str:
    """Return which tool built an install tree, as its files tell."""
    if (root / STATE).is_file():
        return "forge"
    if (root / LAYOUT_MARKER).is_file():
        return "colcon"
    return "catkin" if (root / "_setup_util.py").is_file() else "a distribution"


def _without_scripts(root: Path) -> Iterator[Problem]:
    if not any(root.glob("local_setup.*")) and not any(root.glob("setup.*")):
        hint = "build that workspace again, and source it in a new terminal"
        yield Problem(f"the underlay '{root}' has no setup scripts: it was not built to its end", hint=hint)


def _other_python(root: Path, subject: Subject) -> Iterator[Problem]:
    """Yield a warning where modules lie in folders of another Python only."""
    try:
        ours = find_interpreter(subject.python, subject.variables).version
    except EnvironmentFault:
        return
    prefixes = dict.fromkeys((root, *(package.prefix for package in installed_packages(root))))
    folders = (
        path
        for prefix in prefixes
        for place in _MODULES
        for path in (prefix / place).glob("python3.*/*-packages")
    )
    versions = {
        (int(match[1]), int(match[2]))
        for path in folders
        if (match := _PYTHON_FOLDER.fullmatch(path.parent.name))
    }
    if versions and ours not in versions:
        theirs = ", ".join("{}.{}".format(*version) for version in sorted(versions))
        hint = f"build with '--python python{theirs.partition(',')[0]}', or build the underlay for the same"
        message = f"the underlay '{root}' has modules for python {theirs}, and this is {ours[0]}.{ours[1]}"
        yield Problem(message, hint=hint)


def _without_needs(root: Path, subject: Subject) -> Iterator[Problem]:
    """Yield the packages of an underlay that need others which nobody has."""
    held = installed_packages(root)
    indexed = (root / LAYOUT_MARKER).is_file()
    known = {package.name for other in subject.underlays.chain for package in installed_packages(other)}
    known.update(subject.provision.packages if subject.provision else ())
    lost: dict[str, list[str]] = {}
    for package in held:
        for need in package.needs - known:
            # ament's index names keys of system packages, too; colcon's only what was built along.
            if (indexed or is_ros_name(need)) and not provider(need, subject.underlays, SYSTEM):
                lost.setdefault(need, []).append(package.name)
    for need, users in sorted(lost.items()):
        hint = f"source the workspace that has '{need}' before '{root}', or build that again"
        message = f"{_listed(sorted(users))} in '{root}' needs '{need}', which no sourced underlay has"
        yield Problem(message, hint=hint)


def _out_of_order(chain: tuple[Path, ...]) -> Iterator[Problem]:
    """Yield the workspaces that were sourced in another order than they were built on each other."""
    for place, root in enumerate(chain):
        try:
            below = recorded_underlays(root)
        except WorkspaceError as error:
            yield from error.problems
            continue
        for other in below:
            if other in chain[place + 1 :]:
                message = f"'{root}' was built on '{other}', and is sourced before it"
                yield Problem(message, hint=f"in a new terminal, source '{other}' first")


def _of_another_ros(variables: Mapping[str, str]) -> Iterator[Problem]:
    new = "open a new terminal, and source only what this workspace is for"
    if variables.get("ROS_VERSION", "2") != "2" or "ROS_PACKAGE_PATH" in variables:
        yield Problem("the environment is that of ROS 1", hint=f"{new}; look into ~/.bashrc, too")
    entries = variables.get("AMENT_PREFIX_PATH", "").split(os.pathsep)
    distros = sorted({match[1] for entry in entries if (match := re.match(r"/opt/ros/(\w+)", entry))})
    said = variables.get("ROS_DISTRO")
    if len(distros) > 1:
        yield Problem(f"several distributions of ROS are sourced: {_listed(distros)}", hint=new)
    elif distros and said and said not in distros:
        yield Problem(f"'ROS_DISTRO' is '{said}', and '/opt/ros/{distros[0]}' is sourced", hint=new)


def _of_another_python(variables: Mapping[str, str], subject: Subject) -> Iterator[Problem]:
    if variables.get("PYTHONHOME"):
        yield Problem(f"'PYTHONHOME' is set to '{variables['PYTHONHOME']}'", hint="unset PYTHONHOME")
    try:
        ours = find_interpreter(subject.python, variables).version
    except EnvironmentFault:
        return
    others = [
        entry
        for entry in variables.get("PYTHONPATH", "").split(os.pathsep)
        if (match := _PYTHON_FOLDER.search(entry)) and (int(match[1]), int(match[2])) != ours
    ]
    if others:
        hint = "open a new terminal, or build with '--python' for that version"
        message = f"'PYTHONPATH' has {_listed(others)}, of another python than {ours[0]}.{ours[1]}"
        yield Problem(message, hint=hint)
    conda = variables.get("CONDA_PREFIX")
    if conda and Path(conda, "bin") in map(Path, variables.get("PATH", "").split(os.pathsep)[:2]):
        hint = "run 'conda deactivate', unless compilers and libraries are to come from it"
        yield Problem(f"conda is active in '{conda}'", hint=hint)


def _leading_nowhere(variables: Mapping[str, str]) -> Iterator[Problem]:
    """Yield the variables that name folders or files which are gone; lost_underlays knows two others."""
    for name in _PATHS:
        entries = dict.fromkeys(filter(None, variables.get(name, "").split(os.pathsep)))
        gone = [entry for entry in entries if not os.path.lexists(entry)]
        if gone:
            hint = "if that was removed after it was sourced, go on in a new terminal"
            yield Problem(f"'{name}' names {_listed(gone)}, which this machine has not", hint=hint)
    for name in _FILES:
        value = variables.get(name)
        if value and os.sep in value and not os.path.lexists(Path(value).expanduser()):
            yield Problem(f"'{name}' names '{value}', which is not there", hint=f"unset {name}")


def _half_sourced(variables: Mapping[str, str]) -> Iterator[Problem]:
    for name in _PASSING:
        if name in variables:
            hint = f"unset {name}"
            yield Problem(f"'{name}' is set: it is meant for setup scripts while they run", hint=hint)


def _moved(name: str, subject: Subject) -> Iterator[Problem]:
    """Yield that a build folder was configured for a package that was elsewhere then."""
    build = subject.layout.build_dir(name)
    try:
        text = (build / "CMakeCache.txt").read_text(encoding="utf-8", errors="replace")
    except OSError:
        return
    match = _CACHE_HOME.search(text)
    source = subject.root / subject.packages[name].path
    if match and Path(match[1]).resolve() != source.resolve():
        message = f"'{build.name}' was built from '{match[1]}': it will be built anew"
        yield Problem(message, Place(build), f"forge clean packages {name}")


def _listed(names: list[str]) -> str:
    shown = ", ".join(f"'{name}'" for name in names[:_NAMED])
    return f"{shown} and {len(names) - _NAMED} more" if len(names) > _NAMED else shown
