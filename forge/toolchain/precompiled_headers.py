"""Lets generated sources share precompiled headers of the C++ library and Python, once per workspace.

Reading these headers takes half of the time in which an interface package compiles, and most of the
compilers' memory. The script that compiles generated sources precompiles them when it first needs them;
GCC itself ignores a precompiled header that does not fit its version, its options or the defined macros.
What GCC does not check is whether the headers have changed since: that is done here, once per build.
"""

from __future__ import annotations

import hashlib
import re
import shutil
from typing import TYPE_CHECKING

from forge.base.files import text_or_nothing, write_if_changed
from forge.base.layout import TOOLCHAIN_DIR

if TYPE_CHECKING:
    from pathlib import Path

    from forge.base.frozen import Pairs

HEADERS_VARIABLE = "FORGE_PRECOMPILED_HEADERS"
"""The folder, in the environment of builds."""
LIBRARY_PATH_BELOW = "FORGE_LIBRARY_PATH_BELOW"
"""What LD_LIBRARY_PATH is without the packages of the workspace."""

CXX_HEADERS = "standard_headers.hpp"
PYTHON_HEADERS = "python_headers.h"
_TEXTS = {
    CXX_HEADERS: """\
// Headers of the C++ library that generated sources include; precompiled for each set of options.
#include <array>
#include <istream>
#include <limits>
#include <map>
#include <memory>
#include <string>
#include <vector>
""",
    PYTHON_HEADERS: """\
// Headers that generated Python extensions include; precompiled for each set of options.
#include <Python.h>
#include <stdbool.h>
#include <stdint.h>
""",
}
_PATH = re.compile(r"(?:\\.|[^\s\\])+")


def prepare_precompiled_headers(build: Path, tools: Pairs) -> dict[str, str]:
    """Prepare the folder in a workspace's build folder; return the variable that names it.

    Removes what was precompiled by other `tools`, from headers that have changed since, or only in part.
    """
    above = build / TOOLCHAIN_DIR / "headers"
    key = "\0".join(f"{name}={identity}" for name, identity in tools)
    folder = above / hashlib.blake2b(key.encode(errors="surrogateescape"), digest_size=8).hexdigest()
    for other in above.glob("*"):
        if other != folder:
            shutil.rmtree(other, ignore_errors=True)
    for header, text in _TEXTS.items():
        (folder / f"{header}.gch").mkdir(parents=True, exist_ok=True)
        write_if_changed(folder / header, text)
    for draft in folder.iterdir():
        if draft.is_dir() and draft.suffix != ".gch":
            _remove_outdated(draft)
    return {HEADERS_VARIABLE: str(folder)}


def _remove_outdated(draft: Path) -> None:
    """Remove what was precompiled by way of a folder, unless it is complete and current."""
    for header in _TEXTS:
        result = draft.parent / f"{header}.gch" / draft.name
        if _is_current(result, draft / f"{header}.d"):
            return
        result.unlink(missing_ok=True)
    shutil.rmtree(draft, ignore_errors=True)


def _is_current(result: Path, depfile: Path) -> bool:
    """Tell whether none of the headers in a depfile has changed since the result was made.

    By their change times: an installed package keeps the modification times of its files.
    """
    _, found, paths = text_or_nothing(depfile).replace("\\\n", " ").partition(":")
    try:
        made = result.stat().st_mtime_ns
        headers = (re.sub(r"\\(.)", r"\1", path) for path in _PATH.findall(paths))
        return bool(found) and all((result.parent / path).stat().st_ctime_ns < made for path in headers)
    except OSError:
        return False
