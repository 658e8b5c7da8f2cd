"""The entry point of the plugin, which imports the rest only for a build with packages to build."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from typing import TYPE_CHECKING

from forge.base.errors import Problem, SelectionError
from forge.execution.executor import ExecutorContext, ExecutorOptions

if TYPE_CHECKING:
    from forge.plugins.dask.connection import Connection


def check(options: ExecutorOptions) -> None:
    """Raise SelectionError without --scheduler. The reverse is allowed: option files may name a scheduler."""
    if not options.scheduler:
        hint = "start a scheduler with `dask scheduler` and use the address it prints"
        raise SelectionError(Problem("'--executor dask' needs '--scheduler ADDRESS'", hint=hint))


@contextlib.contextmanager
def connect(context: ExecutorContext) -> Iterator[Connection]:
    """Yield a connection to the workers of the scheduler; raises HostError."""
    from forge.plugins.dask.cluster import connected_cluster
    from forge.plugins.dask.connection import Connection

    options = context.options
    with (
        connected_cluster(options.scheduler or "", context.build, context.programs) as cluster,
        contextlib.closing(Connection(cluster, context.jobs, options.worker_resources)) as connection,
    ):
        context.warn(cluster.remarks)
        yield connection
