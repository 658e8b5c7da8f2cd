"""compile_commands.json for the whole workspace."""

import json
import os

from forge.plugins.compile_commands.merging import merge_compile_commands
from tests.conftest import Tree


def test_compile_commands_of_all_packages_are_merged_skipping_invalid_files(tree: Tree) -> None:
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


def test_compile_commands_are_rewritten_only_after_a_change(tree: Tree) -> None:
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


def test_each_source_of_a_unity_file_has_its_own_entry(tree: Tree) -> None:
    root = tree({"a/Unity/unity_0_c.c": '/* generated */\n\n#include "/g/one.c"\n\n#include "/g/two.c"\n'})
    unit = f"{root}/a/Unity/unity_0_c.c"
    entries = [
        {"directory": "/b", "command": f"cc -c {unit} -o unit.o", "file": unit, "output": "unit.o"},
        {"directory": "/b", "command": "cc -c own.c", "file": "own.c"},
    ]
    (root / "a/compile_commands.json").write_text(json.dumps(entries))
    assert merge_compile_commands(root)
    assert json.loads((root / "compile_commands.json").read_text()) == [
        {"directory": "/b", "command": "cc -c /g/one.c -o unit.o", "file": "/g/one.c"},
        {"directory": "/b", "command": "cc -c /g/two.c -o unit.o", "file": "/g/two.c"},
        entries[1],
    ]


def test_sources_added_to_a_unity_file_get_entries(tree: Tree) -> None:
    root = tree({"a/Unity/unity_0_c.c": '#include "/g/one.c"\n', "a/CMakeCache.txt": ""})
    unit = f"{root}/a/Unity/unity_0_c.c"
    entry = {"directory": "/b", "command": f"cc -c {unit}", "file": unit}
    (root / "a/compile_commands.json").write_text(json.dumps([entry]))
    assert merge_compile_commands(root)
    (root / "a/Unity/unity_0_c.c").write_text('#include "/g/one.c"\n#include "/g/two.c"\n')
    later = (root / "compile_commands.json").stat().st_mtime_ns + 10**9
    os.utime(root / "a/CMakeCache.txt", ns=(later, later))
    assert merge_compile_commands(root)
    named = [entry["file"] for entry in json.loads((root / "compile_commands.json").read_text())]
    assert named == ["/g/one.c", "/g/two.c"]


def test_damaged_unity_entries_are_skipped(tree: Tree) -> None:
    root = tree(
        {
            "a/compile_commands.json": '["/Unity/unity_0_c.c"]',
            "b/compile_commands.json": '[{"file": "/Unity/unity_0_c.c"}, ]',
            "c/compile_commands.json": '[{"file": "/missing/Unity/unity_0_c.c"}]',
            "d/compile_commands.json": '[{"file": "1"}]',
        }
    )
    assert merge_compile_commands(root)
    assert json.loads((root / "compile_commands.json").read_text()) == [{"file": "1"}]
