"""What only Python itself knows of a build backend: missing modules, variables, listed folders, metadata.

The observer sees all other files. It cannot tell a module that was not found, since Python lists the folders
of its search path, nor a variable, since Python copies the environment.
"""

from __future__ import annotations

import contextlib
import json
import os
import re
from dataclasses import field
from typing import TYPE_CHECKING

from forge.base.frozen import frozen
from forge.build.inputs.fingerprints import DIR_LISTING_SUFFIX
from forge.engine.world import PROGRAM, about_variables

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

_CLOSED = re.compile(r"/lib-dynload$|-packages/")


@frozen
class Traced:
    """The parsed log of `backend_tracer`; `missing`: only installed packages import the module."""

    read: set[str] = field(default_factory=set)
    written: set[str] = field(default_factory=set)
    listed: set[str] = field(default_factory=set)
    started: set[str] = field(default_factory=set)
    asked: set[str] = field(default_factory=set)
    missing: dict[str, bool] = field(default_factory=dict)
    search_path: set[str] = field(default_factory=set)


def parse_trace(text: str) -> Traced:
    """Parse a log; invalid lines, such as those of two concurrent writers, are ignored."""
    traced = Traced()
    for line in text.splitlines():
        with contextlib.suppress(ValueError, TypeError):
            match json.loads(line):
                case ["read" | "written" | "listed" as word, str(path)]:
                    getattr(traced, word).add(os.path.normpath(path))
                case ["started" | "asked" as word, str(name)]:
                    getattr(traced, word).add(name)
                case ["missing", str(module), bool(optional)]:
                    traced.missing[module] = optional
                case ["interpreter", [*entries]]:
                    traced.search_path.update(os.path.normpath(entry) for entry in entries if entry)
    return traced


def external_inputs(traced: Traced, inside: Sequence[str]) -> tuple[str, ...]:
    """Return files outside of the folders `inside` and questions; FOLDER/. represents the names in a folder.

    Files that the build wrote itself are not inputs.
    """
    own = tuple(f"{folder}{os.sep}" for folder in inside)

    def is_input(path: str) -> bool:
        return not f"{path}{os.sep}".startswith(own) and path not in traced.written

    files = {*traced.read, *_candidates(traced.missing, traced.search_path)}
    listed = {os.path.realpath(path) for path in traced.listed} - traced.search_path
    folders = {f"{path}{DIR_LISTING_SUFFIX}" for path in listed if os.path.isdir(path) and is_input(path)}
    programs = {name for name in traced.started if os.sep not in name}
    return tuple(
        sorted(
            {
                *filter(is_input, files),
                *folders,
                *(f"{PROGRAM}{name}" for name in programs),
                *about_variables(traced.asked),
            }
        )
    )


def _candidates(modules: Mapping[str, bool], search_path: Iterable[str]) -> Iterator[str]:
    """Yield the files that would be read if missing modules were installed.

    A module that only an installed package would use, such as Cython, is a folder.
    """
    for folder in search_path:
        # No modules are installed into folders of the standard library or of a distribution.
        if os.path.isdir(folder) and not _CLOSED.search(folder) and not os.path.exists(f"{folder}/os.py"):
            for module, optional in modules.items():
                yield f"{folder}/{module}/__init__.py"
                if not optional:
                    yield f"{folder}/{module}.py"
