"""`forge extensions`: what forge knows, table by table; there is nothing to install beside it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from forge.options import CLUSTER, EXECUTORS
from forge.recipes import RECIPES
from forge.reporting import HANDLERS
from forge.shells import SHELLS
from forge.testing.recipes import TEST_RECIPES

if TYPE_CHECKING:
    import argparse

    from forge.cli import Parser


def register(parser: Parser) -> None:
    """Add nothing: `forge extensions` takes no options."""


def run(options: argparse.Namespace) -> int:  # noqa: ARG001  (every command is run with its options)
    """Print each table with its rows."""
    handlers = [f"{name}{'+' if on else '-'}" for name, on in HANDLERS.items()]
    tables = {
        "build types": sorted(RECIPES),
        "tested build types": sorted(TEST_RECIPES),
        "event handlers": sorted(handlers),
        "executors": sorted((*EXECUTORS, CLUSTER)),
        "shells": sorted(SHELLS),
    }
    for title, rows in tables.items():
        print(f"{title}: {' '.join(rows)}")
    return 0
