"""What runs inside a worker of Dask: a task that asks for its errand and has an attendant run it.

The steps run in a program of their own. It ends them when the worker is killed, and no compiler outlives
what it was started for. All here happens in the worker's event loop, one thing after the other.
"""

from __future__ import annotations

import asyncio
import contextlib
import hashlib
import itertools
import os
import pickle
import sys
import uuid
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from forge.cluster.attendant import LENGTH, framed
from forge.cluster.model import INTERRUPT, LETTERS, MACHINE, Knock, Lacks, Surveyed
from forge.cluster.sharing import Share
from forge.cluster.surveying import host_name, sees, traits_of
from forge.interpreter import own_command

if TYPE_CHECKING:
    from collections.abc import Mapping

    from distributed import Scheduler, Worker

    from forge.cluster.model import Errand, Parcel

_LOOK_SECONDS = 0.5
"""How often a task looks whether anybody still wants it."""
_END_SECONDS = 10.0

_AHEAD = 2 * LETTERS
"""How many letters may be under way; a program that prints more than the client can take has to wait."""

_visits: dict[str, Visit] = {}
_shares: dict[str, Share] = {}


class Visit:
    """One attempt of a task on this worker."""

    def __init__(self, worker: Worker, topic: str, key: str) -> None:
        """Begin with nothing at hand and nothing sent."""
        self.name = uuid.uuid4().hex
        self.topic = topic
        self.errand: asyncio.Future[bytes] = asyncio.get_running_loop().create_future()
        self.words: asyncio.Queue[str] = asyncio.Queue()
        self.lacking: set[str] = set()
        self.supplied = asyncio.Event()
        self.room = asyncio.Event()
        self.room.set()
        self._under_way = 0
        taken = {other.slot for other in _visits.values()}
        self.slot: int = next(number for number in itertools.count() if number not in taken)
        self.home = Path(worker.local_directory, "forge")
        self._worker = worker
        self._key = key
        self._sent = 0

    @property
    def address(self) -> str:
        """The address of the worker."""
        return self._worker.address

    @property
    def wanted(self) -> bool:
        """Tell if anybody waits for the result: not when the client cancelled it, or has gone."""
        state = self._worker.state.tasks.get(self._key)
        return state is not None and state.state not in {"cancelled", "released", "forgotten"}

    def send(self, letter: bytes) -> None:
        """Send a letter to the client, numbered, in order."""
        self._worker.log_event(self.topic, {"visit": self.name, "number": self._sent, "letter": letter})
        self._sent += 1
        self._under_way += 1
        if self._under_way >= _AHEAD and self.wanted:
            self.room.clear()

    def more(self) -> None:
        """Let go on: so many letters were read."""
        self._under_way -= LETTERS
        self.room.set()


async def attend(topic: str, key: str) -> None:
    """Carry out one task: knock, wait for the errand, pass on what happens. This is what Dask runs."""
    from distributed import get_worker  # noqa: PLC0415  (an extra, which a worker has)

    worker = get_worker()
    visit = Visit(worker, topic, key)
    _visits[visit.name] = visit
    watch = asyncio.ensure_future(_watch(visit))
    try:
        knock = Knock(visit.name, worker.address, host_name(), str(visit.home / str(visit.slot)))
        visit.send(pickle.dumps((key, knock)))
        waiting: set[asyncio.Future[Any]] = {visit.errand, watch}
        await asyncio.wait(waiting, return_when=asyncio.FIRST_COMPLETED)
        if visit.errand.done():
            errand: Errand = pickle.loads(visit.errand.result())  # noqa: S301  (a client may run anything here)
            if errand.parcel is not None:
                errand = await _stocked(visit, errand, errand.parcel, watch)
            if not watch.done():
                await _carry_out(visit, errand, worker)
    finally:
        watch.cancel()
        del _visits[visit.name]


def survey(probe: str, content: str, programs: tuple[tuple[str, str], ...], dask_worker: Worker) -> Surveyed:
    """Return what this worker is like; the client calls this on every worker."""
    state = dask_worker.state
    return Surveyed(
        dask_worker.address,
        host_name(),
        traits_of(programs),
        sees(probe, content),
        state.nthreads,
        tuple(sorted(state.total_resources.items())),
    )


async def hand_over(visit: str, errand: bytes) -> bool:
    """Give a visit its errand, pickled; tell if it is here. The client calls this on the worker."""
    found = _visits.get(visit)
    if found is not None and not found.errand.done():
        found.errand.set_result(errand)
    return found is not None


async def more(visit: str) -> None:
    """Tell a visit that the next letters were read. The client calls this, too."""
    found = _visits.get(visit)
    if found is not None:
        found.more()


async def supply(visit: str, digest: str, piece: bytes, *, last: bool) -> bool:
    """Give a visit a piece of an archive that it lacks; tell if it is here. The client calls this, too."""
    found = _visits.get(visit)
    if found is None:
        return False
    draft = found.home / "archives" / f"{digest}.{visit}"
    with draft.open("ab") as archive:
        archive.write(piece)
    if last:
        said = await asyncio.to_thread(_digest_of, draft)
        if said != digest:
            draft.unlink()
            raise ValueError(f"an archive of sources came as {said}, not as {digest}")
        draft.rename(draft.with_name(digest))
        found.lacking.discard(digest)
        if not found.lacking:
            found.supplied.set()
    return True


async def tell(topic: str, word: str, visit: str = "") -> int:
    """Pass a word on to the visits of a build, or to one; return to how many."""
    found = [one for one in _visits.values() if one.topic == topic and visit in {"", one.name}]
    for one in found:
        one.words.put_nowait(word)
    return len(found)


def forget(topic: str, dask_scheduler: Scheduler) -> None:
    """Let the scheduler forget what was said of a build that has ended."""
    with contextlib.suppress(AttributeError):
        dask_scheduler._broker.truncate(topic)  # noqa: SLF001  (there is no other way)


async def _watch(visit: Visit) -> None:
    """End when nobody waits for the visit any more, and let the attendant know."""
    while visit.wanted:  # noqa: ASYNC110  (Dask tells nobody)
        await asyncio.sleep(_LOOK_SECONDS)
    visit.words.put_nowait(INTERRUPT)
    # Nobody reads any more, and so nobody makes room.
    visit.room.set()


async def _stocked(visit: Visit, errand: Errand, parcel: Parcel, watch: asyncio.Future[None]) -> Errand:
    """Wait for archives that are not here; return the errand with the places that this worker has for it."""
    archives = visit.home / "archives"
    archives.mkdir(parents=True, exist_ok=True)
    visit.lacking = {digest for _, digest in parcel.packages if not (archives / digest).is_file()}
    if visit.lacking:
        visit.send(pickle.dumps(Lacks(visit.name, visit.address, tuple(sorted(visit.lacking)))))
        waiting: set[asyncio.Future[Any]] = {asyncio.ensure_future(visit.supplied.wait()), watch}
        await asyncio.wait(waiting, return_when=asyncio.FIRST_COMPLETED)
    folder = visit.home / str(visit.slot) / parcel.workspace
    here = replace(parcel, folder=folder, archives=archives)
    step = errand.task.steps[0]
    step = replace(step, argv=own_command(*step.argv), cwd=folder)
    task = replace(errand.task, steps=(step,), build_dir=folder / ".forge_errand")
    return replace(errand, task=task, environment=_settled(errand.environment), parcel=here)


def _settled(environment: Mapping[str, str]) -> dict[str, str]:
    """Return an environment of the client's with what is this machine's own business."""
    own = {name: value for name, value in os.environ.items() if name in MACHINE}
    path = (environment.get("PATH", ""), os.environ.get("PATH", ""))
    return {**environment, **own, "PATH": os.pathsep.join(filter(None, path))}


def _digest_of(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


async def _carry_out(visit: Visit, errand: Errand, worker: Worker) -> None:
    share = _shares.setdefault(visit.topic, Share(errand.terms.jobs, worker.state.nthreads))
    styles = await asyncio.to_thread(share.prepare, errand.environment)
    with share.taken() as pool:
        argv = own_command("-m", "forge.cluster.attendant", *pool.words, *styles)
        process = await asyncio.create_subprocess_exec(
            *argv,
            stdin=asyncio.subprocess.PIPE,
            stdout=asyncio.subprocess.PIPE,
            pass_fds=pool.descriptors,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
            start_new_session=True,
        )
        assert process.stdin is not None  # noqa: S101  (asked for above)
        process.stdin.write(framed(pickle.dumps(errand)))
        passing = asyncio.ensure_future(_pass_words(visit, process.stdin))
        try:
            await _pass_letters(visit, process)
        finally:
            passing.cancel()
            process.stdin.close()
            with contextlib.suppress(asyncio.TimeoutError):
                await asyncio.wait_for(process.wait(), _END_SECONDS)
    if process.returncode:
        raise RuntimeError(f"what ran its steps on {host_name()} ended with code {process.returncode}")


async def _pass_words(visit: Visit, stdin: asyncio.StreamWriter) -> None:
    while True:
        word = await visit.words.get()
        with contextlib.suppress(OSError):
            stdin.write(f"{word}\n".encode())
            await stdin.drain()


async def _pass_letters(visit: Visit, process: asyncio.subprocess.Process) -> None:
    assert process.stdout is not None  # noqa: S101  (asked for by who started it)
    with contextlib.suppress(asyncio.IncompleteReadError):
        while True:
            size = int.from_bytes(await process.stdout.readexactly(LENGTH), "big")
            letter = await process.stdout.readexactly(size)
            await visit.room.wait()
            visit.send(letter)
