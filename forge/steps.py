"""Steps as a person repeats them: a line for a shell, and the environment that it sources."""

from __future__ import annotations

import shlex
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path

    from forge.model import Step, Task

LAST_COMMAND = "last_command"
"""The file on a task's desk with the line that repeats its last step."""


def environment_file(task: Task) -> Path:
    """Return the file on a task's desk that exports what its programs see."""
    return task.build_dir / task.desk / "environment.sh"


def step_line(step: Step, environment: Path | None = None) -> str:
    """Return a step as a line for a shell, in the environment that a file of exports describes."""
    source = f". {shlex.quote(str(environment))} && " if environment else ""
    variables = "".join(f"{name}={shlex.quote(value)} " for name, value in step.env)
    return f"{source}cd {shlex.quote(str(step.cwd))} && {variables}{shlex.join(step.argv)}"
