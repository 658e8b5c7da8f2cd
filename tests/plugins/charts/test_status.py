"""Output above the status lines is never erased."""

import io
from collections.abc import Callable, Iterable
from threading import Event, Thread

from rich.console import Console, ConsoleOptions, RenderableType
from rich.live import Live
from rich.segment import Segment

from forge.plugins.charts.status import Above


class SlowConsole(Console):
    """Calls a function after the lines to erase are counted, and before anything is drawn."""

    counted: Callable[[], None] | None = None

    def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterable[Segment]:
        """Call the function once."""
        counted, self.counted = self.counted, None
        if counted:
            counted()
        return super().render(renderable, options)


def test_status_lines_are_not_redrawn_while_output_is_written() -> None:
    """When a package has ended, there is one line less, and a line of output would be erased."""
    console = SlowConsole(file=io.StringIO(), force_terminal=True)
    started, redrawn = Event(), Event()

    def redraw() -> None:  # as the thread of rich does
        started.set()
        with live._lock:
            live.refresh()
        redrawn.set()

    thread = Thread(target=redraw)

    def overtake() -> None:
        thread.start()
        started.wait()
        assert not redrawn.wait(0.1)

    with Live("status", console=console, auto_refresh=False) as live:
        console.counted = overtake
        Above(live).write(b"Finished\n")
        thread.join()
    assert redrawn.is_set()
