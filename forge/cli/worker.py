"""A preloaded forge process for the many short commands of one build.

Starting an interpreter and importing modules takes much of the time of `forge interface generate` and of
installing a wheel. The worker imports them once and forks for each request.
"""

from __future__ import annotations

import contextlib
import importlib
import os
import sys
from collections.abc import Iterator
from pathlib import Path

from forge.cli.main import main as run_command
from forge.engine.observation import LINKS_VARIABLE, LOG_VARIABLE
from forge.engine.observed import observe_for
from forge.execution.fork_server import Call, serve, started_server
from forge.execution.worker_client import WORKER_VARIABLE
from forge.toolchain.interpreter import own_command

INTERFACE_MODULES = (
    "forge.cli.commands.interface",
    "forge.interfaces.writing",
    "forge.interfaces.read.parsing",
    "jinja2",
    "lark",
)
WHEEL_MODULES = ("forge.cli.install_wheel",)


@contextlib.contextmanager
def worker(*modules: str, library: Path | None = None) -> Iterator[dict[str, str]]:
    """Start a worker that has imported `modules`, and yield the variables that let clients connect.

    With the `library` of the observer, requests from observed steps are observed as well.
    """

    def command(descriptor: int) -> tuple[str, ...]:
        return own_command("-m", "forge.cli.worker", str(descriptor), *modules)

    variables = {
        name: value for name, value in os.environ.items() if name not in {LOG_VARIABLE, LINKS_VARIABLE}
    }
    if library is not None:
        variables["LD_PRELOAD"] = " ".join(filter(None, (variables.get("LD_PRELOAD"), str(library))))
    with started_server(command, variables) as address:
        yield {WORKER_VARIABLE: address}


def main(descriptor: str, *modules: str) -> int:
    """Serve requests from a listening socket until stdin is closed."""
    return serve(int(descriptor), _run, lambda: [importlib.import_module(module) for module in modules])


def _run(call: Call) -> int:
    """Run a forge command line, or after '-m' the main function of a module."""
    if call.argv[:1] != ["-m"]:
        observe_for(call.client)
        return run_command(call.argv)
    code: int = importlib.import_module(call.argv[1]).main(call.argv[2:])
    return code


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
