"""What is measured: each scenario makes its workspace and names the command lines to compare."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from typing import TYPE_CHECKING

from tests.bench import builds, configures
from tests.bench.timing import Variant
from tests.bench.workspaces import write_workspace

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from pathlib import Path


@dataclass(frozen=True, slots=True)
class Peers:
    """Other tools to measure beside forge; None where there is none."""

    colcon: str | None = None


def start(folder: Path, peers: Peers) -> tuple[Variant, ...]:
    """Measure how long forge takes to say what it can do, beside a bare interpreter."""
    del peers
    return _base(folder), Variant("forge --help", (*builds.forge(), "--help"), folder)


def list_100(folder: Path, peers: Peers) -> tuple[Variant, ...]:
    """Measure the listing of 100 packages among 2,000 files."""
    root = write_workspace(folder, 100)
    variants = [_base(root), Variant("forge list", (*builds.forge(), "list"), root)]
    if peers.colcon:
        variants.append(Variant("colcon list", (peers.colcon, "--log-base", "/dev/null", "list"), root))
    return tuple(variants)


SCENARIOS: Mapping[str, Callable[[Path, Peers], tuple[Variant, ...]]] = {
    "start": start,
    "list-100": list_100,
    "configure": configures.configure,
    **builds.SCENARIOS,
}


def _base(folder: Path) -> Variant:
    return Variant("python -c pass", (sys.executable, "-c", "pass"), folder)
