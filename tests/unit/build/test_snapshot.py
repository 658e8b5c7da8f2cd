"""What is on disk before a build."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import TYPE_CHECKING

from forge.base.layout import Layout
from forge.build.inputs.fingerprints import FileTable, contents_of, digest_of, fingerprint_files, stamp_files
from forge.build.journal import open_journal
from forge.build.model import BuildInputs, BuildRecord
from forge.build.snapshot import take_snapshot
from forge.build.up_to_date import InputChange, InputKind
from tests.packages import package

if TYPE_CHECKING:
    from tests.conftest import Tree


def test_what_is_there_is_seen(tree: Tree) -> None:
    root = tree(
        {
            "build/a/install_manifest.txt": "/ws/install/a/one\n/ws/install/a/../a/two\n",
            "build/b/CMakeCache.txt": "",
            "install/a/share/a/package.sh": "",
            **{f"src/{name}/package.xml": name for name in "abcd"},
        }
    )
    time.sleep(0.03)
    layout = Layout(root / "build", root / "install", None)
    table = FileTable(root / "table")
    journal = open_journal(root / "build")
    files = (str(root / "install/a/share/a/package.sh"),)
    journal.set_record(
        "a", BuildRecord(BuildInputs(), complete=True, installed=fingerprint_files(files, table), files=files)
    )
    packages = [package(name) for name in "abcd"]
    snapshot = take_snapshot(root, packages, layout, journal, table)
    assert snapshot.present == {"a"}
    assert dict(snapshot.listed) == {"a": ("/ws/install/a/one", "/ws/install/a/two"), "b": ()}
    assert snapshot.installed["a"] == journal.records["a"].installed
    (root / "src/b/package.xml").write_text("other")
    again = take_snapshot(root, packages, layout, journal, table)
    assert again.sources["a"] == snapshot.sources["a"]
    assert again.sources["b"].digest != snapshot.sources["b"].digest
    journal.close()


def test_a_changed_header_outside_moves_those_that_read_it(tree: Tree) -> None:
    root = tree({"usr/x.h": "1", "usr/y.h": "1", "src/a/package.xml": "", "src/b/package.xml": ""})
    table = FileTable(root / "table")
    journal = open_journal(root)
    for name, header in (("a", "x.h"), ("b", "y.h")):
        externals = (str(root / "usr" / header),)
        digest = digest_of(externals, contents_of(externals, table))
        journal.set_record(
            name, BuildRecord(BuildInputs(), complete=True, externals=externals, external=digest)
        )
    journal.set_stamp(stamp_files(journal.externals))
    layout = Layout(root / "build", root / "install", None)
    packages = [package("a"), package("b")]
    assert take_snapshot(root, packages, layout, journal, table).changed_externals == {}
    (root / "usr/x.h").write_text("2")
    assert take_snapshot(root, packages, layout, journal, table).changed_externals["a"] == InputChange(
        InputKind.OWN, "'usr/x.h' changed"
    )
    (root / "usr/x.h").write_text("1")
    assert take_snapshot(root, packages, layout, journal, FileTable(root / "other")).changed_externals == {}
    journal.set_record("b", replace(journal.records["b"], complete=False))
    (root / "usr/y.h").unlink()
    assert set(take_snapshot(root, packages, layout, journal, table).changed_externals) == {"b"}
    journal.close()
