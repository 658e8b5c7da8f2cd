"""Run the steps of a build under strace and collect their file accesses."""

from __future__ import annotations

import shutil
import subprocess
from contextlib import contextmanager
from typing import TYPE_CHECKING

from forge.base.errors import HostError, Problem
from forge.base.layout import AUDIT_DIR
from forge.build.audit.accesses import CALLS, parent_processes, read_accesses

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from pathlib import Path

    from forge.build.audit.accesses import Accesses
    from forge.build.tasks import Step, StepKind, Task

_CALLS = ",".join(f"?{call}" for call in CALLS)  # '?': ignore calls that this machine does not have
_OPTIONS = ("-f", "-q", "-y", "-s", "0", "-e", "signal=none", "-e", f"trace={_CALLS}")
_FASTER = "--seccomp-bpf"
"""Stops programs only at traced calls, which is faster."""


class Audit:
    """The file accesses of the steps of a build, by package; each thread adds only to its own package."""

    def __init__(self, strace: Sequence[str], folder: Path) -> None:
        """Store the strace command and the folder for its output."""
        self._strace = tuple(strace)
        self._folder = folder
        self.steps: dict[str, list[tuple[StepKind, Accesses]]] = {}

    @contextmanager
    def launch(self, task: Task, step: Step) -> Iterator[Sequence[str]]:
        """Yield the argv that runs a step under strace; record its accesses afterwards."""
        steps = self.steps.setdefault(task.name, [])
        trace = self._folder / f"{task.name}.{len(steps)}"
        trace.parent.mkdir(parents=True, exist_ok=True)
        try:
            yield (*self._strace, "-o", str(trace), *step.argv)
            if trace.is_file():
                steps.append((step.kind, _read(trace, str(step.cwd))))
        finally:
            trace.unlink(missing_ok=True)

    def close(self) -> None:
        """Remove the folder of traces."""
        shutil.rmtree(self._folder, ignore_errors=True)


def start_audit(build: Path, variables: Mapping[str, str]) -> Audit:
    """Return an audit with its traces below the build folder.

    Raises HostError if strace is missing or not permitted to trace.
    """
    program = shutil.which("strace", path=variables.get("PATH"))
    if program is None:
        hint = "install it, for example with `apt install strace` or `dnf install strace` (Linux only)"
        raise HostError(Problem("'--audit' needs strace, which was not found", hint=hint))
    refused = ""
    for options in ((_FASTER, *_OPTIONS), _OPTIONS):
        refused = _refusal((program, *options))
        if not refused:
            return Audit((program, *options), build / AUDIT_DIR)
    hint = "in a container, allow it with `--cap-add=SYS_PTRACE`"
    raise HostError(Problem(f"strace cannot trace programs here: {refused}", hint=hint))


def _refusal(strace: Sequence[str]) -> str:
    """Return why strace cannot trace a trivial program, or '' if it can."""
    argv = (*strace, "-o", "/dev/null", "true")
    done = subprocess.run(argv, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False)
    errors = done.stderr.strip().splitlines()
    return "" if done.returncode == 0 else (errors[-1] if errors else f"exit code {done.returncode}")


def _read(trace: Path, cwd: str) -> Accesses:
    """Parse a trace in two passes, since it may be larger than memory."""
    with trace.open(encoding="utf-8", errors="surrogateescape") as lines:
        parents = parent_processes(lines)
    with trace.open(encoding="utf-8", errors="surrogateescape") as lines:
        return read_accesses(lines, cwd, parents)
