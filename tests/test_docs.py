"""What the README and the docs tell the reader to type works as told."""

from __future__ import annotations

import re
import shutil
from typing import TYPE_CHECKING

import pytest

from forge.cli import COMMANDS
from tests.snippets import ROOT, TYPED, blocks, commands, run

if TYPE_CHECKING:
    from pathlib import Path

    from tests.conftest import Forge

DOCUMENTS = sorted({ROOT / "README.md", *(ROOT / "docs").rglob("*.md")})
TUTORIAL = ROOT / "docs/tutorial.md"  # tests/e2e/test_tutorial.py follows it, and goes on from where it ends


VERBS = {
    "mixin": ("list", "show"),
    "interface": ("list", "package", "packages", "show", "proto", "hash", "schema", "generate"),
    "pkg": ("create", "list", "executables", "prefix", "xml"),
}


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


@pytest.mark.parametrize("command", COMMANDS)
def test_the_reference_knows_each_option_of_each_command(forge: Forge, command: str) -> None:
    """--help and the page list the same options; those that commands share have a section of their own."""
    text = (ROOT / "docs/reference/commands.md").read_text(encoding="utf-8")
    first, *parts = text.split("\n## ")
    sections = {part.split("\n", 1)[0]: _options(part) for part in parts}
    verbs: tuple[tuple[str, ...], ...] = tuple((verb,) for verb in VERBS.get(command, ())) or ((),)
    offered = set().union(*(_options(forge(command, *verb, "--help").out) for verb in verbs)) - {"--help"}
    shared = _options(first) | sections["Which packages"]
    documented = sections[f"forge {command}"]
    assert documented <= offered
    assert offered <= documented | shared


def _options(text: str) -> set[str]:
    """Return the long options in a text; the spelling with '_' is an old one that nobody needs to know."""
    return set(re.findall(r"(?<![\w-])--[a-z][a-z-]+(?![\w_])", text))
