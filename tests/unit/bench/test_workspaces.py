"""Workspaces of the bench: the same for the same seed, with the requested size and shape."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import pytest

from tests.bench.trees import watched
from tests.bench.workspaces import (
    SHAPES,
    write_ament_workspace,
    write_interface_workspace,
    write_python_workspace,
    write_workspace,
)

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from tests.conftest import Forge

WRITERS = (write_workspace, write_ament_workspace, write_python_workspace, write_interface_workspace)


def texts(root: Path) -> dict[str, str]:
    """Return every file below a folder by its relative path."""
    return {str(p.relative_to(root)): p.read_text(encoding="utf-8") for p in root.rglob("*") if p.is_file()}


def test_a_seed_gives_one_workspace(tmp_path: Path) -> None:
    first, same, other = (
        texts(write_workspace(tmp_path / str(number), 12, files=1, seed=seed))
        for number, seed in enumerate((1, 1, 2))
    )
    assert first == same != other


@pytest.mark.parametrize("write", WRITERS, ids=lambda write: write.__name__)
def test_a_generated_workspace_has_the_asked_number_of_packages(
    forge: Forge, tmp_path: Path, write: Callable[[Path, int], Path]
) -> None:
    root = write(tmp_path / "ws", 25)
    assert len(forge("list", "--names-only", cwd=root).out.split()) == 25


@pytest.mark.parametrize(("shape", "longest"), [("wide", 2), ("deep", 12)])
def test_shapes_are_as_deep_as_they_say(forge: Forge, tmp_path: Path, shape: str, longest: int) -> None:
    assert shape in SHAPES
    root = write_workspace(tmp_path, 12, files=1, shape=shape)
    depths: dict[str, int] = {}
    for line in forge("list", "--topological-order", "--names-only", cwd=root).out.split():
        needs = forge("info", line, cwd=root).out.partition("build:")[2].partition("\n")[0].split()
        depths[line] = 1 + max((depths[need] for need in needs if need in depths), default=0)
    assert max(depths.values()) == longest


def test_a_tree_that_has_gone_holds_nothing() -> None:
    with watched(2**22 + 1) as peak:
        time.sleep(0.01)
    assert peak.megabytes is None
