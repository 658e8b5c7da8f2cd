"""What the README and the docs tell the reader to type works as told."""

from __future__ import annotations

import shutil
from typing import TYPE_CHECKING

import pytest

from tests.snippets import ROOT, TYPED, blocks, commands, run

if TYPE_CHECKING:
    from pathlib import Path

DOCUMENTS = sorted({ROOT / "README.md", *(ROOT / "docs").rglob("*.md")})
TUTORIAL = ROOT / "docs/tutorial.md"  # tests/e2e/test_tutorial.py follows it, and goes on from where it ends


def _name(document: Path) -> str:
    return document.relative_to(ROOT).as_posix()


@pytest.mark.parametrize("document", DOCUMENTS, ids=_name)
def test_a_block_that_is_not_run_says_why(document: Path) -> None:
    for block in blocks(document.read_text(encoding="utf-8")):
        if block.language in TYPED and not commands(block):
            assert block.mark.startswith("not run: "), f"{document}:{block.line}"


@pytest.mark.parametrize("document", DOCUMENTS, ids=_name)
def test_every_link_to_a_file_leads_there(document: Path) -> None:
    text = document.read_text(encoding="utf-8")
    targets = [part.split(")")[0] for part in text.split("](")[1:]]
    local = [target.split("#")[0] for target in targets if "://" not in target and not target.startswith("#")]
    assert [target for target in local if not (document.parent / target).exists()] == []


@pytest.mark.needs("bash", "cmake", "make", "g++")
@pytest.mark.parametrize("document", [path for path in DOCUMENTS if path != TUTORIAL], ids=_name)
def test_the_reader_can_type_it(document: Path, tmp_path: Path) -> None:
    if not any(map(commands, blocks(document.read_text(encoding="utf-8")))):
        return
    folder = tmp_path / "an empty folder"
    folder.mkdir()
    shutil.copytree(ROOT / "examples_ws/src", folder / "examples_ws/src")
    run(document, folder)
