"""Reporters: plugins that observe a run and report on it at its end, such as `forge build --timings`.

They are entry points of the group 'forge.reporters', which docs/how-to/plugins.md describes.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import field
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from forge.base.errors import Problem, print_warnings
from forge.base.extensions import OWN, REPORTERS, call, find
from forge.base.frozen import frozen
from forge.base.layout import Layout
from forge.build.events import Event
from forge.build.tasks import BuildPlan
from forge.workspace.selection import Query

if TYPE_CHECKING:
    from forge.execution.memory import PackageMemory
    from forge.output.console import Screen
    from forge.workspace.model import Package

Start = Callable[["Run"], "Reporter"]
"""The function `start` of a reporter's module, called before the first package starts."""

_Result = TypeVar("_Result")


@frozen
class Run:
    """Information for reporters about a run of `command`, which is 'build' or 'test'."""

    command: str
    plan: BuildPlan
    layout: Layout
    root: Path
    log_folder: Path | None
    clock: float
    """The monotonic time at which the times of events start."""
    displayed: Callable[[Path], str]
    """Returns a path as the user expects it in a message."""
    query: Query = field(default_factory=Query)
    packages: Mapping[str, Package] = field(default_factory=dict)
    """All packages of the workspace."""
    needs: Mapping[str, Collection[str]] = field(default_factory=dict)
    """The dependencies of packages."""
    seconds: Mapping[str, float] = field(default_factory=dict)
    """The duration of the last build of packages."""
    collapsed: frozenset[str] = frozenset()
    """Packages that get no separate lines unless they fail."""
    say: Callable[[str], None] = print
    """Prints a line at once."""
    variables: Mapping[str, str] = field(default_factory=dict)
    python: Path = Path()
    jobs: int = 0
    warn: Callable[[Iterable[Problem]], None] = print_warnings
    memory: PackageMemory | None = None
    """The memory of the packages, if they are built on this machine."""
    coloured: bool = False
    """Whether forge asked compilers for colours."""


@frozen
class Report:
    """Lines to print before the summary, and events for JSON: name, package if there is one, and members."""

    lines: tuple[str, ...] = ()
    events: tuple[tuple[str, str | None, Mapping[str, object]], ...] = ()


class Reporter:
    """Reports on one run; subclasses override what they need."""

    screen: Screen | None = None
    """Where all output is displayed, None for stdout and stderr."""

    def observe(self, event: Mapping[str, Any]) -> Iterable[str]:
        """Observe an event of docs/reference/events.md in the main thread; return lines to print after it."""
        return ()

    def follow(self, event: Event) -> None:
        """Follow the steps of packages and their output, before lines about the event are printed."""

    def fold(self, title: str, block: str) -> str:
        """Return the output to display of a package that did not fail."""
        return block

    def guard(self, text: str) -> str:
        """Return text to display that quotes output of packages."""
        return text

    def conclude(self, *, complete: bool) -> Report:
        """Return the report after the last package; not `complete` if the run was interrupted."""
        return Report()

    def write(self) -> Iterable[str]:
        """Write files, once the log is complete; return lines to print after the summary."""
        return ()

    def close(self) -> None:
        """Stop observing, whatever happened."""


def find_reporter(name: str) -> Start | None:
    """Return the function that starts a reporter, None for an unknown name; raises ForgeError."""
    module = find(REPORTERS, name, "reporter", ("start",))
    return None if module is None else module.start


def ask(name: str, function: Callable[..., _Result], *arguments: Any) -> _Result:
    """Call a function for a reporter; exceptions of third-party reporters become ForgeErrors."""
    if name in OWN[REPORTERS]:
        return function(*arguments)
    return call(f"the reporter '{name}'", function, *arguments)
