"""Inputs that tools report in addition to those observed: compilers in depfiles, cargo in a list.

CMake's own modules are left out, since CMake is tracked as a tool.
"""

from __future__ import annotations

import os
import re
from functools import partial
from typing import TYPE_CHECKING

from forge.base.files import text_or_nothing
from forge.base.layout import SCRATCH_DIR
from forge.build.inputs.fingerprints import DIR_LISTING_SUFFIX, source_files, source_folders

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from forge.build.inputs.native_graph import NativeGraph

_text = partial(text_or_nothing, errors="surrogateescape")
_CMAKE_ROOT = re.compile(r"^CMAKE_ROOT:INTERNAL=(.+)$", re.MULTILINE)


def reported_inputs(build: Path, graph: NativeGraph, inside: Sequence[Path]) -> frozenset[str]:
    """Return the files outside of `inside` that the last build reportedly read, and its questions.

    `graph` is what the native tool knows of it.
    """
    own = tuple(f"{path}{os.sep}" for path in inside)
    cmakes = cmake_root(build)
    found = {*graph.known(), *graph.read_by_cmake, *_read_by_backend(build, inside)}
    return frozenset(
        path for path in found if not path.startswith(own) and not (cmakes and path.startswith(cmakes))
    )


def cmake_root(build: Path) -> str:
    """Return the folder of CMake's own modules, ending with '/', from the CMake cache, or ''."""
    match = _CMAKE_ROOT.search(_text(build / "CMakeCache.txt"))
    return f"{match.group(1)}/" if match else ""


def written_by_backend(build: Path) -> Iterator[str]:
    """Yield the Cargo.lock that cargo wrote."""
    return _listed(build, "written_by_backend")


def _read_by_backend(build: Path, inside: Sequence[Path]) -> Iterator[str]:
    """Yield the inputs of cargo; for a folder, its files and names."""
    for path in _listed(build, "read_by_backend"):
        if not os.path.isdir(path):
            yield path
        elif not any(f"{folder}/".startswith(f"{path}/") for folder in inside):
            yield from source_files(path)
            yield from (f"{folder}{DIR_LISTING_SUFFIX}" for folder in source_folders(path))


def _listed(build: Path, name: str) -> Iterator[str]:
    return filter(None, _text(build / SCRATCH_DIR / name).split("\n"))
