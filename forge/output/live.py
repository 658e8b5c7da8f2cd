"""Status lines at the bottom of a terminal, drawn by rich; other output scrolls above them.

The main loop stores a new, immutable Progress for each event; rich's thread redraws it several times a
second, so that elapsed times advance between events.
"""

from __future__ import annotations

import os
import sys
import time
from contextlib import contextmanager
from typing import TYPE_CHECKING

from forge.base.text import duration
from forge.output.console import PLAIN
from forge.output.progress import Progress, expectations

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from rich.console import Console, ConsoleOptions, RenderResult

    from forge.build.events import Event
    from forge.build.tasks import BuildPlan
    from forge.output.console import Screen

_LINES = 8
"""Maximum number of packages shown."""


def is_wanted(handlers: Mapping[str, bool]) -> bool:
    """Tell whether stdout is a capable terminal and the status lines are enabled."""
    prose = handlers["status"] and handlers["console_start_end"] and not handlers["console_direct"]
    dumb = os.environ.get("TERM", "") in {"", "dumb"} or "NO_COLOR" in os.environ
    return prose and sys.stdout.isatty() and not dumb


@contextmanager
def live_view(plan: BuildPlan, seconds: Mapping[str, float], *, wanted: bool) -> Iterator[View]:
    """Show the status lines during a build; `seconds` contains the duration of earlier builds."""
    if not wanted:
        yield View()
        return
    from rich.console import Console  # noqa: PLC0415  (only needed in a terminal)
    from rich.live import Live  # noqa: PLC0415

    console = Console(highlight=False, soft_wrap=True)
    view = LiveView(plan, seconds, console)
    with Live(view, console=console, transient=True, refresh_per_second=8, redirect_stdout=False):
        yield view


class View:
    """A view without status lines."""

    screen: Screen = PLAIN

    def show(self, event: Event) -> None:
        """Ignore an event."""


class LiveView(View):
    """Status lines that are redrawn periodically."""

    def __init__(self, plan: BuildPlan, seconds: Mapping[str, float], console: Console) -> None:
        """Start with no running packages."""
        names = list(plan.tasks)
        self.screen = _Above(console)
        unsure = frozenset(name for name, task in plan.tasks.items() if task.conditional)
        self._progress = Progress(time.monotonic(), expectations(names, seconds), len(names), unsure=unsure)

    def show(self, event: Event) -> None:
        """Update the progress; the next redraw shows it."""
        self._progress = self._progress.after(event, time.monotonic())

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """Yield the current lines, cut to the current size of the terminal."""
        from rich.text import Text  # noqa: PLC0415

        room = max(1, min(_LINES, options.size.height - 4))
        for style, line in lines(self._progress, time.monotonic(), room):
            yield Text(line, style=style, no_wrap=True, overflow="ellipsis")


def lines(progress: Progress, now: float, room: int) -> Iterator[tuple[str, str]]:
    """Yield the style and text of each line; at most `room` packages are shown."""
    left = progress.left(now)
    words = [f"[{len(progress.done)}/{progress.total}]", duration(now - progress.begun)]
    if left is not None:
        rest = duration(left) if left < 1 else duration(round(left))
        words.append(f"{'at least' if progress.unsure else 'about'} {rest} left")
    yield "bold", "  ".join(words)
    shown = progress.running[:room]
    width = max((len(running.name) for running in shown), default=0)
    for running in shown:
        yield "", f"  {running.name:{width}}  {running.step:8}  {duration(now - running.begun)}"
    if len(progress.running) > room:
        yield "dim", f"  and {len(progress.running) - room} more"
    if progress.failed:
        yield "red", f"  failed: {' '.join(progress.failed)}"


class _Above:
    """Prints above the status lines."""

    quiet_starts = True

    def __init__(self, console: Console) -> None:
        self._console = console

    def write(self, content: bytes, *, stderr: bool = False) -> None:
        """Write bytes; those for stderr go there if it is not a terminal."""
        if stderr and not sys.stderr.isatty():
            PLAIN.write(content, stderr=True)
        else:
            self._console.out(content.decode(errors="replace"), end="", highlight=False)
