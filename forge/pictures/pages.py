"""Pages about a run, from its events to files in its log folder."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

from forge.files import write_if_changed
from forge.pictures.timing_views import STEP_KINDS, facts, page, trace
from forge.pictures.timings import read_build
from forge.templating import render

if TYPE_CHECKING:
    from pathlib import Path

PAGE, TRACE = "timings.html", "trace.json"


def write_timings(folder: Path) -> None:
    """Write the page and the trace of a build beside its events."""
    with (folder / "events.jsonl").open(encoding="utf-8") as lines:
        build = read_build(lines)
    text = render(
        "html/timings.html.j2",
        title=f"{folder.name}: where the time went",
        page=page(build),
        facts=facts(build),
        kinds=STEP_KINDS,
        trace=TRACE,
    )
    write_if_changed(folder / PAGE, text)
    write_if_changed(folder / TRACE, json.dumps(trace(build)) + "\n")
