"""Shell command lines that repeat a step by hand in its environment."""

from __future__ import annotations

import shlex
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path

    from forge.build.tasks import Step, Task

LAST_COMMAND = "last_command"
"""The file in a task's scratch folder with the command that repeats its last step."""


def environment_file(task: Task) -> Path:
    """Return the file in a task's scratch folder that exports the environment of its steps."""
    return task.build_dir / task.scratch_dir / "environment.sh"


def step_line(step: Step, environment: Path | None = None) -> str:
    """Return a shell command that runs a step, after sourcing the file `environment` if given."""
    source = f". {shlex.quote(str(environment))} && " if environment else ""
    variables = "".join(f"{name}={shlex.quote(value)} " for name, value in step.env)
    return f"{source}cd {shlex.quote(str(step.cwd))} && {variables}{shlex.join(step.argv)}"
