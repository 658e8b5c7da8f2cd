"""Writes the report of a build into its log folder."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

from forge.base.files import write_if_changed
from forge.base.templating import render
from forge.output.charts.timing_views import STEP_KINDS, facts, page, trace
from forge.output.charts.timings import read_build

if TYPE_CHECKING:
    from pathlib import Path

PAGE, TRACE = "timings.html", "trace.json"


def write_timings(folder: Path) -> None:
    """Write the report and the trace of a build next to its events."""
    with (folder / "events.jsonl").open(encoding="utf-8") as lines:
        build = read_build(lines)
    text = render(
        "html/timings.html.j2",
        title=f"{folder.name}: build times",
        page=page(build),
        facts=facts(build),
        kinds=STEP_KINDS,
        trace=TRACE,
    )
    write_if_changed(folder / PAGE, text)
    write_if_changed(folder / TRACE, json.dumps(trace(build)) + "\n")
