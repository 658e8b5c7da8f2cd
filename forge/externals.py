"""Which files a build read outside its own tree, from the records that ninja and compilers leave.

Compilers tell what they include, in a depfile beside each object; ninja takes those into its binary
log .ninja_deps (format versions 3 and 4), make leaves them. What else a build reads stands in the rules
that CMake writes: libraries of others, and the files that CMake itself reads. System and underlay files
among all these are inputs like the package's own sources. CMake's own modules are left out: they come
and go with CMake, which counts as a tool.
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
_NINJA_EDGE = re.compile(r"^build (?:\$.|[^$:\n])+: \S+((?:\$.|[^$\n])*)", re.MULTILINE)
_NINJA_PATH = re.compile(r" (/(?:\$.|[^$\s])+)")
_READ_BY_CMAKE = re.compile(r'^  "(/[^"]+)"$', re.MULTILINE)
_MAKE_EDGE = re.compile(r"^[^#\s][^:\n]*: (/.+)$", re.MULTILINE)
_CMAKE_ITSELF = re.compile(r"/share/cmake(-[\d.]+)?/(Modules|Templates)/")


def external_inputs(build: Path, inside: Sequence[Path]) -> tuple[str, ...]:
    """Return the absolute paths, sorted, that the last build below `build` read outside of `inside`.

    A log that cannot be read counts as no files: the compiler's own rules still hold.
    """
    own = tuple(f"{path}{os.sep}" for path in inside)
    found = {os.path.normpath(os.path.join(build, path)) for path in _recorded(build)}  # noqa: PTH118
    return tuple(
        sorted(path for path in found if not path.startswith(own) and not _CMAKE_ITSELF.search(path))
    )


def _recorded(build: Path) -> Iterator[str]:
    rules = _text(build / "build.ninja")
    if rules:
        for edge in _NINJA_EDGE.finditer(rules):
            inputs = edge.group(1).partition(" || ")[0]
            yield from (re.sub(r"\$(.)", r"\1", path) for path in _NINJA_PATH.findall(inputs))
        try:
            yield from _ninja_inputs((build / ".ninja_deps").read_bytes())
        except OSError:
            return
    else:
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
            words = struct.unpack(f"<{size // 4}I", body[: size // 4 * 4])
            if words:
                inputs[words[0]] = words[stamp_words:]
        else:
            paths.append(body[:-4].rstrip(b"\0").decode(errors="surrogateescape"))
    for identifier in {i for words in inputs.values() for i in words}:
        if identifier < len(paths):
            yield paths[identifier]


def _make_inputs(build: Path) -> Iterator[str]:
    """Yield the words behind the colon of every depfile, what targets are made of, and what CMake read."""
    yield from _READ_BY_CMAKE.findall(_text(build / "CMakeFiles" / "Makefile.cmake").partition("\n  )\n")[0])
    for folder, _, files in os.walk(build):
        for name in files:
            if name.endswith(".o.d"):
                _, _, words = _text(Path(folder, name)).replace("\\\n", " ").partition(": ")
                yield from (re.sub(r"\\(.)", r"\1", word) for word in _WORD.findall(words))
            elif name == "build.make":
                edges = _MAKE_EDGE.findall(_text(Path(folder, name)))
                yield from (re.sub(r"\\(.)", r"\1", path) for path in edges)


def _text(path: Path) -> str:
    """Return what a file says, or nothing when it is not there."""
    try:
        return path.read_text(encoding="utf-8", errors="surrogateescape")
    except OSError:
        return ""
