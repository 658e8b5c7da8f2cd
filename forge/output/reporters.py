"""Passes events of a run to all reporters: log, live view, console, JSON."""

from __future__ import annotations

from typing import TYPE_CHECKING

from forge.base.frozen import frozen

if TYPE_CHECKING:
    from forge.build.events import Event
    from forge.output.console import ConsoleReporter
    from forge.output.json_events import JsonEvents
    from forge.output.live import View
    from forge.output.logs import LogWriter


@frozen
class Reporters:
    """The reporters, in the order in which they are notified."""

    log_writer: LogWriter
    view: View
    report: ConsoleReporter
    json_events: JsonEvents

    def notify(self, event: Event) -> None:
        """Pass on an event, first to the log, which must be complete if a later reporter fails."""
        self.log_writer.write(event)
        self.view.show(event)
        self.report.show(event)
        self.json_events.write(event, self.report)
