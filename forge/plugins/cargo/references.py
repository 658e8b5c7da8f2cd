"""Finds variables and crates outside of the workspace that Rust sources and build scripts refer to."""

from __future__ import annotations

import os
import re
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from forge.build.inputs.fingerprints import source_files
from forge.workspace.references import References

if TYPE_CHECKING:
    from collections.abc import Callable

_ENV = re.compile(r"\b(?:option_)?env!\s*[(\[{]\s*\"(\w+)\"")
_VAR = re.compile(r"\bvar(?:_os)?\s*\(\s*\"(\w+)\"")
_RERUN = re.compile(r"\brerun-if-env-changed=(\w+)")
_CAPITALS = re.compile(r"['\"]([A-Z][A-Z0-9_]+)['\"]")
"""Names looked up through a variable, as in a loop over names."""
_PATH = re.compile(r"""\bpath\s*=\s*["']([^"'\n]+)["']""")


def reader_of(path: str) -> Callable[[str], References] | None:
    """Return the function to search Rust sources and Cargo.toml, None for other files."""
    folder, _, name = path.rpartition("/")
    if name == "Cargo.toml":
        return partial(in_manifest, folder)
    if name == "build.rs":
        return in_script
    return in_source if name.endswith(".rs") else None


def in_source(text: str) -> References:
    """Return the variables that a Rust source reads while it is compiled.

    Other crates compile them too. A file that prints instructions to cargo is part of a build script.
    """
    variables = frozenset(_ENV.findall(text))
    return in_script(text) if "cargo:" in text else References(variables=variables, exported=variables)


def in_script(text: str) -> References:
    """Return the variables that a build script of cargo reads."""
    variables = frozenset(_ENV.findall(text))
    if "env" in text:
        variables |= {*_RERUN.findall(text), *_VAR.findall(text), *_CAPITALS.findall(text)}
    return References(variables=variables, exported=variables)


def in_manifest(folder: str, text: str) -> References:
    """Return the files that a Cargo.toml in `folder` names, and the sources of the crates that it names."""
    paths = {os.path.normpath(Path(folder, word)) for word in _PATH.findall(text)}
    crates = (source_files(path) for path in paths if Path(path, "Cargo.toml").is_file())
    return References(included=frozenset(paths).union(*(filter(reader_of, files) for files in crates)))
