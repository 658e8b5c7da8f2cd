"""Read the JSON events of the forge on a worker for one package."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

from forge.base.frozen import frozen
from forge.build.events import Output, StepFinished, StepStarted
from forge.build.tasks import Step

if TYPE_CHECKING:
    from collections.abc import Iterator

    from forge.build.events import Event
    from forge.build.tasks import Task


@frozen
class Verdict:
    """The result of a package on a worker: exit code, failed step, and the cache's remark."""

    code: int
    step: Step | None = None
    cache: str = ""


class FeedReader:
    """Converts JSON lines into events of the local task, with local steps and paths."""

    def __init__(self, task: Task, there: str, here: str) -> None:
        """Start before the first line; paths below `there` are replaced by paths below `here`."""
        self.verdict: Verdict | None = None
        self.others: dict[str, int] = {}
        """The exit codes of other packages that were built there."""
        self._task = task
        self._steps = {step.label: step for step in task.steps}
        self._there, self._here = there, here
        self._partial_line = b""

    def read(self, lines: bytes) -> Iterator[Event]:
        """Yield the events of the task in a piece of output."""
        *complete_lines, self._partial_line = (self._partial_line + lines).split(b"\n")
        for line in complete_lines:
            try:
                event: dict[str, Any] = json.loads(line.replace(self._there.encode(), self._here.encode()))
            except ValueError:
                continue
            if event.get("package") == self._task.name:
                yield from self._events(event)
            elif event.get("event") == "Finished" and event.get("cache") != "from the cache":
                self.others[event["package"]] = event["code"]

    def _events(self, event: dict[str, Any]) -> Iterator[Event]:
        name = self._task.name
        match event["event"]:
            case "StepStarted":
                yield StepStarted(name, self._step(event))
            case "StepFinished":
                yield StepFinished(name, self._step(event), event["code"])
            case "Output":
                yield Output(name, event["line"].encode(), stderr=event["stderr"])
            case "Finished":
                step = self._step(event) if event.get("step") else None
                self.verdict = Verdict(event["code"], step, event.get("cache", ""))
            case _:
                pass

    def _step(self, event: dict[str, Any]) -> Step:
        """Return the local step with this label, which can be repeated by hand."""
        known = self._steps.get(event["step"])
        return known or Step(event["step"], tuple(event.get("argv", ())), self._task.build_dir)
