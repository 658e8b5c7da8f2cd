"""Status lines at the bottom of a terminal, drawn by rich; other output scrolls above them.

The main loop stores a new, immutable Progress for each event; rich's thread redraws it several times a
second, so that elapsed times advance between events.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Iterator
from typing import TYPE_CHECKING

from rich.console import Console, ConsoleOptions, RenderResult
from rich.live import Live
from rich.text import Text

from forge.base.colours import palette_of
from forge.base.text import counted, duration
from forge.build.events import Event
from forge.output.console import PLAIN, Screen
from forge.output.reporters import Reporter, Run
from forge.plugins.charts.progress import Progress, expectations

if TYPE_CHECKING:
    from forge.base.colours import Palette

_LINES = 8
"""Maximum number of packages shown."""
_BAR = (10, 30)
"""The minimum and the maximum length of the bar."""
_MINUTE = 60

Line = tuple[tuple[str, str], ...]
"""The parts of a line, each with its style."""


class StatusLines(Reporter):
    """Status lines that are redrawn periodically; packages without lines of their own are counted."""

    def __init__(self, run: Run) -> None:
        """Show the lines."""
        tasks = run.plan.tasks
        unsure = frozenset(name for name, task in tasks.items() if task.conditional)
        self._progress = Progress(
            time.monotonic(), expectations(tasks, run.seconds), len(tasks), unsure=unsure
        )
        self._collapsed = run.collapsed
        no_color = not palette_of(sys.stdout).enabled
        # Ask the terminal for its size: rich would prefer these variables, which do not follow a resized
        # window.
        variables = {name: value for name, value in os.environ.items() if name not in {"COLUMNS", "LINES"}}
        console = Console(highlight=False, soft_wrap=True, no_color=no_color, _environ=variables)
        self._live = Live(self, console=console, transient=True, refresh_per_second=8, redirect_stdout=False)
        self._live.start(refresh=True)
        self.screen = Above(self._live)

    def follow(self, event: Event) -> None:
        """Update the progress; the next redraw shows it."""
        self._progress = self._progress.after(event, time.monotonic())

    def close(self) -> None:
        self._live.stop()

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """Yield the current lines, cut to the current size of the terminal."""
        room = max(1, min(_LINES, options.size.height - 4))
        now = time.monotonic()
        for line in lines(self._progress, now, room, options.size.width, self._collapsed):
            parts = ((text, style) for style, text in line)
            yield Text.assemble(*parts, no_wrap=True, overflow="ellipsis")


start = StatusLines


def lines(
    progress: Progress, now: float, room: int, width: int, collapsed: frozenset[str] = frozenset()
) -> Iterator[Line]:
    """Yield each line; at most `room` packages are shown, those in `collapsed` are counted."""
    yield _head(progress, now, width)
    listed = [running for running in progress.running if running.name not in collapsed]
    shown = [
        (
            running.name,
            running.step if running.share is None else f"{running.step} {running.share:4.0%}",
            _elapsed(now - running.begun),
        )
        for running in listed[:room]
    ]
    widths = [max(map(len, column)) for column in zip(*shown, strict=True)]
    for name, doing, elapsed in shown:
        first, second, third = widths
        yield ("bold", f"  {name:{first}}"), ("", f"  {doing:{second}}  {elapsed:>{third}}")
    if len(listed) > room:
        yield (("dim", f"  and {len(listed) - room} more"),)
    if count := len(progress.running) - len(listed):
        yield (("dim", f"  {counted(count, 'embedded package')}"),)
    if progress.failed:
        yield ("bold red", "  failed: "), ("bold", " ".join(progress.failed))


def _head(progress: Progress, now: float, width: int) -> Line:
    """Return the line for all packages: a bar if it fits, counts, and an estimate."""
    share, left = progress.share(now), progress.left(now)
    words = [
        f"{share:4.0%}",
        f"{len(progress.done)}/{progress.total} packages",
        _elapsed(now - progress.begun),
    ]
    if left is not None:
        rough = f"{max(1, round(left))}s" if left < _MINUTE - 0.5 else duration(round(left))
        words.append(f"{'at least' if progress.unsure else 'about'} {rough} left")
    text = "  ".join(words)
    least, greatest = _BAR
    length = min(greatest, width - len(text) - len("[]  "))
    if length < least:
        return (("bold", text.lstrip()),)
    filled = int(share * length)
    arrow = "=" * filled + ">" * (filled < length)
    return ("", "["), ("green", arrow[:length]), ("", " " * (length - len(arrow)) + "]"), ("bold", f" {text}")


def _elapsed(seconds: float) -> str:
    """Format a duration that is redrawn several times a second, with fewer digits than in a report."""
    return f"{seconds:.1f}s" if seconds < _MINUTE - 0.05 else duration(seconds)


class Above(Screen):
    """Prints above the status lines.

    Each output also redraws them. Without the lock of the redrawing thread, both would count the lines to
    erase before either is written, and the second would erase a line of the output.
    """

    quiet_starts = True

    def __init__(self, live: Live) -> None:
        """Print to the console of a started display."""
        self._console = live.console
        self._lock = live._lock

    def palette(self, *, stderr: bool = False) -> Palette:
        return palette_of(sys.stderr if stderr and not sys.stderr.isatty() else sys.stdout)

    def write(self, content: bytes, *, stderr: bool = False) -> None:
        """Write bytes; output for stderr goes there if it is not a terminal."""
        if stderr and not sys.stderr.isatty():
            PLAIN.write(content, stderr=True)
        else:
            with self._lock:
                self._console.out(content.decode(errors="replace"), end="", highlight=False)
