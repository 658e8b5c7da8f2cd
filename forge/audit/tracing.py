"""Starting the steps of a build under strace, and keeping what they did with files."""

from __future__ import annotations

import shutil
import subprocess
from contextlib import contextmanager
from typing import TYPE_CHECKING

from forge.audit.accesses import CALLS, read_accesses, started_by
from forge.errors import EnvironmentFault, Problem

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from pathlib import Path

    from forge.audit.accesses import Accesses
    from forge.model import Step, Task

FOLDER = ".forge_audit"
_CALLS = ",".join(f"?{call}" for call in CALLS)  # '?': a call that this machine does not have is no mistake
_OPTIONS = ("-f", "-q", "-y", "-s", "0", "-e", "signal=none", "-e", f"trace={_CALLS}")
_FASTER = "--seccomp-bpf"
"""Stops programs at the calls that are traced and at no other."""


class Audit:
    """What the steps of a build did with files, by package; a thread adds to the package that it builds."""

    def __init__(self, strace: Sequence[str], folder: Path) -> None:
        """Remember how strace is started, and where it may write."""
        self._strace = tuple(strace)
        self._folder = folder
        self.steps: dict[str, list[tuple[str, Accesses]]] = {}

    @contextmanager
    def launch(self, task: Task, step: Step) -> Iterator[Sequence[str]]:
        """Yield the words that run a step under strace; afterwards take note of what it did."""
        steps = self.steps.setdefault(task.name, [])
        trace = self._folder / f"{task.name}.{len(steps)}"
        trace.parent.mkdir(parents=True, exist_ok=True)
        try:
            yield (*self._strace, "-o", str(trace), *step.argv)
            if trace.is_file():
                steps.append((step.label, _read(trace, str(step.cwd))))
        finally:
            trace.unlink(missing_ok=True)

    def close(self) -> None:
        """Remove the folder of traces."""
        shutil.rmtree(self._folder, ignore_errors=True)


def start_audit(build: Path, variables: Mapping[str, str]) -> Audit:
    """Return an audit whose traces go below the build folder.

    Raises EnvironmentFault where there is no strace, or it may not trace.
    """
    program = shutil.which("strace", path=variables.get("PATH"))
    if program is None:
        hint = "install it, as in `apt install strace` or `dnf install strace`; it exists for Linux only"
        raise EnvironmentFault(Problem("'--audit' needs strace, which was not found", hint=hint))
    refused = ""
    for options in ((_FASTER, *_OPTIONS), _OPTIONS):
        refused = _refusal((program, *options))
        if not refused:
            return Audit((program, *options), build / FOLDER)
    hint = "in a container, allow it with `--cap-add=SYS_PTRACE`"
    raise EnvironmentFault(Problem(f"strace cannot trace programs here: {refused}", hint=hint))


def _refusal(strace: Sequence[str]) -> str:
    """Return why strace cannot trace a program that does nothing; '' when it can."""
    argv = (*strace, "-o", "/dev/null", "true")
    done = subprocess.run(argv, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False)
    said = done.stderr.strip().splitlines()
    return "" if done.returncode == 0 else (said[-1] if said else f"exit code {done.returncode}")


def _read(trace: Path, cwd: str) -> Accesses:
    """Return what a trace tells, in two passes, since it may be larger than memory."""
    with trace.open(encoding="utf-8", errors="surrogateescape") as lines:
        parents = started_by(lines)
    with trace.open(encoding="utf-8", errors="surrogateescape") as lines:
        return read_accesses(lines, cwd, parents)
