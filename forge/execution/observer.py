"""Observe the steps of a package: load the library of forge.engine into their processes.

Without a compiler nothing is observed, and `forge.build.prefix` relies on the install manifests alone.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

from forge.base.frozen import frozen
from forge.build.observed_writes import append
from forge.build.prefix import guarded_links, written_log
from forge.engine.observation import LINKS_VARIABLE, LOG_VARIABLE, STAGE_VARIABLE
from forge.engine.observer import compile_library, observed

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from forge.base.layout import Layout
    from forge.build.tasks import Step, Task


class StepObserver(Protocol):
    """Prepares the environment of steps so that their actions are logged."""

    def variables(self, task: Task, variables: Mapping[str, str], /) -> Mapping[str, str]:
        """Return the environment of a step with the variables added."""

    def note_process(self, variables: Mapping[str, str], process: int, step: Step, /) -> None:
        """Log the start of a step."""


def note_step(variables: Mapping[str, str], process: int, step: Step) -> None:
    """Log the start of a step in an environment from `observed`."""
    append(variables[LOG_VARIABLE], b"P%d %s" % (process, step.kind.value.encode()))


@frozen
class Observer:
    """Sets the variables that make the steps of tasks log; without a `library`, only steps of forge do."""

    layout: Layout
    library: Path | None

    def variables(self, task: Task, variables: Mapping[str, str]) -> Mapping[str, str]:
        environment = {
            **observed(variables, self.library, written_log(task.name, self.layout)),
            LINKS_VARIABLE: str(guarded_links(task.name, self.layout)),
        }
        return {**environment, STAGE_VARIABLE: str(task.stage)} if task.stage else environment

    def note_process(self, variables: Mapping[str, str], process: int, step: Step) -> None:
        if self.library is not None and str(self.library) in variables.get("LD_PRELOAD", ""):
            note_step(variables, process, step)


def open_observer(
    layout: Layout, folder: Path, variables: Mapping[str, str], *, unobserved: bool = False
) -> Observer:
    """Return the observer of a build, with its library in `folder`; without one if `unobserved`.

    Programs for another machine cannot load it.
    """
    return Observer(layout, None if layout.target or unobserved else compile_library(folder, variables))
