"""Start the worker for rosidl's generators, which runs in the workspace's interpreter."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import TYPE_CHECKING

from forge.execution.fork_server import started_server
from forge.execution.worker_client import ROSIDL_WORKER_VARIABLE

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

_GRAMMAR = Path(__file__).parents[2] / "interfaces/idl/grammar.lark"


@contextlib.contextmanager
def rosidl_worker(python: Path, cache: Path, variables: Mapping[str, str]) -> Iterator[dict[str, str]]:
    """Start a worker and yield the variable that lets clients connect; stop it at the end of the block.

    `python` is the workspace's interpreter; `cache` is the folder for compiled templates.
    """
    program = str(Path(__file__).with_name("worker.py"))
    environment = {name: value for name, value in variables.items() if name != "PYTHONPATH"}

    def command(descriptor: int) -> tuple[str, ...]:
        return str(python), program, str(descriptor), str(_GRAMMAR), str(cache)

    with started_server(command, environment) as address:
        yield {ROSIDL_WORKER_VARIABLE: address}
