"""Where a build meets a cluster: from the options to the line, from the line to a runner."""

from __future__ import annotations

import contextlib
import sys
from typing import TYPE_CHECKING

from forge.cluster.connection import FOLDER, connected
from forge.cluster.model import Terms
from forge.errors import EnvironmentFault, Problem, raise_if_any
from forge.options import remote_cache
from forge.preparation import force_of
from forge.workspace import warn

if TYPE_CHECKING:
    import argparse
    from collections.abc import Iterator, Mapping

    from forge.caching.package_cache import PackageCache
    from forge.cluster.line import Line
    from forge.recipes.kitchen import Kitchen
    from forge.runner import Frame, Runner
    from forge.undertaking import Undertaking


@contextlib.contextmanager
def joined(options: argparse.Namespace, kitchen: Kitchen, variables: Mapping[str, str]) -> Iterator[Line]:
    """Yield the line to the workers of the scheduler that the options name; raises EnvironmentFault."""
    terms = Terms(options.jobs, options.memory_limit, kitchen.load_limit, tuple(options.worker_resources))
    programs = {name: said.rsplit(" ", 2)[0] for name, said in kitchen.tools}
    with connected(options.scheduler, kitchen.layout.build, programs, sys.executable) as cluster:
        # What this imports is there, now that somebody has answered.
        from forge.cluster.line import Line  # noqa: PLC0415

        warn(cluster.remarks)
        if not cluster.sharing:
            raise_if_any(_obstacles(options, variables), EnvironmentFault)
        line = Line(cluster, terms)
        try:
            yield line
        finally:
            line.close()


def places_of(options: argparse.Namespace, line: Line) -> int:
    """Return how many packages may be under way at a time: what was asked for, else what workers take."""
    return options.parallel_workers or line.cluster.slots


def remote_runner(
    line: Line, undertaking: Undertaking, frame: Frame, here: Runner, cache: PackageCache | None
) -> Runner:
    """Return the runner that has packages built on the workers; `here` builds what cannot be built there."""
    layout = undertaking.kitchen.layout
    if line.cluster.sharing:
        from forge.cluster.dask_runner import DaskRunner  # noqa: PLC0415  (with the line)

        return DaskRunner(line, frame, layout)
    from forge.cluster.shipping_runner import ShippingRunner  # noqa: PLC0415  (with the line)
    from forge.cluster.sources import Stock  # noqa: PLC0415
    from forge.cluster.telling import manifesto  # noqa: PLC0415

    assert cache is not None  # noqa: S101  (else joined() had refused)
    line.stock = Stock(layout.build / FOLDER / "sources")
    url = remote_cache(undertaking.options, undertaking.variables)
    told = manifesto(undertaking.options, undertaking.loaded, undertaking.variables, url)
    return ShippingRunner(line, told, here, frame, cache)


def _obstacles(options: argparse.Namespace, variables: Mapping[str, str]) -> Iterator[Problem]:
    """Yield what cannot be done with workers that do not see our folders."""
    blind = "the workers do not see the build folder"
    if not remote_cache(options, variables):
        hint = "give '--remote-cache URL', by which results come back, or let them see it under the same path"
        yield Problem(blind, hint=hint)
    if options.cache_read_only:
        hint = "leave it out: what workers build comes back by the remote cache"
        yield Problem(f"{blind}, and '--cache-read-only' keeps them from giving results back", hint=hint)
    if options.symlink_install:
        hint = "leave out '--symlink-install'"
        yield Problem(f"{blind}, so nothing that they install can link to sources here", hint=hint)
    if forced := force_of(options):
        hint = f"leave out '{forced}'"
        yield Problem(f"{blind}, so they give what the cache has, and '{forced}' has no effect", hint=hint)
