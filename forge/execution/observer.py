"""Observe the steps of a package: load the library of forge.engine into their processes.

Without a compiler nothing is observed, and `forge.build.prefix` relies on the install manifests alone.
"""

from __future__ import annotations

from contextlib import nullcontext
from typing import TYPE_CHECKING

from forge.base.frozen import frozen
from forge.build.observed_writes import append
from forge.build.prefix import guarded_links, written_log
from forge.engine.observation import LINKS_VARIABLE, LOG_VARIABLE, STAGE_VARIABLE
from forge.engine.observer import observed

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from forge.base.layout import Layout
    from forge.build.tasks import Step, Task


@frozen
class Observer:
    """Sets the variables that make the steps of tasks log; without a `library`, only steps of forge do."""

    layout: Layout
    library: Path | None

    def surroundings(
        self, task: Task, _step: Step, variables: Mapping[str, str], _is_stopped: object
    ) -> nullcontext[tuple[Mapping[str, str], bool]]:
        """Yield the environment of a step, and whether the library is loaded."""
        environment = {
            **observed(variables, self.library, written_log(task.name, self.layout)),
            LINKS_VARIABLE: str(guarded_links(task.name, self.layout)),
        }
        if task.stage:
            environment[STAGE_VARIABLE] = str(task.stage)
        return nullcontext((environment, self.library is not None))


def note_step(variables: Mapping[str, str], process: int, step: Step) -> None:
    """Log the start of a step whose environment names the log."""
    append(variables[LOG_VARIABLE], b"P%d %s" % (process, step.kind.value.encode()))
