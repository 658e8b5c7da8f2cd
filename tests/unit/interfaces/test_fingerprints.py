"""The inputs of a digest; a run regenerates only what depends on a change."""

from __future__ import annotations

from typing import TYPE_CHECKING

from forge.interfaces.fingerprints import fingerprint_of_all, fingerprints
from forge.interfaces.read.parsing import parse_all
from forge.interfaces.read.sources import Library, read_folder
from forge.interfaces.resolve.dependencies import dependency_catalogs
from forge.interfaces.resolve.resolution import resolve

if TYPE_CHECKING:
    from pathlib import Path

    from tests.conftest import Forge, Tree

FILES = {
    "src/msg/Leaf.msg": "int8 a\n",
    "src/msg/Middle.msg": "Leaf leaf\nstd_msgs/Header header\n",
    "src/msg/Alone.msg": "int8 a\n",
    "src/srv/Top.srv": "Middle[] middle\n---\n",
}


def digests(folder: Path, generator: str = "") -> dict[str, str]:
    library = Library()
    catalog = resolve("tour", parse_all(read_folder("tour", folder)), library)
    found = fingerprints((catalog, *dependency_catalogs(catalog, library)), generator)
    assert fingerprint_of_all(catalog, found) not in found.values()
    return {str(name): digest for name, digest in found.items()}


def test_a_digest_changes_with_every_text_below_and_with_no_other(tree: Tree) -> None:
    before = digests(tree(FILES) / "src")
    assert before == digests(tree(FILES) / "src")
    after = digests(tree({"src/msg/Leaf.msg": "int8 a # new\n"}) / "src")
    assert before.keys() == after.keys()
    changed = {name for name in before if before[name] != after[name]}
    assert changed == {"tour/msg/Leaf", "tour/msg/Middle", "tour/srv/Top"}
    assert "builtin_interfaces/msg/Time" in before
    other = digests(tree(FILES) / "src", "another forge")
    assert all(before[name] != other[name] for name in before)


def test_the_same_text_under_another_name_is_not_the_same(tree: Tree) -> None:
    found = digests(tree(FILES) / "src")
    assert found["tour/msg/Leaf"] != found["tour/msg/Alone"]


def test_a_run_rewrites_what_depends_on_a_change_and_restores_missing_files(forge: Forge, tree: Tree) -> None:
    root = tree(FILES)

    def generate() -> set[str]:
        """Return the files that a run has written."""
        before = marks()
        ran = forge("interface", "generate", "--package", "tour", "--output", "out", "src", cwd=root)
        assert (ran.code, ran.err) == (0, "")
        after = marks()
        written = {name for name in after if after[name] != before.get(name)}
        assert ran.out.startswith(f"{len(written)} of {len(after)} files")
        return written

    def marks() -> dict[str, int]:
        paths = [path for folder in ("python", "cpp") for path in (root / "out" / folder).rglob("*")]
        return {
            path.relative_to(root / "out").as_posix(): path.stat().st_mtime_ns
            for path in paths
            if path.is_file()
        }

    generate()
    assert generate() == set()
    leaf = root / "out/python/tour/msg/_leaf.py"
    content = leaf.read_text()
    leaf.unlink()
    alone = root / "out/cpp/tour/msg/alone.hpp"
    alone.write_text("mended")
    assert generate() == {"python/tour/msg/_leaf.py", "cpp/tour/msg/alone.hpp"}
    assert leaf.read_text() == content
    assert alone.read_text() != "mended"
    (root / "src/msg/Alone.msg").write_text("int8 b\n")
    assert all("alone" in path for path in generate())
    (root / "src/msg/Alone.msg").unlink()
    assert generate() == {"python/tour/msg/__init__.py", "python/tour/msg/__init__.pyi"}
    assert not list((root / "out").rglob("*alone*"))
    assert generate() == set()
