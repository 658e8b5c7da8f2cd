"""`forge env`: print the environment variables that sourcing the workspace sets."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from forge.base.errors import Problem, SelectionError
from forge.base.names import did_you_mean
from forge.environment.export import FORMATS
from forge.environment.sourcing import sourced_environment

if TYPE_CHECKING:
    import argparse

    from forge.cli.main import Parser


def register(parser: Parser) -> None:
    """Add the options of `forge env`."""
    parser.add_argument(
        "names", nargs="*", metavar="VARIABLE", help="print only these variables, changed or not"
    )
    parser.add_argument("--format", choices=FORMATS, default="sh", help="output format (default: sh)")
    parser.add_argument(
        "--install-base",
        default="install",
        metavar="DIR",
        help="install folder (default: install)",
    )


def run(options: argparse.Namespace) -> int:
    """Print the variables that sourcing would change in this environment; returns 0."""
    before = dict(os.environ)
    after = sourced_environment(Path(options.install_base).absolute(), before)
    changed = {name: value for name, value in after.items() if before.get(name) != value}
    gone = before.keys() - after.keys()
    if options.names:
        unknown = [name for name in options.names if name not in after]
        if unknown:
            hints = {name: did_you_mean(name, after) for name in unknown}
            raise SelectionError(
                *(
                    Problem(f"variable '{name}' is not set after sourcing", hint=hint)
                    for name, hint in hints.items()
                )
            )
        changed, gone = {name: after[name] for name in options.names}, set()
    sys.stdout.write(FORMATS[options.format](changed, gone))
    return 0
