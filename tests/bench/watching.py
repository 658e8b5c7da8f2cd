"""From a save to the line that says that it is built, under `forge build --watch`."""

import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tests.bench import workspaces
from tests.bench.commands import forge_build
from tests.bench.figures import Case, Series
from tests.bench.sitting import Sitting, run

_PATIENCE_SECONDS = 0.3
"""Between a build and the next save: a person's are further apart."""


def watching(sitting: Sitting) -> Iterator[Case]:
    """Measure saves of a Python module and of a message in a package that nobody needs."""
    size = sitting.size(10)
    for name, write, pattern, line in (
        ("a Python module", workspaces.write_python_workspace, "{0}/{0}/part_1.py", "# {}\n"),
        ("a message", workspaces.write_interface_workspace, "{0}/msg/*.msg", "int32 added_{}\n"),
    ):
        root = sitting.new_folder("watched")
        write(root, size)
        run(forge_build(), root)
        saved = min((root / "src").glob(pattern.format(f"bench_{size - 1:04}")))
        with _watch(root) as process:
            taken = [_save(process, saved, line.format(turn)) for turn in range(sitting.runs(9) + 1)]
        yield Case(name, {"forge": Series(tuple(taken[1:]))}, size)


@contextmanager
def _watch(root: Path) -> Iterator[subprocess.Popen[str]]:
    """Watch a workspace until the block is left."""
    process = subprocess.Popen(
        forge_build("--watch"), cwd=root, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True
    )
    try:
        _wait(process, "watching ")
        yield process
    finally:
        process.terminate()
        process.wait()
        if process.stdout:
            process.stdout.close()


def _save(process: subprocess.Popen[str], path: Path, line: str) -> float:
    """Return the milliseconds from a save until its line is there."""
    time.sleep(_PATIENCE_SECONDS)
    with path.open("a", encoding="utf-8") as stream:
        stream.write(line)
    start = time.perf_counter()
    _wait(process, " rebuilt in ")
    return 1000 * (time.perf_counter() - start)


def _wait(process: subprocess.Popen[str], words: str) -> None:
    """Read lines until one has the words; raises CalledProcessError when there are no more."""
    assert process.stdout
    for line in process.stdout:
        if words in line:
            return
    raise subprocess.CalledProcessError(process.wait(), process.args)
