"""Lets generated sources share precompiled headers of the C++ library and Python, once per workspace.

Reading these headers takes half of the time in which an interface package compiles, and most of the
compilers' memory. The script that compiles generated sources precompiles them when it first needs them, for
each set of options. GCC ignores a precompiled header that does not fit its version or the defined macros, but
it does not check whether the headers have changed since: that is done here, once per build.
"""

from __future__ import annotations

import hashlib
import re
import shutil
from pathlib import Path

from forge.base.files import text_or_nothing, write_if_changed
from forge.base.frozen import Pairs
from forge.base.layout import TOOLCHAIN_DIR

HEADERS_VARIABLE = "FORGE_PRECOMPILED_HEADERS"
"""The folder, in the environment of builds."""

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

    `tools` are the programs and variables that compilers depend on. Removes what was precompiled by others,
    from headers that have changed since, or not to the end.
    """
    above = build / TOOLCHAIN_DIR / "headers"
    key = "\0".join(f"{name}={identity}" for name, identity in tools)
    folder = above / hashlib.blake2b(key.encode(errors="surrogateescape"), digest_size=8).hexdigest()
    for other in above.glob("*"):
        if other != folder:
            shutil.rmtree(other, ignore_errors=True)
    folder.mkdir(parents=True, exist_ok=True)
    for header, text in _TEXTS.items():
        write_if_changed(folder / header, text)
    for one in folder.iterdir():
        if one.is_dir() and not any(_is_current(one, header, text) for header, text in _TEXTS.items()):
            shutil.rmtree(one, ignore_errors=True)
    return {HEADERS_VARIABLE: str(folder)}


def _is_current(folder: Path, header: str, text: str) -> bool:
    """Tell whether a folder has a precompiled header, and nothing that it includes has changed since.

    By the change times: an installed package keeps the modification times of its files.
    """
    _, found, paths = text_or_nothing(folder / f"{header}.d").replace("\\\n", " ").partition(":")
    try:
        (folder / f"{header}.gch").stat()
        made = (folder / "ready").stat().st_mtime_ns
        headers = (re.sub(r"\\(.)", r"\1", path) for path in _PATH.findall(paths))
        unchanged = all((folder / path).stat().st_ctime_ns < made for path in headers)
        return bool(found) and unchanged and text_or_nothing(folder / header) == text
    except OSError:
        return False
