"""The time that clang needs for each header of the slowest source files of a build.

Compilers do not report times of headers in a normal build, so these files are compiled once more after the
build, by clang with -ftime-trace; the resulting files are removed. The build may use another compiler.
"""

from __future__ import annotations

import contextlib
import json
import os
import re
import shlex
import shutil
import subprocess
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from pathlib import Path
from typing import Any

from forge.base.frozen import frozen

_COMPILER = re.compile(r"(?:.*[/-])?(c\+\+|g\+\+|clang\+\+|cc|gcc|clang)(?:-\d[\d.]*)?")
_TIMEOUT_SECONDS = 120
_MOST = 40
"""The number of headers that are reported."""
_MICRO = 1e-6
_INVALID = (OSError, ValueError, LookupError, TypeError, AttributeError, RecursionError)
"""Exceptions raised by files that were not written by CMake and clang."""
_OWN_OUTPUTS = frozenset({"-o", "-MF", "-MT", "-MQ"})
_DEPFILES = frozenset({"-MD", "-MMD", "-MP", "-c"})


@frozen
class Header:
    """The seconds that a header took, including nested headers, and the number of files that include it."""

    path: str
    seconds: float
    files: int


@frozen
class HeaderTimes:
    """The seconds that clang needed to read `files`: in total, in headers, and to instantiate templates.

    It could not compile `failed` further files.
    """

    compiler: str
    files: int
    failed: int
    total: float
    in_headers: float
    in_templates: float
    headers: tuple[Header, ...]

    @staticmethod
    def read(event: Mapping[str, Any]) -> HeaderTimes:
        """Return the times that an event describes."""
        headers = tuple(Header(*values) for values in event["headers"])
        names = ("compiler", "files", "failed", "total", "in_headers", "in_templates")
        return HeaderTimes(**{name: event[name] for name in names}, headers=headers)

    @property
    def members(self) -> Mapping[str, object]:
        """Return the members of its event."""
        return {
            "compiler": self.compiler,
            "files": self.files,
            "failed": self.failed,
            "total": round(self.total, 3),
            "in_headers": round(self.in_headers, 3),
            "in_templates": round(self.in_templates, 3),
            "headers": [[each.path, round(each.seconds, 3), each.files] for each in self.headers],
        }


def find_clang(variables: Mapping[str, str]) -> str | None:
    """Return the path of clang++ on PATH."""
    return shutil.which("clang++", path=variables.get("PATH"))


def measure_headers(
    outputs: Sequence[tuple[Path, str]], clang: str, variables: Mapping[str, str], jobs: int
) -> HeaderTimes:
    """Compile source files again; `outputs` are the build folders and objects of earlier compilations."""
    commands = [
        command for folder, output in outputs if (command := _recorded(folder, output, clang)) is not None
    ]
    with tempfile.TemporaryDirectory(prefix="forge-headers-") as scratch, ThreadPoolExecutor(jobs) as pool:
        traces = [
            trace
            for trace in pool.map(
                lambda item: _traced(item[1], Path(scratch, f"{item[0]}.o"), variables), enumerate(commands)
            )
            if trace is not None
        ]
    return summarize(clang, traces, len(outputs) - len(traces))


def summarize(clang: str, traces: Sequence[Sequence[Mapping[str, Any]]], failed: int) -> HeaderTimes:
    """Add up the events of the traces, one for each file."""
    seconds: dict[str, float] = {}
    files: dict[str, int] = {}
    totals = {"Total Frontend": 0.0, "Total Source": 0.0}
    in_templates = 0.0
    for trace in traces:
        in_file: dict[str, float] = {}
        instantiations = [
            (event["ts"] * _MICRO, (event["ts"] + event["dur"]) * _MICRO)
            for event in trace
            if event.get("name", "").startswith("Instantiate")
        ]
        in_templates += _covered(instantiations)
        for event in trace:
            name, took = event.get("name", ""), event.get("dur", 0) * _MICRO
            if name == "Source":
                path = os.path.normpath(event["args"]["detail"])
                # A header without guards is read more than once.
                in_file[path] = in_file.get(path, 0.0) + took
            elif name in totals:
                totals[name] += took
        for path, took in in_file.items():
            seconds[path] = seconds.get(path, 0.0) + took
            files[path] = files.get(path, 0) + 1
    slowest = sorted(seconds, key=lambda path: (-seconds[path], path))[:_MOST]
    return HeaderTimes(
        compiler=clang,
        files=len(traces),
        failed=failed,
        total=totals["Total Frontend"],
        in_headers=totals["Total Source"],
        in_templates=in_templates,
        headers=tuple(Header(path, seconds[path], files[path]) for path in slowest),
    )


def _covered(spans: Iterable[tuple[float, float]]) -> float:
    """Return the length of the union of spans."""
    covered, until = 0.0, float("-inf")
    for begun, ended in sorted(spans):
        covered += max(0.0, ended - max(begun, until))
        until = max(until, ended)
    return covered


def _recorded(folder: Path, output: str, clang: str) -> tuple[list[str], str] | None:
    """Return the command that compiled an object, for clang and without outputs, and its folder."""
    with contextlib.suppress(*_INVALID):
        for entry in json.loads((folder / "compile_commands.json").read_bytes()):
            words = shlex.split(entry["command"])
            path = next((value for word, value in pairwise(words) if word == "-o"), None)
            if path and os.path.normpath(Path(entry["directory"], path)) == output:
                return [*for_clang(words, clang)], entry["directory"]
    return None


def for_clang(words: Sequence[str], clang: str) -> Iterator[str]:
    """Yield a compiler's command for clang, without launchers and outputs; raises LookupError without one."""
    matches = (_COMPILER.fullmatch(word) for word in words)
    index, kind = next(((index, match[1]) for index, match in enumerate(matches) if match), (0, ""))
    if not kind:
        raise LookupError(words)
    yield clang if kind.endswith("++") else clang.replace("clang++", "clang")
    skipped = False
    for word in words[index + 1 :]:
        if word == "&&":  # a command that CMake appends
            return
        if skipped or word in _OWN_OUTPUTS:
            skipped = not skipped
        elif word not in _DEPFILES:
            yield word


def _traced(
    command: tuple[Sequence[str], str], output: Path, variables: Mapping[str, str]
) -> list[Mapping[str, Any]] | None:
    """Run clang, and return its trace; None if it cannot compile the file."""
    # Ignore warnings and options that only GCC knows; the generated code is not used.
    quiet = ("-w", "-Qunused-arguments", "-Wno-unknown-warning-option", "-O0")
    with contextlib.suppress(subprocess.TimeoutExpired, *_INVALID):
        result = subprocess.run(
            [*command[0], *quiet, "-ftime-trace", "-c", "-o", str(output)],
            cwd=command[1],
            env=variables,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            timeout=_TIMEOUT_SECONDS,
            check=False,
        )
        output.unlink(missing_ok=True)
        if result.returncode:
            return None
        events: list[Mapping[str, Any]] = json.loads(output.with_suffix(".json").read_bytes())["traceEvents"]
        return events
    return None
