"""What surrounds the steps of a task: the environment they see, and what follows a success."""

from __future__ import annotations

import os
import sys
from typing import TYPE_CHECKING

from forge import installation
from forge.model import RUN_KINDS
from forge.runner import ProcessRunner
from forge.sourcing import build_environment

if TYPE_CHECKING:
    from collections.abc import Mapping

    from forge.interpreter import Interpreter
    from forge.layout import Layout
    from forge.model import Task
    from forge.provision import Provision


def job_runner(
    provision: Provision,
    layout: Layout,
    interpreter: Interpreter,
    variables: Mapping[str, str],
) -> ProcessRunner:
    """Return a runner whose tasks see their needs' environment on top of `variables`."""

    def environment(task: Task) -> Mapping[str, str]:
        below = [(need, layout.prefix(need)) for need in task.needs]
        found = build_environment(below, variables)
        found["FORGE_COMMAND"] = f"{sys.executable};-m;forge"
        found["CMAKE_PREFIX_PATH"] = _cmake_prefix_path(found, variables)
        return {name: value for name, value in found.items() if value or name in variables}

    def begin(task: Task) -> None:
        installation.uninstall_markers(task.name, layout)

    def install(task: Task) -> None:
        needs = set(task.package.manifest.names(RUN_KINDS))
        # A name that an embedded package answers to is recorded with the package it stands for.
        needs |= {need for need in provision.needs[task.name] if provision.packages[need].embedded}
        installation.install_package(task.package, layout, tuple(sorted(needs)), interpreter)

    return ProcessRunner(environment, begin, install)


def _cmake_prefix_path(found: Mapping[str, str], variables: Mapping[str, str]) -> str:
    """Return CMAKE_PREFIX_PATH with the underlays of AMENT_PREFIX_PATH, which CMake does not know."""
    paths = found.get("CMAKE_PREFIX_PATH", "").split(os.pathsep)
    paths += variables.get("AMENT_PREFIX_PATH", "").split(os.pathsep)
    return os.pathsep.join(dict.fromkeys(filter(None, paths)))
