"""What the forge on a worker says of one package, read from its lines of JSON."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

from forge.frozen import frozen
from forge.model import Output, Step, StepFinished, StepStarted

if TYPE_CHECKING:
    from collections.abc import Iterator

    from forge.model import Event, Task


@frozen
class Verdict:
    """How a package ended there: its code, the step that failed, and what the cache had to do with it."""

    code: int
    step: Step | None = None
    cache: str = ""


class FeedReader:
    """Turns lines into events of the task here, with our own steps and paths."""

    def __init__(self, task: Task, there: str, here: str) -> None:
        """Begin before the first line; paths below `there` are told as below `here`."""
        self.verdict: Verdict | None = None
        self.others: dict[str, int] = {}
        """Other packages that were built there, each with its exit code."""
        self._task = task
        self._steps = {step.label: step for step in task.steps}
        self._there, self._here = there, here
        self._rest = b""

    def read(self, lines: bytes) -> Iterator[Event]:
        """Yield what a piece of output tells of the task."""
        *whole, self._rest = (self._rest + lines).split(b"\n")
        for line in whole:
            try:
                said: dict[str, Any] = json.loads(line.replace(self._there.encode(), self._here.encode()))
            except ValueError:
                continue
            if said.get("package") == self._task.name:
                yield from self._events(said)
            elif said.get("event") == "Finished" and said.get("cache") != "from the cache":
                self.others[said["package"]] = said["code"]

    def _events(self, said: dict[str, Any]) -> Iterator[Event]:
        name = self._task.name
        match said["event"]:
            case "StepStarted":
                yield StepStarted(name, self._step(said))
            case "StepFinished":
                yield StepFinished(name, self._step(said), said["code"])
            case "Output":
                yield Output(name, said["line"].encode(), stderr=said["stderr"])
            case "Finished":
                step = self._step(said) if said.get("step") else None
                self.verdict = Verdict(said["code"], step, said.get("cache", ""))
            case _:
                pass

    def _step(self, said: dict[str, Any]) -> Step:
        """Return our own step of that label, which people here can repeat."""
        known = self._steps.get(said["step"])
        return known or Step(said["step"], tuple(said.get("argv", ())), self._task.build_dir)
