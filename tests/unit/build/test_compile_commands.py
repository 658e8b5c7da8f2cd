"""compile_commands.json for the whole workspace."""

from __future__ import annotations

import json
import os
from typing import TYPE_CHECKING

from forge.build.compile_commands import merge_compile_commands

if TYPE_CHECKING:
    from tests.conftest import Tree


def test_lists_become_one_list_and_odd_files_are_left_out(tree: Tree) -> None:
    root = tree(
        {
            "a/compile_commands.json": '[\n{"file": "1"},\n{"file": "2"}\n]\n',
            "b/compile_commands.json": "[]\n",
            "c/compile_commands.json": '[{"file": "3"}]',
            "d/compile_commands.json": '[{"fi',
        }
    )
    assert merge_compile_commands(root)
    assert json.loads((root / "compile_commands.json").read_text()) == [
        {"file": "1"},
        {"file": "2"},
        {"file": "3"},
    ]


def test_it_is_written_only_when_a_part_changed(tree: Tree) -> None:
    root = tree({"a/compile_commands.json": '[{"file": "1"}]', "b/compile_commands.json": "[]"})
    assert merge_compile_commands(root)
    assert not merge_compile_commands(root)
    later = (root / "compile_commands.json").stat().st_mtime_ns + 10**9
    os.utime(root / "a/compile_commands.json", ns=(later, later))
    assert not merge_compile_commands(root)
    (root / "a/compile_commands.json").write_text('[{"file": "2"}]')
    os.utime(root / "a/compile_commands.json", ns=(later, later))
    assert merge_compile_commands(root)
    (root / "a/compile_commands.json").unlink()
    (root / "b/compile_commands.json").unlink()
    assert not merge_compile_commands(root)
    assert not (root / "compile_commands.json").exists()
