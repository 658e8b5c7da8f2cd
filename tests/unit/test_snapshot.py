"""What is on disk before a build."""

from dataclasses import replace

from forge.layout import Layout
from forge.snapshot import take_snapshot
from tests.conftest import Tree
from tests.packages import package

CACHE = "# a cache\nCMAKE_GENERATOR:INTERNAL=Ninja\nX:STRING=1\n"


def test_what_is_there_is_seen(tree: Tree) -> None:
    root = tree(
        {
            "build/a/CMakeCache.txt": CACHE,
            "build/a/build.ninja": "",
            "build/a/handover/configured": "digest",
            "build/b/CMakeCache.txt": CACHE,
            "build/c/CMakeCache.txt": CACHE,
            "build/c/Makefile": "",
            "install/a/share/a/package.sh": "",
            "forge/e/package.xml": "one",
        }
    )
    layout = Layout(root / "build", root / "install", None)
    embedded = replace(package("e"), embedded=True, path=root / "forge" / "e")
    packages = [package("a"), package("b"), package("c"), package("d"), embedded]
    snapshot = take_snapshot(packages, layout, {"a": "record"})
    assert snapshot.installed == {"a"}
    assert snapshot.records == {"a": "record"}
    assert snapshot.configured == {"a": ("Ninja", "digest"), "b": ("Ninja", ""), "c": ("Ninja", "")}
    assert set(snapshot.sources) == {"e"}
    (root / "forge" / "e" / "package.xml").write_text("other")
    assert take_snapshot(packages, layout, {}).sources != snapshot.sources
