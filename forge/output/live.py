"""Status lines at the bottom of a terminal, drawn by rich; other output scrolls above them.

The main loop stores a new, immutable Progress for each event; rich's thread redraws it several times a
second, so that elapsed times advance between events.
"""

from __future__ import annotations

import os
import re
import sys
import time
from collections.abc import Iterable
from contextlib import contextmanager
from dataclasses import field, replace
from statistics import mean
from typing import TYPE_CHECKING

from forge.base.colours import palette_of
from forge.base.frozen import frozen
from forge.base.text import counted, duration
from forge.build.events import Aborted, Event, Finished, Fresh, Output, Skipped, Started, StepStarted
from forge.output.console import PLAIN, Screen

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from rich.console import Console, ConsoleOptions, RenderResult
    from rich.live import Live

    from forge.base.colours import Palette
    from forge.build.tasks import BuildPlan


_LINES = 8
"""Maximum number of packages shown."""
_BAR = (10, 30)
"""The minimum and the maximum length of the bar."""
_MINUTE = 60

Line = tuple[tuple[str, str], ...]
"""The parts of a line, each with its style."""


def is_wanted(handlers: Mapping[str, bool]) -> bool:
    """Return whether stdout is a capable terminal and the status lines are enabled."""
    prose = handlers["status"] and handlers["console_start_end"] and not handlers["console_direct"]
    dumb = os.environ.get("TERM", "") in {"", "dumb"}
    return prose and sys.stdout.isatty() and not dumb


@contextmanager
def live_view(
    plan: BuildPlan, seconds: Mapping[str, float], *, wanted: bool, collapsed: frozenset[str] = frozenset()
) -> Iterator[View]:
    """Show the status lines during a build; `seconds` contains the duration of earlier builds.

    Running packages in `collapsed` are only counted.
    """
    if not wanted:
        yield View()
        return
    from rich.console import Console
    from rich.live import Live

    no_color = not palette_of(sys.stdout).enabled
    # Ask the terminal for its size: rich would prefer these variables, which do not follow a resized window.
    variables = {name: value for name, value in os.environ.items() if name not in {"COLUMNS", "LINES"}}
    console = Console(highlight=False, soft_wrap=True, no_color=no_color, _environ=variables)
    view = LiveView(plan, seconds, collapsed)
    with Live(view, console=console, transient=True, refresh_per_second=8, redirect_stdout=False) as live:
        view.screen = Above(live)
        yield view


class View:
    """A view without status lines."""

    screen: Screen = PLAIN

    def show(self, event: Event) -> None:
        """Ignore an event."""


class LiveView(View):
    """Status lines that are redrawn periodically."""

    def __init__(
        self, plan: BuildPlan, seconds: Mapping[str, float], collapsed: frozenset[str] = frozenset()
    ) -> None:
        names = list(plan.tasks)
        unsure = frozenset(name for name, task in plan.tasks.items() if task.conditional)
        self._progress = Progress(time.monotonic(), expectations(names, seconds), len(names), unsure=unsure)
        self._collapsed = collapsed

    def show(self, event: Event) -> None:
        """Update the progress; the next redraw shows it."""
        self._progress = self._progress.after(event, time.monotonic())

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """Yield the current lines, cut to the current size of the terminal."""
        from rich.text import Text

        room = max(1, min(_LINES, options.size.height - 4))
        now = time.monotonic()
        for line in lines(self._progress, now, room, options.size.width, self._collapsed):
            parts = ((text, style) for style, text in line)
            yield Text.assemble(*parts, no_wrap=True, overflow="ellipsis")


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


_EARLY = 2.0
"""Seconds before the first estimate."""
_LONGEST_SECONDS = 1e7
"""An estimate above this comes from a damaged record of durations."""
_NEWEST_LINES = 8
"""The number of lines at the end of output that are searched for a count."""
_ALMOST = 0.99
_COUNT = re.compile(
    rb"^\[\s*(?P<done>\d{1,9})/(?P<all>\d{1,9})\b"  # ninja: [3/12] Building
    rb"|^\s*(?P<test>\d{1,9})/(?P<tests>\d{1,9}) Test\s+#"  # ctest: 1/4 Test #1: talk
    rb"|^\[\s*(?P<make>\d{1,3})%\]"  # make: [ 25%] Building
    rb"|\[\s*(?P<pytest>\d{1,3})%\]\s*$"  # pytest: test_talk.py ..F [ 25%]
)


@frozen
class Running:
    """A package that is being built: its start time, its current step, and the completed share of both."""

    name: str
    begun: float
    step: str = ""
    share: float | None = None
    """The completed share of the step, from 0 to 1, as reported by its program; None if it reports none."""
    made: float = 0.0
    """The completed share of the package as far as it is known."""


@frozen
class Progress:
    """The progress of a build; all times are seconds of one clock.

    `expected` contains the expected duration of each package; it is empty if no duration is known.
    """

    begun: float
    expected: Mapping[str, float] = field(default_factory=dict)
    total: int = 0
    running: tuple[Running, ...] = ()
    done: frozenset[str] = frozenset()
    failed: tuple[str, ...] = ()
    unsure: frozenset[str] = frozenset()
    """Packages that are built only if one of their dependencies changes."""
    needless: frozenset[str] = frozenset()
    """Packages that turned out to be up to date, or that will not be started."""

    def after(self, event: Event, now: float) -> Progress:
        name = event.task
        match event:
            case Started():
                running = (*self.running, Running(name, now))
                return replace(self, running=running, unsure=self.unsure - {name})
            case StepStarted(_, step):
                return self._with(name, step=step.label, share=None)
            case Output(_, lines, stderr):
                share = None if stderr else counted_share(lines)
                return self if share is None else self._with(name, share=share, made=share)
            case Finished() | Aborted():
                fails = isinstance(event, Finished) and event.code != 0
                failed = (*self.failed, name) if fails else self.failed
                return replace(
                    self,
                    running=tuple(running for running in self.running if running.name != name),
                    done=self.done | {name},
                    failed=failed,
                )
            case Fresh() | Skipped():
                unsure = self.unsure - {name}
                return replace(self, done=self.done | {name}, needless=self.needless | {name}, unsure=unsure)
            case _:
                return self

    def share(self, now: float) -> float:
        """Return the completed share of all packages, from 0 to 1; 1 only if none is left."""
        if len(self.done) >= self.total:
            return 1.0
        total, done = self._work(now, self.needless)
        if total <= 0:
            total, done = self.total, len(self.done) + sum(each.made for each in self.running)
        return min(_ALMOST, done / total)

    def left(self, now: float) -> float | None:
        """Estimate the remaining seconds from the pace so far; None while an estimate is impossible.

        Packages that may turn out to be up to date do not count: if there are any, the estimate is a lower
        bound.
        """
        passed = now - self.begun
        total, done = self._work(now, self.needless | self.unsure)
        if passed < _EARLY or done <= 0:
            return None
        left = (total - done) * passed / done
        return max(0.0, left) if left < _LONGEST_SECONDS else None

    def _work(self, now: float, left_out: frozenset[str]) -> tuple[float, float]:
        """Return the expected seconds of the packages not `left_out`, and how many of these are done."""
        worth = {name: cost for name, cost in self.expected.items() if name not in left_out}
        done_seconds = sum(cost for name, cost in worth.items() if name in self.done)
        for running in self.running:
            cost = worth.get(running.name, 0.0)
            done_seconds += cost * running.made if running.made else min(now - running.begun, cost)
        return sum(worth.values()), done_seconds

    def _with(self, name: str, *, made: float = 0.0, **changes: object) -> Progress:
        """Return the progress with changes of a running package, whose completed share never decreases."""
        running = (
            replace(each, made=max(each.made, made), **changes) if each.name == name else each  # type: ignore[arg-type]
            for each in self.running
        )
        return replace(self, running=tuple(running))


def counted_share(output: bytes) -> float | None:
    """Return the completed share according to the newest count of a build or test tool, None if unknown."""
    for line in reversed(output.rsplit(b"\n", _NEWEST_LINES)[-_NEWEST_LINES:]):
        match = _COUNT.search(line)
        if match is None:
            continue
        percent = match["make"] or match["pytest"]
        done, every = (
            (percent, 100) if percent else (match["done"] or match["test"], match["all"] or match["tests"])
        )
        if int(every):
            return min(1.0, int(done) / int(every))
    return None


def expectations(names: Iterable[str], seconds: Mapping[str, float]) -> Mapping[str, float]:
    """Return the expected duration of each package: that of its last build, else the average of the others.

    Empty if no duration is known.
    """
    durations = {name: seconds[name] for name in names if name in seconds}
    if not durations:
        return {}
    usual = mean(durations.values())
    return {name: durations.get(name, usual) for name in names}
