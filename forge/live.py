"""The lines at the bottom of a terminal that say what runs now, drawn by rich; what is printed scrolls above.

The loop hands over a new, frozen Progress with each event; rich's own thread draws the latest one a few
times a second, so that the seconds run on while nothing happens.
"""

from __future__ import annotations

import os
import sys
import time
from contextlib import contextmanager
from typing import TYPE_CHECKING

from forge.durations import duration
from forge.progress import Progress, expectations
from forge.reporting import PLAIN

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from rich.console import Console, ConsoleOptions, RenderResult

    from forge.model import BuildPlan, Event
    from forge.reporting import Screen

_LINES = 8
"""The most packages that are shown at a time."""


def is_wanted(handlers: Mapping[str, bool]) -> bool:
    """Tell if somebody looks at a terminal that can redraw its lines, and wants to see them move."""
    prose = handlers["status"] and handlers["console_start_end"] and not handlers["console_direct"]
    dumb = os.environ.get("TERM", "") in {"", "dumb"} or "NO_COLOR" in os.environ
    return prose and sys.stdout.isatty() and not dumb


@contextmanager
def live_view(plan: BuildPlan, seconds: Mapping[str, float], *, wanted: bool) -> Iterator[View]:
    """Show a build while it goes on; `seconds` is how long packages took the last time."""
    if not wanted:
        yield View()
        return
    from rich.console import Console  # noqa: PLC0415  (only who looks on pays for it)
    from rich.live import Live  # noqa: PLC0415

    console = Console(highlight=False, soft_wrap=True)
    view = LiveView(plan, seconds, console)
    with Live(view, console=console, transient=True, refresh_per_second=8, redirect_stdout=False):
        yield view


class View:
    """Where nobody looks on: what is to be printed is printed, events need no picture."""

    screen: Screen = PLAIN

    def show(self, event: Event) -> None:
        """Take note of an event."""


class LiveView(View):
    """What runs now, as lines that are drawn again and again."""

    def __init__(self, plan: BuildPlan, seconds: Mapping[str, float], console: Console) -> None:
        """Begin with nothing running."""
        names = list(plan.tasks)
        self.screen = _Above(console)
        self._progress = Progress(time.monotonic(), expectations(names, seconds), len(names))

    def show(self, event: Event) -> None:
        """Take note of an event; the next drawing shows it."""
        self._progress = self._progress.after(event, time.monotonic())

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """Yield the lines of this moment, cut to the terminal's size of this moment."""
        from rich.text import Text  # noqa: PLC0415

        room = max(1, min(_LINES, options.size.height - 4))
        for style, line in lines(self._progress, time.monotonic(), room):
            yield Text(line, style=style, no_wrap=True, overflow="ellipsis")


def lines(progress: Progress, now: float, room: int) -> Iterator[tuple[str, str]]:
    """Yield the style and the text of each line; at most `room` packages are shown."""
    left = progress.left(now)
    words = [f"[{len(progress.done)}/{progress.total}]", duration(now - progress.begun)]
    if left is not None:
        words.append(f"about {duration(left) if left < 1 else duration(round(left))} left")
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
    """Prints above the lines that move."""

    quiet_starts = True

    def __init__(self, console: Console) -> None:
        self._console = console

    def write(self, content: bytes, *, stderr: bool = False) -> None:
        """Write bytes, those for stderr there if that is not this terminal."""
        if stderr and not sys.stderr.isatty():
            PLAIN.write(content, stderr=True)
        else:
            self._console.out(content.decode(errors="replace"), end="", highlight=False)
