"""What a session passes on to its reporters."""

import time
from dataclasses import replace
from pathlib import Path

from forge.base.layout import Layout
from forge.build.tasks import BuildPlan, Task
from forge.cli.session import open_session
from forge.output.handlers import ReportOptions
from forge.workspace.selection import Query
from tests.packages import package


def test_embedded_packages_are_shown_in_the_first_build_and_when_selected() -> None:
    packages = {n: replace(package(n), embedded=n != "own") for n in ("own", "new", "old", "asked")}
    plan = BuildPlan({n: Task(n, packages[n], Path(), Path(), (), (), "") for n in packages})
    seconds = dict.fromkeys(("own", "old", "asked"), 1.0)
    query = Query(up_to=("asked",), above_depth=(1, ("x",)), end="y")
    assert query.named == {"asked", "x", "y"}
    layout = Layout(Path("build"), Path("install"), None)
    opened = open_session(
        "build",
        plan,
        packages,
        layout,
        ReportOptions(),
        query=query,
        began=time.monotonic(),
        needs={},
        seconds=seconds,
    )
    with opened as session:
        assert session.report.collapsed == {"old"}
