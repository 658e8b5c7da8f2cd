"""Checks underlays, environment variables and results of earlier builds."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping
from pathlib import Path

from forge.base.distributions import VARIABLE
from forge.base.env_vars import expand_home
from forge.base.errors import HostError, Location, Problem
from forge.base.extensions import OPTIONS, own_plugin
from forge.base.files import text_or_nothing
from forge.base.layout import INSTALL_STATE_FILE, LAYOUT_MARKER
from forge.base.text import listed
from forge.build.folder_marks import foreign_build, other_layout
from forge.environment.install_state import recorded_underlays, underlays_of
from forge.environment.prefixes import SYSTEM, installed_packages, provider
from forge.plugins.doctor.model import CheckContext, CheckResult
from forge.toolchain.interpreter import find_interpreter
from forge.workspace.resolve import is_ros_name, resembles_ros_name

_PYTHON_FOLDER = re.compile(r"python(\d+)\.(\d+)")
_PATHS = ("CMAKE_PREFIX_PATH", "PYTHONPATH", "LD_LIBRARY_PATH")
_FILES = ("COLCON_DEFAULTS_FILE", "COLCON_PYTHON_EXECUTABLE", "COLCON_HOME", "CMAKE_COMMAND", "CTEST_COMMAND")
_SCRIPT_VARIABLES = ("AMENT_CURRENT_PREFIX", "COLCON_CURRENT_PREFIX")
_CACHE_HOME = re.compile(r"^CMAKE_HOME_DIRECTORY:INTERNAL=(.*)$", re.MULTILINE)


def underlays(subject: CheckContext) -> CheckResult:
    """Check that each sourced workspace exists, is complete, and in order."""
    chain = subject.underlays.chain
    warnings: list[Problem] = []
    if advice := own_plugin(OPTIONS, "advice-surroundings"):
        install, rosdistro = subject.layout.install, subject.variables.get(VARIABLE, "")
        warnings += advice.about_underlays(install, subject.variables, subject.underlays, rosdistro)
    notes: list[Problem] = []
    sourced = {root.resolve() for root in chain}
    for root in chain:
        if not any(root.glob("local_setup.*")) and not any(root.glob("setup.*")):
            hint = "rebuild that workspace, and source it in a new terminal"
            message = f"the underlay '{root}' has no setup scripts: its build did not complete"
            warnings.append(Problem(message, hint=hint))
        # It was built without a package although all its underlays are sourced: the build did not need the
        # package.
        is_complete = all(below.resolve() in sourced for below in underlays_of(root))
        (notes if is_complete else warnings).extend(_missing_dependencies(root, subject))
    for place, root in enumerate(chain):
        for other in recorded_underlays(root):
            if other in chain[place + 1 :]:
                message = f"'{root}' was built on '{other}', but is sourced before it"
                warnings.append(Problem(message, hint=f"in a new terminal, source '{other}' first"))
    summary = ", ".join(f"{root} ({_tool_of(root)})" for root in chain) or "none sourced"
    return CheckResult("underlays", summary, warnings=tuple(warnings), notes=tuple(notes))


def environment(subject: CheckContext) -> CheckResult:
    """Find variables left over from another ROS, workspace or Python."""
    variables = subject.surroundings
    warnings = [
        *_other_ros(variables),
        *_other_python(variables, subject),
        *_missing_paths(variables),
    ]
    for name in _SCRIPT_VARIABLES:
        if name in variables:
            message = f"'{name}' is set, but only running setup scripts should set it"
            warnings.append(Problem(message, hint=f"unset {name}"))
    names = sorted(name for name in variables if name.startswith(("AMENT_", "COLCON_", "ROS_", "FORGE_")))
    return CheckResult("environment", " ".join(names) or "no ROS variables are set", warnings=tuple(warnings))


def results(subject: CheckContext) -> CheckResult:
    """Check whether folders of earlier builds belong to forge and were not moved."""
    layout = subject.layout
    errors = [problem for problem in (foreign_build(layout), other_layout(layout)) if problem]
    if layout.install.exists() and not layout.install.is_dir():
        errors.append(Problem(f"the install folder '{layout.install}' is a file", hint="remove it"))
    notes = []
    for name, package in subject.packages.items():
        build, source = layout.build_dir(name), subject.root / package.path
        match = _CACHE_HOME.search(text_or_nothing(build / "CMakeCache.txt"))
        if match and Path(match[1]).resolve() != source.resolve():
            message = f"'{build.name}' was built from '{match[1]}' and will be rebuilt"
            notes.append(Problem(message, Location(build), layout.command(f"clean packages {name}")))
    built = (layout.build / ".built_by").is_file()
    summary = f"{layout.build.name}, {layout.install.name}" if built else "nothing built yet"
    return CheckResult("results", summary, tuple(errors), notes=tuple(notes))


def _tool_of(root: Path) -> str:
    if (root / INSTALL_STATE_FILE).is_file():
        return "forge"
    if (root / LAYOUT_MARKER).is_file():
        return "colcon"
    return "catkin" if (root / "_setup_util.py").is_file() else "a distribution"


def _missing_dependencies(root: Path, subject: CheckContext) -> Iterator[Problem]:
    packages = installed_packages(root)
    # The packages of a distribution come from many sources, so fewer of their names are certain.
    is_package = resembles_ros_name if (root / LAYOUT_MARKER).is_file() else is_ros_name
    available_names = {
        package.name for other in subject.underlays.chain for package in installed_packages(other)
    }
    available_names.update(subject.resolution.packages if subject.resolution else ())
    users_by_need: dict[str, list[str]] = {}
    for package in packages:
        for need in package.needs - available_names:
            # The indexes also contain rosdep keys, which only differ from packages in their spelling.
            if is_package(need) and not provider(need, subject.underlays, SYSTEM):
                users_by_need.setdefault(need, []).append(package.name)
    for need, users in sorted(users_by_need.items()):
        hint = f"source the workspace that contains '{need}' before '{root}', or rebuild '{root}'"
        message = f"{listed(sorted(users))} in '{root}' needs '{need}', which no sourced underlay contains"
        yield Problem(message, hint=hint)


def _other_ros(variables: Mapping[str, str]) -> Iterator[Problem]:
    new = "open a new terminal, and source only the underlays of this workspace"
    if variables.get("ROS_VERSION", "2") != "2" or "ROS_PACKAGE_PATH" in variables:
        yield Problem("the environment is for ROS 1", hint=f"{new}; check ~/.bashrc, too")
    entries = variables.get("AMENT_PREFIX_PATH", "").split(os.pathsep)
    distros = sorted({match[1] for entry in entries if (match := re.match(r"/opt/ros/(\w+)", entry))})
    distro = variables.get("ROS_DISTRO")
    if len(distros) > 1:
        yield Problem(f"several ROS distributions are sourced: {listed(distros)}", hint=new)
    elif distros and distro and distro not in distros:
        yield Problem(f"'ROS_DISTRO' is '{distro}', but '/opt/ros/{distros[0]}' is sourced", hint=new)


def _other_python(variables: Mapping[str, str], subject: CheckContext) -> Iterator[Problem]:
    if variables.get("PYTHONHOME"):
        yield Problem(f"'PYTHONHOME' is set to '{variables['PYTHONHOME']}'", hint="unset PYTHONHOME")
    try:
        version = find_interpreter(
            subject.python, variables, subject.underlays.chain, root=subject.root
        ).version
    except HostError:
        return
    others = [
        entry
        for entry in variables.get("PYTHONPATH", "").split(os.pathsep)
        if (match := _PYTHON_FOLDER.search(entry)) and (int(match[1]), int(match[2])) != version
    ]
    if others:
        hint = "open a new terminal, or build with '--python' for that version"
        message = f"'PYTHONPATH' contains {listed(others)} for another python than {version[0]}.{version[1]}"
        yield Problem(message, hint=hint)
    conda = variables.get("CONDA_PREFIX")
    if conda and Path(conda, "bin") in map(Path, variables.get("PATH", "").split(os.pathsep)[:2]):
        hint = "run 'conda deactivate', unless you want to use its compilers and libraries"
        yield Problem(f"conda is active in '{conda}'", hint=hint)


def _missing_paths(variables: Mapping[str, str]) -> Iterator[Problem]:
    """Yield variables that name missing files or folders; lost_underlays checks two others."""
    for name in _PATHS:
        entries = dict.fromkeys(filter(None, variables.get(name, "").split(os.pathsep)))
        missing = [entry for entry in entries if not os.path.lexists(entry)]
        if missing:
            hint = "if it was removed after sourcing, continue in a new terminal"
            yield Problem(f"'{name}' names {listed(missing)}, which does not exist", hint=hint)
    for name in _FILES:
        value = variables.get(name)
        if value and os.sep in value and not os.path.lexists(expand_home(value)):
            yield Problem(f"'{name}' names '{value}', which does not exist", hint=f"unset {name}")
