"""Connect to a Dask scheduler, compare its workers with this machine, and reject unsuitable ones."""

from __future__ import annotations

import contextlib
import hashlib
import logging
import os
import platform
import socket
import sys
import time
import uuid
import warnings
from pathlib import Path
from typing import TYPE_CHECKING

from forge import __version__
from forge.base.errors import HostError, Problem, raise_if_any
from forge.base.frozen import frozen
from forge.base.layout import CLUSTER_DIR, NO_CODE, PACKAGE
from forge.base.own_environment import extra_command
from forge.build.inputs.fingerprints import source_files

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from distributed import Client, Worker

    from forge.base.frozen import Pairs


_CONNECT_SECONDS = 10
_WORKER_SECONDS = 60


@frozen
class Traits:
    """The properties that must be the same on all workers and the client.

    `programs` maps names to path and digest, or '' if the program does not exist.
    """

    forge: str
    python: str
    programs: Pairs = ()


@frozen
class WorkerInfo:
    """A surveyed worker: its address, its properties, and whether it shares the build folder."""

    address: str
    host: str
    traits: Traits
    sharing: bool
    slots: int = 1


@frozen
class Cluster:
    """A connected scheduler and its suitable workers.

    `folder` is the shared folder for forge's cluster files.
    """

    client: Client
    address: str
    folder: Path
    workers: tuple[WorkerInfo, ...]
    remarks: tuple[Problem, ...] = ()
    """The reasons why other workers are not used."""

    @property
    def allowed_workers(self) -> tuple[str, ...]:
        """The allowed workers if some are unsuitable; empty if any may be used, including later ones."""
        return tuple(worker.address for worker in self.workers) if self.remarks else ()

    @property
    def slots(self) -> int:
        return sum(worker.slots for worker in self.workers)


@contextlib.contextmanager
def connected_cluster(address: str, build: Path, programs: Mapping[str, str]) -> Iterator[Cluster]:
    """Yield the cluster of a scheduler; every worker must have the same `programs` at the same paths.

    This includes the Python that runs forge. Raises HostError if the scheduler is unreachable, a
    worker cannot access the build folder, no worker is suitable, or versions of forge or Python differ.
    """
    client = _client(address)
    try:
        if not client.nthreads():
            seconds = f"for {_WORKER_SECONDS} seconds at most"
            print(f"waiting for a worker at {address}, {seconds}", file=sys.stderr)
        until = time.monotonic() + _WORKER_SECONDS
        while not client.nthreads():
            if time.monotonic() > until:
                hint = f"start one with `dask worker {address}`, or give an adaptive cluster a minimum of 1"
                raise HostError(Problem(f"the scheduler at '{address}' has no worker", hint=hint))
            time.sleep(0.2)
        yield _surveyed(
            client, address, build, tuple(sorted({**programs, "forge's Python": sys.executable}.items()))
        )
    finally:
        with contextlib.suppress(OSError, TimeoutError):
            client.close(timeout=_CONNECT_SECONDS)


def _client(address: str) -> Client:
    try:
        import dask.config
        from dask.utils import parse_timedelta
        from distributed import Client
    except ImportError:
        problem = Problem("'--executor dask' needs Dask", hint=f"run: {extra_command('dask')}")
        raise HostError(problem) from None

    class Quiet(Client):
        """A client that prints nothing if it is deleted before it connected."""

        def __del__(self) -> None:
            with contextlib.suppress(Exception):
                super().__del__()  # type: ignore[no-untyped-call]

    dask_timeout = parse_timedelta(dask.config.get("distributed.comm.timeouts.connect"))
    timeout = min(float(_CONNECT_SECONDS), float(dask_timeout))
    # forge reports its problems itself.
    logging.getLogger("distributed").setLevel(logging.CRITICAL + 1)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            # Dask's constructor is untyped.
            return Quiet(address, timeout=timeout, set_as_default=False, name="forge")  # type: ignore[no-untyped-call]
    except (OSError, ValueError, TypeError, RuntimeError) as error:
        hint = "check that `dask scheduler` is running there, and that this is the address it printed"
        message = f"cannot connect to the scheduler at '{address}': {_first_line(error)}"
        raise HostError(Problem(message, hint=hint)) from None


def _surveyed(client: Client, address: str, build: Path, programs: Pairs) -> Cluster:
    token = uuid.uuid4().hex
    folder = build / CLUSTER_DIR
    probe = folder / f"probe-{token}"
    folder.mkdir(parents=True, exist_ok=True)
    probe.write_text(token, encoding="utf-8")
    try:
        results = client.run(survey, str(probe), token, programs, on_error="return")
    finally:
        probe.unlink()
    failures = {
        worker_address: result
        for worker_address, result in results.items()
        if isinstance(result, BaseException)
    }
    workers = tuple(
        result for worker_address, result in sorted(results.items()) if worker_address not in failures
    )
    ours = traits_of(programs)
    differing = {worker.address: tuple(_other_programs(worker, ours)) for worker in workers}
    allowed_workers = tuple(worker for worker in workers if not differing[worker.address])
    remarks = tuple(problem for problems in differing.values() for problem in problems)
    raise_if_any(
        (
            *(_unsurveyed(worker_address, error) for worker_address, error in sorted(failures.items())),
            *_without_access(workers, build),
            *(problem for worker in workers for problem in _other_versions(worker, ours)),
            *(() if allowed_workers else remarks),
        ),
        HostError,
    )
    return Cluster(client, address, folder, allowed_workers, remarks)


def survey(probe: str, content: str, programs: Pairs, dask_worker: Worker) -> WorkerInfo:
    """Return the properties of this worker; the client calls this on every worker.

    `probe` is a file that the client has written with `content`.
    """
    try:
        sharing = Path(probe).read_text(encoding="utf-8") == content
    except (OSError, ValueError):
        sharing = False
    slots = dask_worker.state.nthreads
    return WorkerInfo(dask_worker.address, socket.gethostname(), traits_of(programs), sharing, slots)


def traits_of(programs: Pairs = ()) -> Traits:
    """Return the properties of this machine that must be equal on all machines."""
    version = ".".join(platform.python_version_tuple()[:2])
    identities = tuple((name, _program_identity(path)) for name, path in programs)
    digest = hashlib.sha256()
    for path in source_files(str(PACKAGE), NO_CODE):
        if path.endswith(".py"):
            digest.update(os.path.relpath(path, PACKAGE).encode() + Path(path).read_bytes())
    return Traits(f"{__version__} ({digest.hexdigest()[:8]})", version, identities)


def _program_identity(path: str) -> str:
    try:
        return f"{os.path.realpath(path)} {hashlib.sha256(Path(path).read_bytes()).hexdigest()}"
    except OSError:
        return ""


def _unsurveyed(address: str, error: BaseException) -> Problem:
    hint = "install the same version of forge there, with its extra 'dask'"
    missing = isinstance(error, ImportError)
    cause = "forge is not installed there, or another version" if missing else _first_line(error)
    return Problem(f"the worker at '{address}' cannot be used: {cause}", hint=hint if missing else None)


def _without_access(workers: tuple[WorkerInfo, ...], build: Path) -> Iterator[Problem]:
    separate = [f"'{worker.address}'" for worker in workers if not worker.sharing]
    if separate:
        subject = "the workers" if len(separate) == len(workers) else f"the workers at {', '.join(separate)}"
        hint = "mount it under the same path on the workers"
        yield Problem(f"{subject} cannot access the build folder '{build}'", hint=hint)


def _other_versions(worker: WorkerInfo, ours: Traits) -> Iterator[Problem]:
    theirs = worker.traits
    for name, local, other in (("forge", ours.forge, theirs.forge), ("Python", ours.python, theirs.python)):
        if local != other:
            message = f"{_where(worker)} has {name} {other}, this machine has {local}"
            yield Problem(message, hint=f"install the same {name} on both")


def _other_programs(worker: WorkerInfo, ours: Traits) -> Iterator[Problem]:
    """Yield a problem for each program that differs, since a worker may continue the build of another one."""
    remote_programs = dict(worker.traits.programs)
    for name, local in ours.programs:
        if remote_programs.get(name) == local:
            continue
        difference = "differs there" if remote_programs.get(name) else "does not exist there"
        hint = "install the same programs at the same paths on all machines, for example from one image"
        path = local.rpartition(" ")[0]
        yield Problem(f"{_where(worker)} is not used: '{path}' {difference}", hint=hint)


def _where(worker: WorkerInfo) -> str:
    return f"the worker at '{worker.address}' on '{worker.host}'"


def _first_line(error: BaseException) -> str:
    return (str(error).strip().splitlines() or [type(error).__name__])[0]
