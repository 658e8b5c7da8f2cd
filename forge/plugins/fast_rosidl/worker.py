"""A warm process for rosidl's generators and scripts of ament: `python worker.py DESCRIPTOR GRAMMAR [CACHE]`.

The workspace's interpreter runs this file, which may not have forge. A command that fails here is left to the
client, which runs it unchanged in a separate process.
"""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import IO

_PACKAGE = Path(__file__).resolve().parents[2]

if __name__ == "__main__":
    # Only forge itself is found there, not packages installed beside it.
    sys.path.pop(0)
    spec = spec_from_file_location(
        "forge", _PACKAGE / "__init__.py", submodule_search_locations=[str(_PACKAGE)]
    )
    assert spec
    sys.modules["forge"] = module_from_spec(spec)

from collections.abc import Mapping

from forge.execution.fork_server import Call, serve
from forge.execution.worker_client import DECLINED, DECLINED_PREFIX
from forge.plugins.fast_rosidl.generators import SCRIPTS, DeclinedError, Generators

_PREFIXES = ("PYTHON", "LC_", "LANG")
"""Variables that an interpreter reads when it starts."""

_OTHER_SETTINGS = frozenset({"PYTHONPATH", "PYTHONDONTWRITEBYTECODE", "PYTHONUNBUFFERED"})
"""Variables among these that are respected here or have no effect."""


def main(descriptor: str, cache: str = "") -> int:
    """Serve commands from a listening socket until stdin is closed."""
    generators = Generators(Path(cache) if cache else None)
    settings = _settings(os.environ)

    def run(call: Call) -> int:
        try:
            if Path(call.argv[0]) != Path(sys.executable) or _settings(call.environment) != settings:
                raise DeclinedError("it has a different interpreter or locale")
            _run_quietly(generators, call)
        except DeclinedError as reason:
            name = Path(call.argv[1]).name
            if name not in SCRIPTS:  # CMake starts these two in every package; do not print a message
                sys.stderr.write(f"{DECLINED_PREFIX}{name} in a separate process: {reason}\n")
            return DECLINED
        return 0

    return serve(int(descriptor), run, prepare=lambda call: generators.prepare(call.argv, call.environment))


def _temporary_file() -> IO[bytes]:
    try:
        return tempfile.TemporaryFile()
    except OSError as error:
        raise DeclinedError(f"cannot write a temporary file: {error.strerror}") from None


def _run_quietly(generators: Generators, call: Call) -> None:
    """Run a command and forward its output, unless it is declined: then it runs again."""
    with _temporary_file() as output, _temporary_file() as errors:
        clients = [os.dup(1), os.dup(2)]
        os.dup2(output.fileno(), 1)
        os.dup2(errors.fileno(), 2)
        try:
            generators.run(call.argv, call.environment)
        finally:
            for stream in (sys.stdout, sys.stderr):
                stream.flush()
            for target, client in enumerate(clients, start=1):
                os.dup2(client, target)
        for target, stream in enumerate((output, errors), start=1):
            stream.seek(0)
            with open(target, "wb", closefd=False) as client_stream:
                shutil.copyfileobj(stream, client_stream)


def _settings(variables: Mapping[str, str]) -> dict[str, str]:
    return {
        name: value
        for name, value in variables.items()
        if name.startswith(_PREFIXES) and name not in _OTHER_SETTINGS
    }


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
