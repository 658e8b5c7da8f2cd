"""The events of a running build, in the order in which a task emits them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from forge.base.frozen import frozen
from forge.build.model import BuildInputs, BuildRecord

if TYPE_CHECKING:
    from forge.build.tasks import Step


@frozen
class Started:
    """A task started; `inputs` are its build inputs, dependencies included."""

    task: str
    inputs: BuildInputs = BuildInputs()


@frozen
class Fresh:
    """A conditional task turned out to be up to date."""

    task: str


@frozen
class StepStarted:
    """A step of a task started; `environment` contains only the variables that differ from forge's own."""

    task: str
    step: Step
    environment: tuple[tuple[str, str], ...] = ()


@frozen
class StepFinished:
    """A step ended with the exit code of its program (negative: killed by that signal)."""

    task: str
    step: Step
    code: int


@frozen
class Output:
    """Lines printed by a task's program, with their line ends, or a piece of a very long line without one."""

    task: str
    lines: bytes
    stderr: bool


@frozen
class Finished:
    """A task ended. `step` is the one that failed, else `record` is the result; `cache` is a cache remark."""

    task: str
    code: int
    seconds: float
    step: Step | None = None
    record: BuildRecord | None = None
    cache: str = ""


@frozen
class Aborted:
    """A task was stopped before its end because another failed or the user interrupted the build."""

    task: str
    seconds: float


@frozen
class Skipped:
    """A task did not start; `because` is the failed package or 'interrupted'."""

    task: str
    because: str


Event = Fresh | Started | StepStarted | StepFinished | Output | Finished | Aborted | Skipped
