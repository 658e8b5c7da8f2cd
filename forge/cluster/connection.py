"""The way to a scheduler: connect, look at every worker, refuse what cannot work."""

from __future__ import annotations

import contextlib
import logging
import sys
import time
import uuid
import warnings
from typing import TYPE_CHECKING

from forge.cluster.surveying import traits_of
from forge.errors import EnvironmentFault, Problem, raise_if_any
from forge.frozen import frozen

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from pathlib import Path

    from distributed import Client

    from forge.cluster.model import Surveyed, Traits
    from forge.model import Pairs

FOLDER = ".forge_cluster"
"""The folder below the build folder for what forge needs of a cluster."""

_CONNECT_SECONDS = 10
_WORKER_SECONDS = 60


@frozen
class Cluster:
    """A scheduler that was reached, and the workers that were found fit."""

    client: Client
    address: str
    workers: tuple[Surveyed, ...]
    sharing: bool
    """Whether the workers see the build folder of the client."""

    @property
    def slots(self) -> int:
        """How many packages the workers take at a time."""
        return sum(worker.slots for worker in self.workers)


@contextlib.contextmanager
def connected(address: str, build: Path, programs: Mapping[str, str]) -> Iterator[Cluster]:
    """Yield the cluster of a scheduler; `programs` are what every worker must have where we have it.

    Raises EnvironmentFault when nobody answers, when there is no worker, and for all in which workers differ
    from us.
    """
    client = _client(address)
    try:
        _await_workers(client, address)
        yield _surveyed(client, address, build, tuple(sorted(programs.items())))
    finally:
        with contextlib.suppress(OSError, TimeoutError):
            client.close(timeout=_CONNECT_SECONDS)


def _client(address: str) -> Client:
    try:
        from distributed import Client  # noqa: PLC0415  (an extra, and slow)
    except ImportError:
        problem = Problem("'--executor dask' needs Dask", hint="pip install 'ros-forge[dask]'")
        raise EnvironmentFault(problem) from None
    # What it has to say, we say ourselves, once and to the point.
    logging.getLogger("distributed").setLevel(logging.CRITICAL + 1)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return Client(address, timeout=_CONNECT_SECONDS, set_as_default=False, name="forge")
    except (OSError, ValueError, TypeError, RuntimeError) as error:
        hint = "is `dask scheduler` running there, and is this the address that it printed?"
        message = f"no scheduler answers at '{address}': {_first_line(error)}"
        raise EnvironmentFault(Problem(message, hint=hint)) from None


def _await_workers(client: Client, address: str) -> None:
    """Wait for a first worker; raise EnvironmentFault when none comes."""
    until = time.monotonic() + _WORKER_SECONDS
    told = False
    while not client.nthreads():
        if not told:
            sys.stderr.write(f"waiting for a worker at {address}, for {_WORKER_SECONDS} seconds at most\n")
            told = True
        if time.monotonic() > until:
            hint = f"start some with `dask worker {address}`; of a cluster that adapts, ask for one at least"
            raise EnvironmentFault(Problem(f"the scheduler at '{address}' has no worker", hint=hint))
        time.sleep(0.2)


def _surveyed(client: Client, address: str, build: Path, programs: Pairs) -> Cluster:
    from forge.cluster.remote_task import survey  # noqa: PLC0415  (only with Dask)

    token = uuid.uuid4().hex
    probe = build / FOLDER / f"probe-{token}"
    probe.parent.mkdir(parents=True, exist_ok=True)
    probe.write_text(token, encoding="utf-8")
    try:
        found = client.run(survey, str(probe), token, programs, on_error="return")
    finally:
        probe.unlink()
    lost = {where: said for where, said in found.items() if isinstance(said, BaseException)}
    workers = tuple(said for where, said in sorted(found.items()) if where not in lost)
    sharing = bool(workers) and all(worker.sharing for worker in workers)
    problems = [
        *(_unsurveyed(where, error) for where, error in sorted(lost.items())),
        *_mixed(workers),
        *_differences(workers, traits_of(programs), sharing=sharing),
    ]
    raise_if_any(problems, EnvironmentFault)
    return Cluster(client, address, workers, sharing)


def _unsurveyed(where: str, error: BaseException) -> Problem:
    hint = "install the same forge there, with pip install 'ros-forge[dask]'"
    missing = isinstance(error, ImportError)
    cause = "it has no forge, or another one" if missing else _first_line(error)
    return Problem(f"the worker at '{where}' cannot help: {cause}", hint=hint if missing else None)


def _mixed(workers: tuple[Surveyed, ...]) -> Iterator[Problem]:
    """Yield a problem where some workers see the build folder and others do not."""
    blind = [worker for worker in workers if not worker.sharing]
    if blind and len(blind) < len(workers):
        hint = "let all of them see it under the same path, or none"
        names = ", ".join(f"'{worker.address}'" for worker in blind)
        yield Problem(f"some workers see the build folder, and others do not: {names}", hint=hint)


def _differences(workers: tuple[Surveyed, ...], ours: Traits, *, sharing: bool) -> Iterator[Problem]:
    """Yield all in which workers must not differ from the client, and do.

    Programs count where folders are shared: what one configured another one goes on with.
    """
    for worker in workers:
        theirs = worker.traits
        where = f"the worker at '{worker.address}' on '{worker.host}'"
        for name, mine, other in (
            ("forge", ours.forge, theirs.forge),
            ("Python", ours.python, theirs.python),
        ):
            if mine != other:
                hint = f"let both have the same {name}"
                yield Problem(f"{where} has {name} {other}, and here it is {mine}", hint=hint)
        known = dict(theirs.tools)
        for name, mine in ours.tools if sharing else ():
            if known.get(name) != mine:
                said = "is another program" if known.get(name) else "is not there"
                hint = "where folders are shared, the programs of a build must be the same, at the same paths"
                yield Problem(f"{where}: '{mine.rpartition(' ')[0]}' {said}", hint=hint)


def _first_line(error: BaseException) -> str:
    return (str(error).strip().splitlines() or [type(error).__name__])[0]
