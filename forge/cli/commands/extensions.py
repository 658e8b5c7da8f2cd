"""`forge extensions`: list supported build types, event handlers, executors and shells."""

from __future__ import annotations

from typing import TYPE_CHECKING

from forge.build.recipes import RECIPES
from forge.environment.shells import SHELLS
from forge.execution.options import DASK, EXECUTORS
from forge.output.handlers import HANDLERS
from forge.testing.recipes import TEST_RECIPES

if TYPE_CHECKING:
    import argparse

    from forge.cli.main import Parser


def register(parser: Parser) -> None:
    """Do nothing: `forge extensions` has no options."""


def run(options: argparse.Namespace) -> int:  # noqa: ARG001  (every command is run with its options)
    """Print the lists."""
    handlers = [f"{name}{'+' if on else '-'}" for name, on in HANDLERS.items()]
    tables = {
        "build types": sorted(RECIPES),
        "tested build types": sorted(TEST_RECIPES),
        "event handlers": sorted(handlers),
        "executors": sorted((*EXECUTORS, DASK)),
        "shells": sorted(SHELLS),
    }
    for title, rows in tables.items():
        print(f"{title}: {' '.join(rows)}")
    return 0
