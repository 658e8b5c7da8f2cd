"""`forge bundle`: the install folder as one archive, without what only building needs."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from forge.bundling import write_bundle
from forge.errors import Problem
from forge.results import recorded_underlays
from forge.workspace import warn

if TYPE_CHECKING:
    import argparse

    from forge.cli import Parser


def register(parser: Parser) -> None:
    """Add the options of `forge bundle`."""
    parser.add_argument(
        "-o", "--output", metavar="FILE", help="the archive (default: the workspace's name and .tar.gz)"
    )
    parser.add_argument(
        "--with-build-files",
        action="store_true",
        help="with headers, CMake files and static libraries: others can build on it",
    )
    parser.add_argument(
        "--install-base",
        default="install",
        metavar="DIR",
        help="where the workspace is installed (default: install)",
    )


def run(options: argparse.Namespace) -> int:
    """Write the archive and tell what is in it; returns 0."""
    install = Path(options.install_base).absolute()
    output = Path(os.path.abspath(options.output or f"{Path.cwd().name}.tar.gz"))  # noqa: PTH100  (no '..' in it)
    files, size = write_bundle(install, output, build_files=options.with_build_files)
    print(f"{output}: {files} files, {size / 1e6:.1f} MB")
    underlays = [str(path) for path in recorded_underlays(install)]
    if underlays:
        hint = "have them in the same place where the archive is unpacked, or bundle them, too"
        warn([Problem(f"not in it: the underlays {', '.join(map(repr, underlays))}", hint=hint)])
    sys.stdout.flush()
    return 0
