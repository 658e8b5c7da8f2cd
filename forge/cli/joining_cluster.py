"""Connects a build to a Dask cluster: the connection, and the runner that uses it."""

from __future__ import annotations

import contextlib
import sys
from typing import TYPE_CHECKING

from forge.base.errors import EnvironmentFault, Problem, raise_if_any
from forge.cli.options import remote_cache
from forge.cli.preparation import force_of
from forge.workspace.load import warn

if TYPE_CHECKING:
    import argparse
    from collections.abc import Iterator, Mapping

    from forge.build.recipes.context import BuildContext
    from forge.cache.package_cache import PackageCache
    from forge.cli.session import BuildRequest
    from forge.execution.dask.connection import Connection
    from forge.execution.runner import Runner, TaskLifecycle


@contextlib.contextmanager
def joined(
    options: argparse.Namespace, context: BuildContext, variables: Mapping[str, str]
) -> Iterator[Connection]:
    """Yield a connection to the workers of the scheduler; raises EnvironmentFault."""
    from forge.execution.dask.cluster import connected  # noqa: PLC0415  (only needed with a cluster)
    from forge.execution.dask.model import Terms  # noqa: PLC0415

    terms = Terms(options.jobs, options.memory_limit, context.load_limit, tuple(options.worker_resources))
    programs = {name: identity.rsplit(" ", 2)[0] for name, identity in context.tools}
    with connected(options.scheduler, context.layout.build, programs, sys.executable) as cluster:
        # Imports modules that exist if the connection succeeded.
        from forge.execution.dask.connection import Connection  # noqa: PLC0415

        warn(cluster.remarks)
        if not cluster.sharing:
            raise_if_any(_obstacles(options, variables), EnvironmentFault)
        connection = Connection(cluster, terms)
        try:
            yield connection
        finally:
            connection.close()


def remote_slots(options: argparse.Namespace, connection: Connection) -> int:
    """Return how many packages may run in parallel: --parallel-workers, else the workers' capacity."""
    return options.parallel_workers or connection.cluster.slots


def remote_runner(
    connection: Connection,
    request: BuildRequest,
    frame: TaskLifecycle,
    here: Runner,
    cache: PackageCache | None,
) -> Runner:
    """Return the runner that builds packages on workers; `here` builds those that need this machine."""
    layout = request.context.layout
    if connection.cluster.sharing:
        from forge.execution.dask.dask_runner import DaskRunner  # noqa: PLC0415  (as above)

        return DaskRunner(connection, frame, layout)
    from forge.cli.telling_cluster import remote_config  # noqa: PLC0415
    from forge.execution.dask.cluster import FOLDER  # noqa: PLC0415  (as above)
    from forge.execution.dask.shipping_runner import ShippingRunner  # noqa: PLC0415  (as above)
    from forge.execution.dask.sources import ArchiveStore  # noqa: PLC0415

    assert cache is not None  # noqa: S101  (checked by joined())
    connection.archives = ArchiveStore(layout.build / FOLDER / "sources")
    url = remote_cache(request.options, request.variables)
    config = remote_config(request.options, request.loaded, request.variables, url)
    return ShippingRunner(connection, config, here, frame, cache)


def _obstacles(options: argparse.Namespace, variables: Mapping[str, str]) -> Iterator[Problem]:
    """Yield problems with workers that cannot access this machine's folders."""
    no_access = "the workers cannot access the build folder"
    if not remote_cache(options, variables):
        hint = (
            "pass '--remote-cache URL' to transfer results, or mount the folder on the workers under "
            "the same path"
        )
        yield Problem(no_access, hint=hint)
    if options.cache_read_only:
        hint = "remove '--cache-read-only': results of workers are transferred through the remote cache"
        yield Problem(f"{no_access}, and '--cache-read-only' prevents them from returning results", hint=hint)
    if options.symlink_install:
        hint = "remove '--symlink-install'"
        yield Problem(
            f"{no_access}, so that installed files cannot link to sources on this machine", hint=hint
        )
    if forced := force_of(options):
        hint = f"remove '{forced}'"
        yield Problem(
            f"{no_access} and restore results from the cache, so that '{forced}' has no effect", hint=hint
        )
