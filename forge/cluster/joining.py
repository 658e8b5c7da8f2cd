"""Where a build meets a cluster: from the options to the line, from the line to a runner."""

from __future__ import annotations

import contextlib
import sys
from typing import TYPE_CHECKING

from forge.cluster.connection import connected
from forge.cluster.model import Terms
from forge.errors import EnvironmentFault, Problem

if TYPE_CHECKING:
    import argparse
    from collections.abc import Iterator

    from forge.cluster.line import Line
    from forge.jobs import Jobs
    from forge.recipes.kitchen import Kitchen
    from forge.runner import Runner
    from forge.toolchain import Toolchain


@contextlib.contextmanager
def joined(options: argparse.Namespace, kitchen: Kitchen) -> Iterator[Line]:
    """Yield the line to the workers of the scheduler that the options name; raises EnvironmentFault."""
    terms = Terms(options.jobs, options.memory_limit, kitchen.load_limit, tuple(options.worker_resources))
    programs = {name: said.rsplit(" ", 2)[0] for name, said in kitchen.tools}
    programs["forge"] = sys.executable
    with connected(options.scheduler, kitchen.layout.build, programs) as cluster:
        # What this imports is there, now that somebody has answered.
        from forge.cluster.line import Line  # noqa: PLC0415

        if not cluster.sharing:
            hint = "let the workers see the workspace under the same path"
            raise EnvironmentFault(Problem("the workers do not see the build folder", hint=hint))
        line = Line(cluster, terms)
        try:
            yield line
        finally:
            line.close()


def places_of(options: argparse.Namespace, line: Line) -> int:
    """Return how many packages may be under way at a time: what was asked for, else what workers take."""
    return options.parallel_workers or line.cluster.slots


def remote_runner(line: Line, jobs: Jobs, toolchain: Toolchain | None) -> Runner:
    """Return the runner that has steps run on the workers."""
    from forge.cluster.dask_runner import DaskRunner  # noqa: PLC0415  (with the line)

    return DaskRunner(line, jobs.frame(toolchain), jobs.layout)
