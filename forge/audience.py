"""Who hears what happens in a run: its log, the live lines, the report for people, the feed for tools."""

from __future__ import annotations

from typing import TYPE_CHECKING

from forge.frozen import frozen

if TYPE_CHECKING:
    from forge.feed import Feed
    from forge.live import View
    from forge.model import Event
    from forge.reporting import Report
    from forge.transcript import Transcript


@frozen
class Audience:
    """All four, in the order in which they are told."""

    transcript: Transcript
    view: View
    report: Report
    feed: Feed

    def hear(self, event: Event) -> None:
        """Tell of an event: first into the log, which is read when nothing else came out."""
        self.transcript.write(event)
        self.view.show(event)
        self.report.show(event)
        self.feed.write(event, self.report)
