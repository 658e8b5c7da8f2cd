"""Separate what matters to users in the output of a failed build backend."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from forge.base.files import text_or_nothing

if TYPE_CHECKING:
    from pathlib import Path

DISK_FULL = re.compile(
    r"\[Errno (?:28|122)\]|: (?:No space left on device|Disk quota exceeded)$", re.MULTILINE
)
"""In the output of a failed backend: where it was writing is of no interest."""
_FAILED_WRITE = re.compile(
    r"^(?:Traceback \(most recent call last\):\n(?:  .*\n)+"
    r"|Exception ignored in: .*\n|\w*[eE]rror: \[Errno .*\n)",
    re.MULTILINE,
)
_OF_SETUPTOOLS = re.compile(r"^running (?:bdist_wheel|install|egg_info)$", re.MULTILINE)
_PROGRESS = re.compile(
    r"^(?:running [a-z_]+|(?:creating|writing|reading|adding|removing|installing|byte-compiling) .*"
    r"|(?:copying|copying and adjusting|moving|hard linking) .* -> .*"
    r"|warning: \w+: byte-compiling is disabled, skipping\.\n?)\n",
    re.MULTILINE,
)
"""What setuptools prints before an error."""
_CODE = r"(?:    .*\n)*"
_OUTER_FRAMES = re.compile(
    r"^(Traceback \(most recent call last\):\n)"
    rf'(?:  File "<string>", .*\n{_CODE}(?=  File ".*backend_tracer\.py"))?'
    rf'(?:  File ".*(?:backend_tracer|setup_install|_in_process|setuptools/build_meta)\.py", .*\n{_CODE})+'
    r'(?:  File "(?:<string>|setup\.py)", line (\d+), in <module>\n'
    rf"({_CODE})|(?=  File ))",
    re.MULTILINE,
)
"""The frames of forge and setuptools that start a backend, and that of setup.py, which may lack its name."""


def progress_and_failure(output: str, setup: Path) -> tuple[str, str]:
    """Return the progress messages of setuptools, and the remaining output of a failed backend.

    Tracebacks start in the package's setup.py, or in the backend, not in the code that starts it.
    """
    progress = "".join(_PROGRESS.findall(output)) if _OF_SETUPTOOLS.search(output) else ""
    failure = _PROGRESS.sub("", output) if progress else output
    if DISK_FULL.search(output):
        return progress, _FAILED_WRITE.sub("", failure)
    lines = text_or_nothing(setup).splitlines()

    def shortened(match: re.Match[str]) -> str:
        title, line, code = match.groups()
        if line is None:
            return title
        source = "".join(f"    {text.strip()}\n" for text in lines[int(line) - 1 : int(line)])
        return f'{title}  File "{setup}", line {line}, in <module>\n{code or source}'

    return progress, _OUTER_FRAMES.sub(shortened, failure)
