"""Which files a build read outside its own tree, from the records that ninja and compilers leave.

Compilers tell what they include, in a depfile beside each object; ninja takes those into its binary
log .ninja_deps (format versions 3 and 4), make leaves them. System and underlay headers among them are
inputs like the package's own sources.
"""

from __future__ import annotations

import os
import re
import struct
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

_SIGNATURE = b"# ninjadeps\n"
_WORD = re.compile(r"(?:\\.|[^\\\s])+")


def external_inputs(build: Path, inside: Sequence[Path]) -> tuple[str, ...]:
    """Return the absolute paths, sorted, that the last build below `build` read outside of `inside`.

    A log that cannot be read counts as no files: the compiler's own rules still hold.
    """
    own = tuple(f"{path}{os.sep}" for path in inside)
    found = {os.path.normpath(os.path.join(build, path)) for path in _recorded(build)}  # noqa: PTH118
    return tuple(sorted(path for path in found if not path.startswith(own)))


def _recorded(build: Path) -> Iterator[str]:
    try:
        yield from _ninja_inputs((build / ".ninja_deps").read_bytes())
    except OSError:
        yield from _make_inputs(build)


def _ninja_inputs(log: bytes) -> Iterator[str]:
    """Yield every input that the newest record of any output names."""
    if not log.startswith(_SIGNATURE) or len(log) < len(_SIGNATURE) + 4:
        return
    (version,) = struct.unpack_from("<i", log, len(_SIGNATURE))
    stamp_words = {3: 2, 4: 3}.get(version)
    if stamp_words is None:
        return
    paths: list[str] = []
    inputs: dict[int, tuple[int, ...]] = {}
    at = len(_SIGNATURE) + 4
    while at + 4 <= len(log):
        (head,) = struct.unpack_from("<I", log, at)
        size = head & 0x7FFFFFFF
        body = log[at + 4 : at + 4 + size]
        at += 4 + size
        if len(body) < size:
            break
        if head & 0x80000000:
            words = struct.unpack(f"<{size // 4}I", body)
            inputs[words[0]] = words[stamp_words:]
        else:
            paths.append(body[:-4].rstrip(b"\0").decode(errors="surrogateescape"))
    for identifier in {i for words in inputs.values() for i in words}:
        if identifier < len(paths):
            yield paths[identifier]


def _make_inputs(build: Path) -> Iterator[str]:
    """Yield the words behind the colon of every depfile below `build`."""
    for folder, _, files in os.walk(build):
        for name in files:
            if name.endswith(".o.d"):
                text = Path(folder, name).read_text(encoding="utf-8", errors="surrogateescape")
                _, _, words = text.replace("\\\n", " ").partition(": ")
                yield from (re.sub(r"\\(.)", r"\1", word) for word in _WORD.findall(words))
