"""What is measured: each scenario makes its workspace and names the command lines to compare."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import dataclass
from typing import TYPE_CHECKING

from tests.bench import builds, configures, sourcing
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


def complete_300(folder: Path, peers: Peers) -> tuple[Variant, ...]:
    """Measure a press of the key for a package's name in bash: to be below a tenth of a second.

    The script is sourced beforehand in life, and here in the variant to compare with.
    """
    del peers
    root = write_workspace(folder / "ws", 300, files=1)
    asked = subprocess.run(
        (*builds.forge(), "completion", "bash"), cwd=root, check=True, capture_output=True, text=True
    )
    script = folder / "completion.bash"
    script.write_text(asked.stdout, encoding="utf-8")
    words = f"COMP_WORDS=({' '.join(COMPLETED)}) COMP_CWORD={len(COMPLETED) - 1}"
    press = f'{words}; _forge; [ "${{#COMPREPLY[@]}}" = 100 ]'
    sourced = ("bash", "--norc", "-c")
    cache = {"XDG_CACHE_HOME": str(folder / "cache")}
    return (
        _base(root),
        Variant("bash, script sourced", (*sourced, f". {script}"), root, env=cache),
        Variant("bash, key pressed", (*sourced, f". {script}; {press}"), root, env=cache),
    )


COMPLETED = ("forge", "build", "--packages-select", "bench_01")
"""A command line of which the last word is to be completed, to one of a hundred names."""

SCENARIOS: Mapping[str, Callable[[Path, Peers], tuple[Variant, ...]]] = {
    "start": start,
    "list-100": list_100,
    "complete-300": complete_300,
    "configure": configures.configure,
    **builds.SCENARIOS,
    **sourcing.SCENARIOS,
}


def _base(folder: Path) -> Variant:
    return Variant("python -c pass", (sys.executable, "-c", "pass"), folder)
