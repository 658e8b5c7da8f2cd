"""A scheduler of Dask and workers on loopback, as programs of their own, each worker with its own folder."""

import contextlib
import json
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

from tests.snippets import ROOT, surroundings

_PATIENCE_SECONDS = 60.0
_LOOPBACK = ("--no-dashboard", "--dashboard-address", "127.0.0.1:0")


@dataclass
class Loopback:
    """A scheduler that runs, and the workers that were started for it."""

    folder: Path
    hidden: Path | None = None
    """A folder that workers find empty, as on a machine that has it not."""
    address: str = ""
    workers: dict[str, subprocess.Popen[bytes]] = field(default_factory=dict)
    _programs: list[subprocess.Popen[bytes]] = field(default_factory=list)

    def start(self) -> None:
        """Start the scheduler on a port that the system chooses."""
        said = self.folder / "scheduler.json"
        words = ("--host", "127.0.0.1", "--port", "0", *_LOOPBACK, "--scheduler-file", str(said))
        self._run("dask_scheduler", "scheduler", words)
        self._await(lambda: bool(said.is_file() and said.read_text(encoding="utf-8")), "scheduler")
        self.address = json.loads(said.read_text(encoding="utf-8"))["address"]

    def add(self, name: str, *words: str, env: Mapping[str, str] | None = None, slots: int = 1) -> None:
        """Start a worker; whoever builds waits for it."""
        own = self.folder / name
        own.mkdir(exist_ok=True)
        words = (self.address, "--host", "127.0.0.1", "--no-nanny", "--nthreads", str(slots), *words)
        words += ("--name", name, "--local-directory", str(own), *_LOOPBACK)
        self.workers[name] = self._run("dask_worker", name, words, env)
        log = self.folder / f"{name}.log"
        self._await(lambda: "Registered to" in log.read_text(encoding="utf-8"), name)

    def kill(self, name: str) -> None:
        """Kill a worker as a crash of its machine would."""
        self.workers[name].kill()
        self.workers.pop(name).wait()

    def holder(self, word: Path) -> str:
        """Return the worker that runs a program whose command line has a path in it."""
        by_process = {program.pid: name for name, program in self.workers.items()}
        for process in _naming(word):
            above = process
            while above > 1 and above not in by_process:
                above = _parent(above)
            if above in by_process:
                return by_process[above]
        raise LookupError(word)

    def stop(self) -> None:
        """End everything."""
        for program in self._programs:
            program.kill()
        for program in self._programs:
            program.wait()

    def _run(
        self, module: str, name: str, words: tuple[str, ...], env: Mapping[str, str] | None = None
    ) -> subprocess.Popen[bytes]:
        with (self.folder / f"{name}.log").open("wb") as log:
            program = subprocess.Popen(
                (*self._apart(name), sys.executable, "-m", f"distributed.cli.{module}", *words),
                cwd=self.folder,
                env={**surroundings(self.folder), "PYTHONPATH": str(ROOT), **(env or {})},
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
            )
        self._programs.append(program)
        return program

    def _apart(self, name: str) -> tuple[str, ...]:
        """Return the words in front of a worker that must not see the hidden folder."""
        if self.hidden is None or name == "scheduler":
            return ()
        script = f'mount -t tmpfs none {self.hidden} && exec "$@"'
        return (*alone(), "sh", "-c", script, "sh")

    def _await(self, is_there: Callable[[], bool], name: str) -> None:
        until = time.monotonic() + _PATIENCE_SECONDS
        while not is_there():
            log = (self.folder / f"{'scheduler' if not self.address else name}.log").read_text(
                encoding="utf-8"
            )
            assert time.monotonic() < until, f"{name} does not start:\n{log}"
            assert self._programs[-1].poll() is None, f"{name} has ended:\n{log}"
            time.sleep(0.05)


@cache
def alone() -> tuple[str, ...]:
    """Return the words that start a program with mounts of its own; nothing where that is not allowed."""
    for words in (("unshare", "-m"), ("unshare", "-Urm"), ("sudo", "-n", "unshare", "-m")):
        with contextlib.suppress(OSError):
            script = ("sh", "-c", "mount -t tmpfs none /mnt")
            if subprocess.run((*words, *script), capture_output=True, check=False).returncode == 0:
                return words
    return ()


@contextlib.contextmanager
def loopback(folder: Path, hidden: Path | None = None) -> Iterator[Loopback]:
    """Yield a scheduler without workers, below a folder; end it with whatever was started."""
    cluster = Loopback(folder, hidden)
    try:
        cluster.start()
        yield cluster
    finally:
        cluster.stop()


def programs_of(build: Path) -> list[str]:
    """Return the command lines of what runs for a build folder."""
    return [_command(process) for process in _processes_of(build)]


def _naming(word: Path) -> list[int]:
    found = [int(path.name) for path in Path("/proc").glob("[0-9]*")]
    return [process for process in found if str(word) in _command(process)]


def _command(process: int) -> str:
    try:
        return Path(f"/proc/{process}/cmdline").read_bytes().replace(b"\0", b" ").decode()
    except OSError:
        return ""


def _processes_of(build: Path) -> list[int]:
    mark = f"FORGE_BUILD_FOLDER={build}".encode()
    found = []
    for path in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            if mark in (path / "environ").read_bytes().split(b"\0"):
                found.append(int(path.name))
    return found


def _parent(process: int) -> int:
    try:
        return int(Path(f"/proc/{process}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()[1])
    except OSError:
        return 0
