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

OWN_PYTHON = "forge's Python"

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
    remarks: tuple[Problem, ...] = ()
    """Why others were found unfit."""

    @property
    def fit(self) -> tuple[str, ...]:
        """The only workers that are to be asked, where some are not; else any may, and may join later."""
        return tuple(worker.address for worker in self.workers) if self.remarks else ()

    @property
    def slots(self) -> int:
        """How many packages the workers take at a time."""
        return sum(worker.slots for worker in self.workers)


@contextlib.contextmanager
def connected(address: str, build: Path, programs: Mapping[str, str], python: str) -> Iterator[Cluster]:
    """Yield the cluster of a scheduler; `programs` are what every worker must have where we have it.

    So is `python`, which runs forge here, on workers that share our folders. Raises EnvironmentFault when
    nobody answers, when there is no fit worker, and for all in which workers differ from us.
    """
    client = _client(address)
    try:
        _await_workers(client, address)
        yield _surveyed(client, address, build, tuple(sorted({**programs, OWN_PYTHON: python}.items())))
    finally:
        with contextlib.suppress(OSError, TimeoutError):
            client.close(timeout=_CONNECT_SECONDS)


def _client(address: str) -> Client:
    try:
        from distributed import Client  # noqa: PLC0415  (an extra, and slow)
    except ImportError:
        problem = Problem("'--executor dask' needs Dask", hint="pip install 'ros-forge[dask]'")
        raise EnvironmentFault(problem) from None

    class Quiet(Client):
        """A client that says nothing when it goes without ever having been connected."""

        def __del__(self) -> None:
            with contextlib.suppress(Exception):
                super().__del__()  # type: ignore[no-untyped-call]

    # What it has to say, we say ourselves, once and to the point.
    logging.getLogger("distributed").setLevel(logging.CRITICAL + 1)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            # mypy knows no types of what Dask's class is made by.
            return Quiet(address, timeout=_patience(), set_as_default=False, name="forge")  # type: ignore[no-untyped-call]
    except (OSError, ValueError, TypeError, RuntimeError) as error:
        hint = "is `dask scheduler` running there, and is this the address that it printed?"
        message = f"no scheduler answers at '{address}': {_first_line(error)}"
        raise EnvironmentFault(Problem(message, hint=hint)) from None


def _patience() -> float:
    """Return how long a scheduler may take to answer: Dask's own setting where that is less than ours."""
    import dask.config  # noqa: PLC0415  (with Dask)
    from dask.utils import parse_timedelta  # noqa: PLC0415

    theirs = parse_timedelta(dask.config.get("distributed.comm.timeouts.connect"))
    return min(float(_CONNECT_SECONDS), float(theirs))


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
    ours = traits_of(programs)
    odd = {worker.address: tuple(_other_programs(worker, ours, sharing=sharing)) for worker in workers}
    fit = tuple(worker for worker in workers if not odd[worker.address])
    remarks = tuple(problem for problems in odd.values() for problem in problems)
    raise_if_any(
        (
            *(_unsurveyed(where, error) for where, error in sorted(lost.items())),
            *_mixed(workers),
            *(problem for worker in workers for problem in _other_versions(worker, ours)),
            *(() if fit else remarks),
        ),
        EnvironmentFault,
    )
    return Cluster(client, address, fit, sharing, remarks)


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


def _other_versions(worker: Surveyed, ours: Traits) -> Iterator[Problem]:
    """Yield what a worker has in another version, though we could not even speak with it then."""
    theirs = worker.traits
    for name, mine, other in (("forge", ours.forge, theirs.forge), ("Python", ours.python, theirs.python)):
        if mine != other:
            message = f"{_where(worker)} has {name} {other}, and here it is {mine}"
            yield Problem(message, hint=f"let both have the same {name}")


def _other_programs(worker: Surveyed, ours: Traits, *, sharing: bool) -> Iterator[Problem]:
    """Yield the programs in which a worker differs.

    Where folders are shared what one has configured another goes on with; where they are not, a result is
    found only by who has the same programs.
    """
    known = dict(worker.traits.tools)
    for name, mine in ours.tools:
        if known.get(name) == mine or (name == OWN_PYTHON and not sharing):
            continue
        said = "is another program there" if known.get(name) else "is not there"
        hint = "let all machines have the same programs at the same paths, as of one image"
        yield Problem(f"{_where(worker)} is not asked: '{mine.rpartition(' ')[0]}' {said}", hint=hint)


def _where(worker: Surveyed) -> str:
    return f"the worker at '{worker.address}' on '{worker.host}'"


def _first_line(error: BaseException) -> str:
    return (str(error).strip().splitlines() or [type(error).__name__])[0]
